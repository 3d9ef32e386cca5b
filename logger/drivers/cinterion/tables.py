"""Tables of Siemens and Cinterion modems: ^MONI, ^MONP, ^SMONP and the scan of ^SNMON.

    chann rs  dBm  PLMN  LAC cell NCC BCC PWR RXLev  C1 I chann TS timAdv PWR  dBm Q ChMod
     847  19  -75 26201 2A3B 4C5D   5   2  33  -104  30 I    No connection

`dBm` is the level; `RXLev` and `PWR` are parameters of the cell, and `rs` is an index of another
scale on each model. The network is one column or two (MC35 manual V05.00 p186, TC63 manual V00.490
p194; firmware_notes/cinterion.md).
"""

import re
from collections.abc import Iterator, Sequence
from typing import Any

from logger.core.types import CellReading, Rat, Role
from logger.drivers.reading.cell_values import read_values
from logger.drivers.reading.fields import bsic_of, decimal, network
from logger.drivers.reading.fields import values as split
from logger.drivers.reading.rows import NoCell, Row

_FLAGS = re.ASCII | re.IGNORECASE
WORDS = (
    "Serving Cell Dedicated channel chann rs dBm PLMN MCC MNC LAC cell NCC BCC PWR RXLev C1 C2 I TS"
    " timAdv Q ChMod No connection Limited Service Reselection Searching 2G 3G 4G 5G"
    " EARFCN UARFCN PSC EC n0 RSCP Squal Srxlev Phys Ch SF Slot ComMod HSUPA HSDPA S_FR S_HR S_EFR"
)
"""Words of the tables."""
_NUMBER = r"(?:-?\d{1,3}|-+)"
_PLACE = (
    r"(?<![\w.,:+-])(?P<arfcn>\d{1,4})\s+(?P<rs>\d{1,2})\s+(?P<rssi>-\d{2,3})\s+"
    r"(?P<mcc>\d{3})\s*(?P<mnc>\d{2,3})\s+"
)
_MONI = re.compile(
    _PLACE
    + r"(?P<lac>[0-9A-F]{4}|-+)\s+(?P<cid16>[0-9A-F]{4}|-+)\s+(?P<ncc>[0-7]|-+)\s+(?P<bcc>[0-7]|-+)"
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
"""Dashes for a minus in text from a manual, also where UTF-8 was read byte by byte."""

_HEADING = re.compile(r"(?:\A|\s)([2-5]G):\s*\Z", _FLAGS)
_HEX4 = r"(?:[0-9A-F]{4}|-+)"
_SMONP_2G = re.compile(
    r"(?:\A|\s)(?P<arfcn>\d{1,4}),(?P<rs>\d{1,2}),(?P<rssi>-\d{2,3}),"
    r"(?P<mcc>\d{3}|-+),(?P<mnc>\d{2,3}|-+)"
    rf",(?P<ncc>[0-7]|-+),(?P<bcc>[0-7]|-+),(?P<c1>{_NUMBER}),(?P<c2>{_NUMBER}),"
    rf"(?P<lac>{_HEX4}),(?P<cid16>{_HEX4}),[-\d,]+\Z",
    _FLAGS,
)
_SMONP_3G = re.compile(
    r"(?:\A|\s)(?P<uarfcn>\d{1,5}),(?P<psc>\d{1,3}),"
    r"(?P<ecn0>-?\d{1,2}(?:\.\d)?|-+),(?P<rscp>-\d{2,3})(?:,[-\d.,]+)?\Z",
    _FLAGS,
)
_SNMON = re.compile(r'\^SNMON\s*:\s*"?INS"?\s*,\s*([^\^]*)', _FLAGS)
_SNMON_FORM = ("reserved", "band", "rat", "cell", "lac", "plmn", "channel", "index", "dbm", "last")


def table_rows(lines: Sequence[str]) -> Iterator[Row]:
    """Serving cell of ^MONI, neighbours of ^MONP and ^SMONP; `NoCell` while the modem searches."""
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
    colours = {"ncc": decimal(row["ncc"]), "bcc": decimal(row["bcc"])}
    call = _DEDICATED.match(row["rest"])
    state = " ".join(re.findall(r"[A-Za-z]+", row["rest"]))
    return _cell(
        row,
        "serving",
        bsic=bsic_of(**colours),
        rxq=decimal(call["q"]) if call else None,
        ta=decimal(call["ta"], 0, 63) if call else None,
        more=colours | ({} if call or not state else {"state": state}),
    )


def _monp(line: str) -> CellReading | None:
    row = _MONP.search(line)
    return _cell(row, "neighbour", more={"bcc": decimal(row["bcc"])}) if row else None


def _smonp(line: str, heading: str) -> CellReading | None:
    """Neighbour of AT^SMONP=255; the heading above a row decides how it is read."""
    form = {"2G": _SMONP_2G, "3G": _SMONP_3G}.get(heading)
    row = form.search(line) if form else None
    if row is None:
        return None
    if heading == "3G":
        return _cell(row, "neighbour", "WCDMA")
    return _cell(row, "neighbour", bsic=bsic_of(decimal(row["ncc"]), decimal(row["bcc"])))


def _cell(row: re.Match[str], role: Role, rat: Rat = "GSM", **values: Any) -> CellReading:
    """Reading of a row by the names of its groups, with more `values`."""
    named = {name: text or "" for name, text in row.groupdict().items()}
    mcc, mnc = network(named.get("mcc", ""), named.get("mnc", ""))
    if not mcc:
        named |= dict.fromkeys(named.keys() & {"lac", "cid16"}, "")
    return CellReading(role, rat, mcc, mnc, **read_values(named), **values)


def scan_cells(line: str) -> Iterator[Row]:
    """Cells of the scan `AT^SNMON="INS",2`, whose base of area and cell no manual gives: text."""
    for text in _SNMON.findall(line):
        fields = split(text)
        named = dict(zip(_SNMON_FORM, fields, strict=False))
        if len(fields) != len(_SNMON_FORM) or named["rat"] not in {"0", "2"}:
            continue
        gsm = named["rat"] == "0"
        channel, level = ("arfcn", "rssi") if gsm else ("uarfcn", "rscp")
        texts = {channel: named["channel"], level: named["dbm"]}
        mcc, mnc = network(named["plmn"][:3], named["plmn"][3:])
        yield CellReading(
            role="scan",
            rat="GSM" if gsm else "WCDMA",
            mcc=mcc,
            mnc=mnc,
            more={"lac_raw": named["lac"], "cell_raw": named["cell"]},
            **read_values(texts if gsm else texts | {"psc": named["last"]}),
        )
