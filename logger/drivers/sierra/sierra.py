"""Sierra Wireless MC, EM and WP: cells from !GSTATUS and !LTEINFO (firmware_notes/sierra.md).

    !GSTATUS:                                                labels and values, two on a line
    System mode:   LTE              PS state:    Attached
    LTE band:      B7               LTE bw:      20 MHz
    LTE Rx chan:   3110             LTE Tx chan: 21110
    PCC RxM RSSI:  -89              PCC RxM RSRP:  -117
    Tx Power:      --               TAC:         2B67 (11111)    hexadecimal, and decimal in the brackets
    RSRQ (dB):     -8.0             Cell ID:     00005101 (20737)

    Serving:   EARFCN MCC MNC   TAC      CID Bd D U SNR PCI  RSRQ   RSRP   RSSI RXLV
                  800 310 410 35666 0A14666A  2 5 5  22 404 -14.1  -79.6  -45.5 --

!GSTATUS does not tell the network; a poll takes it from +COPS.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from logger.core.types import CellReading, Rat
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.fields import (
    EIGHT,
    area,
    cell_identity,
    decimal,
    level,
    network,
    pieces,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
)
from logger.drivers.reading.number_text import confirm
from logger.drivers.reading.rows import NoCell, Operator, Row

_FLAGS = re.ASCII | re.IGNORECASE
_SECTION = re.compile(  # a reply, also one whose first line is lost
    r"(?:!(?:GSTATUS|LTEINFO)\b|(?=\b(?:Current Time|System mode)\s*:|\bServing\s*:\s+EARFCN))"
    r".*?(?=[!+*^$][A-Z]{3}|\bOK\s|\bOK\W*\n|\bERROR\b|\Z)",
    _FLAGS | re.DOTALL,
)

_RATS: Mapping[str, Rat] = {
    "LTE": "LTE",
    "ENDC": "LTE",
    "WCDMA": "WCDMA",
    "UMTS": "WCDMA",
    "GSM": "GSM",
    "NR5G": "NR",
}
_UMTS_LEVEL = (r"RX level C0", r"RxM RSSI C0", r"RX level \(dBm\)", r"RX level")
_LABELS: Mapping[
    Rat, Mapping[str, tuple[str, ...]]
] = {  # the main antenna of the main carrier first
    "LTE": {
        "channel": (r"LTE Rx chan",),
        "rssi": (r"PCC RxM RSSI", r"RSSI \(dBm\)"),
        "rsrp": (r"PCC RxM RSRP", r"RSRP \(dBm\)"),
        "rsrq": (r"RSRQ \(dB\)",),
        "sinr": (r"SINR \(dB\)",),
    },
    "NR": {
        "channel": (r"NR5G Rx chan",),
        "rsrp": (r"NR5G RSRP \(dBm\)",),
        "rsrq": (r"NR5G RSRQ \(dB\)",),
        "sinr": (r"NR5G SINR \(dB\)",),
    },
    "WCDMA": {"channel": (r"WCDMA channel",), "rssi": _UMTS_LEVEL},
    "GSM": {"channel": (r"GSM channel",), "rssi": _UMTS_LEVEL},
}
_BAND = r"(?:LTE band\s*:\s*(B\d{1,3})|NR5G band\s*:\s*(n\d{1,3})|%s band\s*:\s*((?!unknown)(?:WCDMA )?\w+))(?!\w)"
_BITS: Mapping[Rat, tuple[int, int]] = {
    "GSM": (16, 16),
    "WCDMA": (16, 28),
    "LTE": (16, 28),
    "NR": (24, 36),
}
_MODE = re.compile(r"System mode\s*:\s*([A-Za-z0-9]+(?: (?!PS\b)[A-Za-z]+)*)", _FLAGS)

_TABLE = re.compile(
    r"(?:\A|[\s\]])(Serving|IntraFreq|InterFreq|WCDMA|GSM|CDMA[ \w]*):\s+(.*\S)\s*\Z", _FLAGS
)
_NUMBER = r"-?\d{1,5}(?:\.\d{1,2})?"
_FORMS = {"MCC": r"\d{3}", "MNC": r"\d{2,3}", "TAC": r"\d{1,5}", "CID": r"[0-9A-F]{8}"}
_TABLE_RATS: Mapping[str, Rat] = {
    "SERVING": "LTE",
    "INTRAFREQ": "LTE",
    "INTERFREQ": "LTE",
    "WCDMA": "WCDMA",
    "GSM": "GSM",
}


class Sierra(Family):
    """The serving cell of all technologies, neighbours on LTE; HL and SL modules speak other
    dialects.
    """

    name = "sierra"
    claim = Claim(maker=r"\A(?!.*\b(?:HL|SL|Q2)\d)(?:.*\bSIERRA WIRELESS\b|.*\bAIRPRIME\b)")
    setup_commands = (Command("AT+COPS=3,2"),)  # the form of the answer; it chooses none
    poll_commands = (
        Command("AT+COPS?"),
        Command("AT!GSTATUS?"),
        Command("AT!LTEINFO?"),
    )
    survey_commands = (Command("AT+COPS=?", timeout_s=180.0),)
    mode_commands = network_mode.SELRAT

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells heard now, the serving one once, and with its network."""
        rows = yield from self.ask(self.poll_commands)
        return None if rows is None else joined(rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Serving cells of !GSTATUS, all cells of !LTEINFO."""
        text = "\n".join(line.replace("\\t", "\t") for line in pieces(lines)) + "\n"
        found: list[Row] = []
        for section in _SECTION.findall(text):
            found += (*_status(section), *_tables(section.splitlines()))
        return tuple(found)


def joined(rows: Sequence[Row]) -> tuple[Row, ...]:
    """Rows of one poll: no second serving cell of a technology beside a whole one; the network is
    that of +COPS.
    """
    whole = {
        row.rat
        for row in rows
        if isinstance(row, CellReading) and row.role == "serving" and row.cell
    }
    chosen = next(
        (row for row in rows if isinstance(row, Operator) and row.stat is None and row.plmn), None
    )
    mcc, mnc = network(chosen.plmn[:3], chosen.plmn[3:]) if chosen and chosen.plmn else (None, None)
    kept: list[Row] = []
    for row in rows:
        if not isinstance(row, CellReading) or row.role != "serving" or row.cell:
            kept.append(row)
        elif row.rat not in whole:
            own = chosen is not None and chosen.rat == row.rat and row.cid is not None
            kept.append(replace(row, mcc=mcc, mnc=mnc) if own else row)
    return tuple(kept)


def _status(text: str) -> Iterator[Row]:
    mode = _MODE.search(text)
    if mode is None:
        return
    rat = _RATS.get(mode[1].upper())
    if rat is None:
        yield NoCell(status=mode[1])
        return
    labels = _LABELS[rat]
    area_bits, cell_bits = _BITS[rat]
    (where, place_agrees), (who, cell_agrees) = (
        _in_brackets(text, label) for label in ("TAC" if rat in {"LTE", "NR"} else "LAC", "Cell ID")
    )
    place = confirm(area(where, 10, area_bits)) if who else None  # in two bases
    identity = confirm(cell_identity(who, cell_bits, 10)) if where else None
    channel = decimal(_value(text, labels["channel"]), 0, 3279165)
    reading = CellReading(
        role="serving",
        rat=rat,
        lac=None if rat in {"LTE", "NR"} else place,
        tac=place if rat in {"LTE", "NR"} else None,
        cid=identity,
        arfcn=None if channel == 0xFFFF else channel,
        band=_band(text, rat),
        rssi_dbm=rssi_dbm(_value(text, labels.get("rssi", ()))),
        rsrp_dbm=rsrp_dbm(_value(text, labels.get("rsrp", ()))),
        rsrq_db=rsrq_db(_value(text, labels.get("rsrq", ()))),
        sinr_db=level(_value(text, labels.get("sinr", ())), -30.0, 50.0),
        identity_unsure=not (place_agrees and cell_agrees),
    )
    nothing = reading.level_dbm is None and reading.cid is None and reading.arfcn is None
    yield NoCell(rat, status=mode[1]) if nothing else reading


def _value(text: str, labels: Sequence[str]) -> str:
    """What follows the first of the labels that is there; a label inside a longer one is
    another.
    """
    for label in labels:
        found = re.search(rf"(?<![A-Z])(?<![A-Z] ){label}[ \t]*:[ \t]*([-+.\w]*)", text, _FLAGS)
        if found:
            return found[1]
    return ""


def _in_brackets(text: str, label: str) -> tuple[str, bool]:
    """The decimal number in brackets behind a hexadecimal one, and whether the two are the same.

    Modems are seen that print the two differently. Which is right, nobody knows.
    """
    found = re.search(
        rf"(?<![A-Z]){label}\s*:\s*([0-9A-F]{{1,9}})\s*\((\d{{1,11}})\)", text, _FLAGS
    )
    return (found[2], int(found[1], 16) == int(found[2])) if found else ("", True)


def _band(text: str, rat: Rat) -> str | None:
    found = re.search(_BAND % rat, text, _FLAGS)
    return next((name for name in found.groups() if name), None) if found else None


def _tables(lines: Sequence[str]) -> Iterator[Row]:
    """Rows below their headings; the column names of a heading say what a row has."""
    kind, names = "", [""]
    serving = CellReading("serving")
    for line in lines:
        table = _TABLE.search(line)
        if table:
            kind, names = table[1].upper(), table[2].upper().split()
            continue
        named = _row(names, line.split())
        rat = _TABLE_RATS.get(kind)
        if named is None or rat is None:
            continue
        reading = _reading(kind, rat, named)
        if kind == "SERVING":
            serving = reading
        elif kind == "INTRAFREQ":
            if reading.pci == serving.pci:
                continue  # the serving cell again
            reading = replace(reading, arfcn=serving.arfcn)
        yield reading


def _row(names: Sequence[str], words: Sequence[str]) -> dict[str, str] | None:
    """Values by column; a log may write before the row, but no number."""
    before, values = words[: -len(names)], words[-len(names) :]
    if (
        len(values) != len(names)
        or len(names) < 5
        or (before and re.fullmatch(_NUMBER, before[-1]))
    ):
        return None
    named = dict(zip(names, values, strict=True))
    whole = all(
        re.fullmatch(rf"-+|{_FORMS.get(name, _NUMBER)}", text, _FLAGS)
        for name, text in named.items()
    )
    return named if whole else None


def _reading(kind: str, rat: Rat, named: Mapping[str, str]) -> CellReading:
    mcc, mnc = network(named.get("MCC", ""), named.get("MNC", ""))
    channel = named.get("EARFCN") or named.get("UARFCN") or named.get("ARFCN", "")
    return CellReading(
        role="serving" if kind == "SERVING" else "neighbour",
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        tac=area(named.get("TAC", ""), 10) if mcc else None,
        cid=cell_identity(named.get("CID", ""), 28, form=EIGHT) if mcc else None,
        arfcn=decimal(channel, 0, 262143),
        band=decimal(named.get("BD", ""), 1, 255),
        psc=decimal(named.get("PSC", ""), 0, 511),
        pci=decimal(named.get("PCI", ""), 0, 503),
        rssi_dbm=rssi_dbm(named.get("RSSI", "")),
        rscp_dbm=rssi_dbm(named.get("RSCP", "")),
        ecio_db=level(named.get("ECN0", ""), -32.0, 0.0),
        rsrp_dbm=rsrp_dbm(named.get("RSRP", "")),
        rsrq_db=rsrq_db(named.get("RSRQ", "")),
        sinr_db=level(named.get("SNR", ""), -30.0, 50.0),
        more={"srxlev": decimal(named.get("RXLV", ""), -255, 255)},
    )
