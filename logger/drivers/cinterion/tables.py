"""Tables of Siemens and Cinterion modems: ^MONI, ^MONP, ^SMONP and the scan of ^SNMON
(firmware_notes/cinterion.md).

    chann rs  dBm  PLMN  LAC cell NCC BCC PWR RXLev  C1 I chann TS timAdv PWR  dBm Q ChMod
     847  19  -75 26201 2A3B 4C5D   5   2  33  -104  30 I    No connection

`dBm` is the level; `RXLev` and `PWR` are parameters of the cell, and `rs` is an index of another
scale on each model. The network is one column or two (MC35 manual V05.00 p186, TC63 manual V00.490
p194).
"""

import re
from collections.abc import Iterator, Sequence

from logger.core.types import CellReading
from logger.drivers.reading.fields import area, at, cell_identity, decimal, level, network, rssi_dbm
from logger.drivers.reading.fields import values as split
from logger.drivers.reading.rows import NoCell, Row

_FLAGS = re.ASCII | re.IGNORECASE
_NUMBER = r"(?:-?\d{1,3}|-+)"
_PLACE = r"(?<![\w.,:+-])(?P<chann>\d{1,4})\s+(?P<rs>\d{1,2})\s+(?P<dbm>-\d{2,3})\s+(?P<mcc>\d{3})\s*(?P<mnc>\d{2,3})\s+"
_MONI = re.compile(
    _PLACE
    + r"(?P<lac>[0-9A-F]{4}|-+)\s+(?P<cell>[0-9A-F]{4}|-+)\s+(?P<ncc>[0-7]|-+)\s+(?P<bcc>[0-7]|-+)"
    + rf"\s+{_NUMBER}\s+{_NUMBER}\s+(?P<c1>{_NUMBER})\s+[I|](?P<rest>.*)",
    _FLAGS,
)
_MONP = re.compile(
    _PLACE + rf"(?P<bcc>[0-7]|-+)\s+(?P<c1>{_NUMBER})\s+(?P<c2>{_NUMBER})\W*\Z", _FLAGS
)
_DEDICATED = re.compile(
    r"\s*(?:\d{1,4}|h)\s+\d\s+(?P<ta>\d{1,2})\s+\d{1,2}\s+-?\d{1,3}\s+(?P<q>[0-7])\s+\w{2,6}\W*\Z",
    _FLAGS,
)
_MONI_HEADER = re.compile(
    r"\bchann\s+rs\s+dBm\b.*\bNCC\b|\bServing Cell\b.*\bDedicated channel\b", _FLAGS
)
_SEARCHING = re.compile(r"(?:\A|\bI\s|[\s\]])\s*(Searching)\W*\Z", _FLAGS)

_MINUS = re.compile("\u00e2\x80[\x92-\x95]|[\u2012-\u2015\u2212\x96]")
"""Dashes that stand for a minus in text pasted from a manual, also where its UTF-8 was read byte by
byte.
"""

_HEADING = re.compile(r"(?:\A|\s)([2-5]G):\s*\Z", _FLAGS)
_HEX4 = r"(?:[0-9A-F]{4}|-+)"
_SMONP_2G = re.compile(
    r"(?:\A|\s)(?P<arfcn>\d{1,4}),(?P<rs>\d{1,2}),(?P<dbm>-\d{2,3}),(?P<mcc>\d{3}|-+),(?P<mnc>\d{2,3}|-+)"
    rf",(?P<ncc>[0-7]|-+),(?P<bcc>[0-7]|-+),(?P<c1>{_NUMBER}),(?P<c2>{_NUMBER}),"
    rf"(?P<lac>{_HEX4}),(?P<cell>{_HEX4}),[-\d,]+\Z",
    _FLAGS,
)
_SMONP_3G = re.compile(
    r"(?:\A|\s)(?P<arfcn>\d{1,5}),(?P<psc>\d{1,3}),(?P<ecn0>-?\d{1,2}(?:\.\d)?|-+),(?P<rscp>-\d{2,3})(?:,[-\d.,]+)?\Z",
    _FLAGS,
)
_SNMON = re.compile(r'\^SNMON\s*:\s*"?INS"?\s*,\s*([^\^]*)', _FLAGS)
_SNMON_FORM = ("reserved", "band", "rat", "cell", "lac", "plmn", "arfcn", "index", "dbm", "last")


def rows_of_tables(lines: Sequence[str]) -> Iterator[Row]:
    """Serving cell of ^MONI, neighbours of ^MONP and ^SMONP, and the word that there is no cell."""
    moni = False
    heading = ""
    for line in lines:
        text = _MINUS.sub("-", line.strip())
        moni = moni or _MONI_HEADER.search(text) is not None
        title = _HEADING.search(text)
        heading = title[1].upper() if title else "" if "^" in text or text == "OK" else heading
        row = _moni(text) or _monp(text) or _smonp(text, heading)
        if row is not None:
            yield row
        elif moni and (word := _SEARCHING.search(text)):
            yield NoCell("GSM", state=word[1])


def _moni(line: str) -> CellReading | None:
    row = _MONI.search(line)
    if row is None:
        return None
    mcc, mnc = network(row["mcc"], row["mnc"])
    ncc, bcc = decimal(row["ncc"]), decimal(row["bcc"])
    call = _DEDICATED.match(row["rest"])
    state = " ".join(re.findall(r"[A-Za-z]+", row["rest"]))
    return CellReading(
        role="serving",
        rat="GSM",
        mcc=mcc,
        mnc=mnc,
        lac=area(row["lac"]) if mcc else None,
        cid=cell_identity(row["cell"], 16) if mcc else None,
        arfcn=decimal(row["chann"], 0, 1023),
        bsic=None if ncc is None or bcc is None else 8 * ncc + bcc,
        rssi_dbm=rssi_dbm(row["dbm"]),
        rxq=decimal(call["q"]) if call else None,
        ta=decimal(call["ta"], 0, 63) if call else None,
        c1=decimal(row["c1"], -255, 255),
        more={"ncc": ncc, "bcc": bcc} | ({} if call or not state else {"state": state}),
    )


def _monp(line: str) -> CellReading | None:
    row = _MONP.search(line)
    if row is None:
        return None
    mcc, mnc = network(row["mcc"], row["mnc"])
    return CellReading(
        role="neighbour",
        rat="GSM",
        mcc=mcc,
        mnc=mnc,
        arfcn=decimal(row["chann"], 0, 1023),
        rssi_dbm=rssi_dbm(row["dbm"]),
        c1=decimal(row["c1"], -255, 255),
        c2=decimal(row["c2"], -255, 255),
        more={"bcc": decimal(row["bcc"])},
    )


def _smonp(line: str, heading: str) -> CellReading | None:
    """Neighbour of AT^SMONP=255; what a row means is said by the heading above it."""
    form = {"2G": _SMONP_2G, "3G": _SMONP_3G}.get(heading)
    row = form.search(line) if form else None
    if row is None:
        return None
    named = {name: text or "" for name, text in row.groupdict().items()}
    mcc, mnc = network(named.get("mcc", ""), named.get("mnc", ""))
    ncc, bcc = (decimal(named.get(name, "")) for name in ("ncc", "bcc"))
    return CellReading(
        role="neighbour",
        rat="GSM" if heading == "2G" else "WCDMA",
        mcc=mcc,
        mnc=mnc,
        lac=area(named.get("lac", "")) if mcc else None,
        cid=cell_identity(named.get("cell", ""), 16) if mcc else None,
        arfcn=decimal(named["arfcn"], 0, 1023 if heading == "2G" else 16383),
        bsic=None if ncc is None or bcc is None else 8 * ncc + bcc,
        psc=decimal(named.get("psc", ""), 0, 511),
        rssi_dbm=rssi_dbm(named.get("dbm", "")),
        rscp_dbm=rssi_dbm(named.get("rscp", "")),
        ecio_db=level(named.get("ecn0", ""), -32.0, 0.0),
        c1=decimal(named.get("c1", ""), -255, 255),
        c2=decimal(named.get("c2", ""), -255, 255),
    )


def scanned(line: str) -> Iterator[Row]:
    """Cells of the scan `AT^SNMON="INS",2`; in which base it prints area and cell is not
    documented: they stay text.
    """
    for text in _SNMON.findall(line):
        fields = split(text)
        named = dict(zip(_SNMON_FORM, fields, strict=False))
        gsm = named.get("rat") == "0"
        if len(fields) != len(_SNMON_FORM) or named["rat"] not in {"0", "2"}:
            continue
        plmn = named["plmn"]
        mcc, mnc = network(plmn[:3], plmn[3:])
        yield CellReading(
            role="scan",
            rat="GSM" if gsm else "WCDMA",
            mcc=mcc,
            mnc=mnc,
            arfcn=decimal(named["arfcn"], 0, 1023 if gsm else 16383),
            psc=None if gsm else decimal(at(fields, -1), 0, 511),
            rssi_dbm=rssi_dbm(named["dbm"]) if gsm else None,
            rscp_dbm=None if gsm else rssi_dbm(named["dbm"]),
            more={"lac_raw": named["lac"], "cell_raw": named["cell"]},
        )
