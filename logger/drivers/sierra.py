"""Sierra Wireless MC, EM and WP: cells from !GSTATUS and !LTEINFO.

    AT!GSTATUS?
    !GSTATUS:                                                labels and values, two on a line
    System mode:   LTE              PS state:    Attached
    LTE band:      B7               LTE bw:      20 MHz
    LTE Rx chan:   3110             LTE Tx chan: 21110
    PCC RxM RSSI:  -89              PCC RxM RSRP:  -117
    Tx Power:      --               TAC:         2B67 (11111)    hexadecimal (decimal)
    RSRQ (dB):     -8.0             Cell ID:     00005101 (20737)
    OK
    AT!LTEINFO?
    !LTEINFO:
    Serving:   EARFCN MCC MNC   TAC      CID Bd D U SNR PCI  RSRQ   RSRP   RSSI RXLV
                  800 310 410 35666 0A14666A  2 5 5  22 404 -14.1  -79.6  -45.5 --

Needs: AT+COPS=3,2, the form of the answer that contains the network; !GSTATUS does not.
Known by: the maker, but not the HL, SL and Q2 modules.
Doubts: area and cell are printed in two bases; where they differ the identity is unsure. Neighbours
only on LTE.
Sources: measured replies in public code and public logs of MC7455 and WP7607
(firmware_notes/sierra.md).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar

from logger.core.types import CellReading, Rat
from logger.drivers import network_mode
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading.row_language import (
    EIGHT,
    VALUES,
    Kinds,
    NoCell,
    Operator,
    Row,
    Value,
    area,
    cell_identity,
    confirm,
    form,
    network_of,
    number,
    pieces,
    read_values,
)
from logger.drivers.reading.standard_replies import chosen_networks, is_serving

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
_WITH_NR = "ENDC"  # LTE, and a carrier of NR beside it
_OF_LTE = frozenset({8, 9})  # in +COPS, CAT-M and NB-IoT, which !GSTATUS calls LTE
# lines of the second antenna and of further carriers, whose levels have the labels of the main one
_NOT_MAIN = re.compile(r"^[ \t]*(?:PCC RxD|SCC\d? Rx[MD])\b.*", _FLAGS | re.MULTILINE)
_UMTS_LEVEL = (r"RX level C0", r"RxM RSSI C0", r"RX level \(dBm\)", r"RX level")
_LABELS: Mapping[
    Rat, Mapping[str, tuple[str, ...]]
] = {  # the main antenna of the main carrier first
    "LTE": {
        "nrarfcn": (r"LTE Rx chan",),
        "rssi": (r"PCC RxM RSSI", r"RSSI \(dBm\)"),
        "rsrp": (r"PCC RxM RSRP", r"RSRP \(dBm\)"),
        "rsrq": (r"RSRQ \(dB\)",),
        "snr": (r"SINR \(dB\)",),
    },
    "NR": {
        "nrarfcn": (r"NR5G Rx chan",),
        "rsrp": (r"NR5G RSRP \(dBm\)",),
        "rsrq": (r"NR5G RSRQ \(dB\)",),
        "snr": (r"NR5G SINR \(dB\)",),
    },
    "WCDMA": {"nrarfcn": (r"WCDMA channel",), "rssi": _UMTS_LEVEL},
    "GSM": {"nrarfcn": (r"GSM channel",), "rssi": _UMTS_LEVEL},
}
_BANDS: Mapping[Rat, str] = {
    "LTE": r"LTE band\s*:\s*(B\d{1,3})(?!\w)",
    "NR": r"NR5G band\s*:\s*(n\d{1,3})(?!\w)",
}
_OTHER_BAND = r"%s band\s*:\s*((?!unknown|x+\b)(?:WCDMA )?\w+)(?!\w)"  # x: redacted
_WORDS = (
    "System mode Current Time Reset Counter Temperature PS state GMM MM CS EMM RRC IMS reg"
    " L1 LTE WCDMA UMTS GSM NR5G ENDC CDMA band bw Rx Tx chan channel level RX RxM RxD PCC SCC C0"
    " C1 RSSI RSRP RSRQ SINR RSCP ECN0 ECIO dB dBm Power TAC LAC CID Cell ID Serving IntraFreq"
    " InterFreq EARFCN UARFCN ARFCN MCC MNC Bd D U SNR PCI PSC BSIC RXLV ThresholdLow ThresholdHi"
    " ThreshL ThreshH Priority Prio ONLINE OFFLINE Attached Not Detached Registered Registering"
    " Searching Normal Service Connected Disconnected Idle NO SRV No ASSIGNED INACTIVE ACTIVE"
    " IMT2000 GSM850 GSM900 DCS1800 PCS1900 EGSM900 WCDMA800 WCDMA850 WCDMA900 WCDMA1900 WCDMA2100"
    " unknown MHz SSC1 SSC2 SSC3 SSC4 SCC1 SCC2 SCC3 SCC4 NCC MODE Limited"
)
"""Words of !GSTATUS and !LTEINFO."""
_BITS: Mapping[Rat, tuple[int, int]] = {
    "GSM": (16, 16),
    "WCDMA": (16, 28),
    "LTE": (16, 28),
    "NR": (24, 36),
}
_DIGITS_OF_NR = 9
_MODE = re.compile(r"System mode\s*:\s*([A-Za-z0-9]+(?: (?!PS\b)[A-Za-z]+)*)", _FLAGS)

_TABLE = re.compile(
    r"(?:\A|[\s\]])(Serving|IntraFreq|InterFreq|WCDMA|GSM|CDMA[ \w]*):\s+(.*\S)\s*\Z", _FLAGS
)
_NUMBER = r"-?\d{1,5}(?:\.\d{1,2})?"
_OTHER_COLUMN = Value("", str, _NUMBER)
_COLUMNS: Kinds = {
    "mcc": VALUES["mcc"],
    "mnc": VALUES["mnc"],
    "tac": VALUES["tac_10"]._replace(pattern=r"\d{1,5}"),
    "cid": Value("cid", partial(cell_identity, bits=28, form=EIGHT), r"[0-9A-F]{8}"),
    "rxlv": number("more.srxlev", -255, 255),
    **{
        column: VALUES[name]._replace(pattern=_NUMBER)
        for column, name in (
            *((channel, "earfcn") for channel in ("earfcn", "uarfcn", "arfcn")),
            ("bd", "band"),
            *(
                (name, name)
                for name in ("psc", "pci", "rssi", "rscp", "ecn0", "rsrp", "rsrq", "snr")
            ),
        )
    },
}
_NO_CHANNEL = 0xFFFF
_TABLE_RATS: Mapping[str, Rat] = {
    "SERVING": "LTE",
    "INTRAFREQ": "LTE",
    "INTERFREQ": "LTE",
    "WCDMA": "WCDMA",
    "GSM": "GSM",
}


class Sierra(Family):
    """The serving cell of all technologies, neighbours on LTE."""

    name = "sierra"
    gives = MappingProxyType(
        {
            "LTE": cells_with("neighbours"),
            "WCDMA": cells_with(without=("identity", "country code", "colour code")),
        }
    )
    claim = Claim(
        maker=r"\A(?!.*\b(?:HL|SL|Q2)\d)(?:.*\bSIERRA WIRELESS\b|.*\bAIRPRIME\b)",
        series=r"\bAIRCARD\b|\bAC(?:3[0-4]\dU|7\d\dS|81\dS)\b",  # NETGEAR sells these
    )
    setup_commands = (Command("AT+COPS=3,2"),)  # the form of the answer; it chooses none
    poll_commands = (
        Command("AT+COPS?"),
        Command("AT!GSTATUS?"),
        Command("AT!LTEINFO?"),
    )
    survey_commands = (Command("AT+COPS=?", timeout_s=180.0),)
    mode_commands = network_mode.SELRAT
    unnamed_rows: ClassVar[Mapping[str, str]] = dict.fromkeys(("!GSTATUS", "!LTEINFO"), _WORDS)

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now, the serving one once and with its network."""
        rows = yield from self.ask(self.poll_commands)
        return None if rows is None else complete_serving_cells(rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Serving cells of !GSTATUS, all cells of !LTEINFO."""
        text = "\n".join(line.replace("\\t", "\t") for line in pieces(lines)) + "\n"
        found: list[Row] = []
        for section in _SECTION.findall(text):
            found += (*_status(section), *_tables(section.splitlines()))
        return tuple(found)


def complete_serving_cells(rows: Sequence[Row]) -> tuple[Row, ...]:
    """Rows of one poll without a second serving cell of a technology beside a complete one.

    The network, which !GSTATUS does not print, is that of +COPS.
    """
    status = {row.cid: row.tac for row in rows if is_serving(row) and not row.cell}
    complete = {row.rat for row in rows if is_serving(row) and row.cell}
    chosen = next(chosen_networks(rows), Operator(plmn=""))
    plmn = chosen.plmn or ""
    mcc, mnc = network_of(plmn)
    completed: list[Row] = []
    for row in rows:
        if not is_serving(row):
            completed.append(row)
        elif row.cell:
            # the tables print the area once, in decimal
            is_unsure = status.get(row.cid) not in {None, row.tac}
            completed.append(replace(row, identity_unsure=row.identity_unsure or is_unsure))
        elif row.rat not in complete:
            is_of_lte = row.rat == "LTE" and chosen.act in _OF_LTE
            has_network = plmn and row.cid is not None and (chosen.rat == row.rat or is_of_lte)
            completed.append(replace(row, mcc=mcc, mnc=mnc) if has_network else row)
    return tuple(completed)


def _status(text: str) -> Iterator[Row]:
    mode = _MODE.search(text)
    if mode is None:
        return
    text = _NOT_MAIN.sub("", text)
    rat = _RATS.get(mode[1].upper().removesuffix(" SA"))
    if rat is None:
        yield NoCell(status=mode[1])
        return
    is_lte_or_later = rat in {"LTE", "NR"}
    area_bits, cell_bits = _BITS[rat]
    area_text, areas_agree = _in_brackets(text, "TAC" if is_lte_or_later else "LAC")
    cell_text, cells_agree = _in_brackets(text, "Cell ID")
    area_code = area(area_text, 10, area_bits) if cell_text else None
    cid = cell_identity(cell_text, cell_bits, 10) if area_text else None
    values = _values(text, rat)
    values["tac" if is_lte_or_later else "lac"] = confirm(area_code)
    reading = CellReading(
        role="serving",
        rat=rat,
        cid=confirm(cid),  # printed in two bases
        band=_band(text, rat),
        identity_unsure=not (areas_agree and cells_agree),
        **values,
    )
    nothing = reading.level_dbm is None and reading.cid is None and reading.arfcn is None
    yield NoCell(rat, status=mode[1]) if nothing else reading
    if mode[1].upper() == _WITH_NR:
        carrier = CellReading("serving", "NR", band=_band(text, "NR"), **_values(text, "NR"))
        if carrier.level_dbm is not None:
            yield carrier


def _values(text: str, rat: Rat) -> dict[str, Any]:
    values = read_values({name: _value(text, labels) for name, labels in _LABELS[rat].items()})
    return values | ({"arfcn": None} if values["arfcn"] == _NO_CHANNEL else {})


def _value(text: str, labels: Sequence[str]) -> str:
    """A label within a longer one does not count."""
    for label in labels:
        found = re.search(rf"(?<![A-Z])(?<![A-Z] ){label}[ \t]*:[ \t]*([-+.\w]*)", text, _FLAGS)
        if found:
            return found[1]
    return ""


def _in_brackets(text: str, label: str) -> tuple[str, bool]:
    """The decimal number in brackets after a hexadecimal one, and whether the two are equal."""
    found = re.search(
        rf"(?<![A-Z]){label}\s*:\s*([0-9A-F]{{1,9}})\s*\((\d{{1,11}}|x{{10,11}})\)", text, _FLAGS
    )
    if found is None:
        return "", True
    if not found[2].isdecimal():  # redacted: a cell of NR is as long as a telephone number
        return str(int(found[1], 16)), len(found[1]) == _DIGITS_OF_NR
    return found[2], int(found[1], 16) == int(found[2])


def _band(text: str, rat: Rat) -> str | None:
    found = re.search(_BANDS.get(rat, _OTHER_BAND % rat), text, _FLAGS)
    return found[1] if found else None


def _tables(lines: Sequence[str]) -> Iterator[Row]:
    kind, names = "", [""]
    serving = CellReading("serving")
    for line in lines:
        table = _TABLE.search(line)
        if table:
            kind, names = table[1].upper(), re.sub(r"[^\w\s]", "x", table[2].lower()).split()
            continue
        reading = _table_cell(kind, names, line.split())
        if reading is None:
            continue
        if kind == "SERVING":
            serving = reading
        elif not (reading.pci or reading.psc) and reading.level_dbm is None:
            continue  # a channel without a cell, whose values are all 0
        elif kind == "INTRAFREQ":
            if serving.pci in {None, reading.pci}:
                continue  # the serving cell again, or perhaps
            reading = replace(reading, arfcn=serving.arfcn)
        yield reading


def _table_cell(kind: str, names: Sequence[str], words: Sequence[str]) -> CellReading | None:
    """A log may write before the row, but no number."""
    rat = _TABLE_RATS.get(kind)
    before, texts = words[: -len(names)], words[-len(names) :]
    if rat is None or len(names) < 5 or (before and re.fullmatch(_NUMBER, before[-1])):
        return None
    kinds = {**dict.fromkeys(names, _OTHER_COLUMN), **_COLUMNS}
    if "mcc" not in names:  # a damaged heading: no cell is named without its network
        kinds |= {name: _COLUMNS[name]._replace(attribute="") for name in ("tac", "cid")}
    columns = form(rat, " ".join(names), kinds, unknown="-+")
    return columns.cell("serving" if kind == "SERVING" else "neighbour", texts)
