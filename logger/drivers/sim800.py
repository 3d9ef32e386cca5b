"""SIMCom SIM800, SIM808 and SIM900: cells from AT+CENG and AT+CNETSCAN (firmware_notes/sim800.md).

    AT+CENG?
    +CENG: 1,1                                              header: mode, Ncell
    +CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"    serving cell
    +CENG: 1,"0128,15,30,a53f,310,411,178d"                 neighbour
    OK

Area and cell id are hexadecimal. A row is read only in a documented layout. Its identity is read
completely or not at all; a row that is damaged further right keeps the level of its channel.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from logger.core.types import CellReading, Role
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.fields import HEX, area, cell_identity, matches
from logger.drivers.reading.number_text import NumberForm, NumberText
from logger.drivers.reading.rows import Row

DBM_OF_RXL_0 = -113.0  # SIM800 manual V1.09 p163, and printed by mode 4: 44 beside -69

_HEADER = re.compile(r"\+CENG:\s*([0-4])\s*,\s*([01])\s*\Z")
# SIM900 prints no blank before the cell number. The manual shows rows without quotation marks, the
# modem prints them.
_ROW = re.compile(
    r'\+CENG:(\s*)(\d{1,2}),\s*(?:"|(?=(?:[^",]*,){5}))([-\w, ]*)(?:(")(?![-\w,"])|\Z)', re.ASCII
)
_SCAN = re.compile(
    r'Operator:\s*"(?P<operator>[^"]*)",\s*MCC:\s*(?P<mcc>\w*),\s*MNC:\s*(?P<mnc>\w*),'
    r"\s*Rxlev:\s*(?P<rxl>\d+),"
    r"\s*Cellid:\s*(?P<cellid>\w*),\s*Arfcn:\s*(?P<bcch>\d+)"
    r"(?:,\s*Lac:\s*(?P<lac>\w*),\s*Bsic:\s*(?P<bsic>\w*))?\s*\Z",
    re.ASCII | re.IGNORECASE,
)
_LOCATION = ("mcc", "mnc", "lac", "cellid", "bsic", "rxl")  # mode 3, all rows
_SERVING = ("bcch", "rxl", "rxq", "mcc", "mnc", "bsic", "cellid", "rla", "txp", "lac", "ta")
_EXTENDED = ("dbm", "c1", "c2", "tch", "ts", "maio", "hsn", "rxq_sub", "rxq_full", "ch_mod")
_NEIGHBOUR = ("bcch", "rxl", "bsic", "mcc", "mnc", "lac")
_NEIGHBOUR_CELLID = ("bcch", "rxl", "bsic", "cellid", "mcc", "mnc", "lac")
_LAYOUTS: Mapping[
    tuple[bool, int], tuple[str, ...]
] = {  # (serving, number of values), modes 1, 2 and 4
    (True, 11): _SERVING,
    (True, 21): _SERVING + _EXTENDED,
    (False, 6): _NEIGHBOUR,
    (False, 7): _NEIGHBOUR_CELLID,
    (False, 8): (*_NEIGHBOUR, "c1", "c2"),
    (False, 9): (*_NEIGHBOUR_CELLID, "c1", "c2"),
}
_FULL_WIDTH = {  # of a last value, with which a row without its closing mark may end
    "lac": r"[0-9A-Fa-f]{4}",
    "rxl": r"\d\d",
    "ta": r"(?!25)\d\d|255",
}
_SPARE = frozenset({"ta", "c2", "ch_mod"})  # a row is worth reading without these

_RANGE = {  # the marks for unknown (99, 255, x) are outside
    "bcch": range(2048),
    "rxl": range(67),  # to -47 dBm
    "rxq": range(8),
    "bsic": range(64),
    "ta": range(64),
    "c1": range(-255, 256),
    "c2": range(-255, 256),
}

_FILLER = re.compile(r"0*|[fF]*")
_FORMS = {  # of a row that is not damaged
    "mcc": r"(?!000)\d{3}",  # 001 is a real test network
    "mnc": r"\d{2,3}",
    "lac": HEX,
    "cellid": HEX,
    # No part of an identity, but a lost comma shows here, and the order of the SIM900 manual V1.01
    # in rla and txp.
    "rxl": r"\d{1,2}",
    "bsic": r"\d{0,3}",
    "rla": r"\d{1,2}|255",
    "txp": r"\d{1,2}|255",
}
_FULL_LEVEL = {"bcch": r"\d{4}", "rxl": r"\d\d"}  # no comma before them is lost
_TWO_DIGITS = NumberForm(10, frozenset({2}))
_WIDTHS = {"bcch": NumberForm(10, frozenset({4})), "rxl": _TWO_DIGITS, "bsic": _TWO_DIGITS}
"""Values that some firmware pads."""


class Sim800(Family):
    """Cells by `AT+CENG?`, all networks by `AT+CNETSCAN`."""

    name = "sim800"
    claim = Claim(series=r"SIM(?:COM_SIM)?[89]\d\d(?!\d)")
    setup_commands = (
        Command("AT+CNETSCAN=1"),  # with area and BSIC
        Command("AT+CENG=1,1", needed=True),
    )
    poll_commands = (Command("AT+CENG?"),)
    survey_commands = (Command("AT+CNETSCAN", timeout_s=90.0, silence_s=50.0),)
    gnss_start_commands = modem_gnss.CGNSINF_ON
    gnss_poll_commands = modem_gnss.CGNSINF
    unnamed_rows: ClassVar[Mapping[str, str]] = {
        "+CNETSCAN": "Operator MCC MNC Rxlev Cellid Arfcn Lac Bsic"
    }

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now; None without an answer or where engineering mode is off."""
        reply = yield self.poll_commands[0]
        modes = [header[1] for header in map(_HEADER.search, reply.lines) if header]
        has_rows = any(map(self.role_of, reply.lines))
        answered = has_rows or bool(modes) if reply.ok else has_rows and reply.final is None
        return None if not answered or "0" in modes else self.read(reply.marked_lines)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in CENG rows of modes 1 to 4 and in CNETSCAN lines; fixes of the SIM808."""
        readings: list[Row] = []
        mode = None
        for line in lines:
            header = _HEADER.search(line)
            mode = int(header[1]) if header else mode
            readings += [r for row in _ROW.finditer(line.rstrip()) if (r := _parse_row(row, mode))]
            readings += [r for scan in _SCAN.finditer(line) if (r := _parse_scan(scan))]
        return (*readings, *modem_gnss.read_cgnsinf(lines))

    def role_of(self, line: str) -> Role | None:
        """As for all; here a row counts that is cut or damaged too."""
        row = _ROW.search(line.rstrip())
        if row is None:
            return "scan" if _SCAN.search(line) else None
        return "neighbour" if int(row[2]) else "serving"


def _parse_row(row: re.Match[str], mode: int | None) -> CellReading | None:
    """Reading of one CENG row; None for an empty slot and for a row damaged on its left."""
    blank, number, body, end = row.groups()
    role: Role = "serving" if int(number) == 0 else "neighbour"
    texts = [text.strip() for text in body.split(",")]
    layout = _layout(role == "serving", texts, mode)
    closed = end is not None
    if not closed and not (layout and _ends_complete(layout[-1], texts)):
        return None
    values = dict(zip(layout or ("bcch", "rxl"), texts, strict=False))
    identity = _identity(values) if layout else None
    if identity is None and not (closed and matches(_FULL_LEVEL, values)):
        return None
    return _reading(role, values, identity or {}, dbm_of_rxl_0=DBM_OF_RXL_0 if blank else None)


def _layout(serving: bool, texts: Sequence[str], mode: int | None) -> tuple[str, ...] | None:
    """Names of the values; six are mode 3, or a neighbour, whose channel has four digits."""
    if len(texts) == len(_LOCATION) and (
        serving or mode == 3 or (mode is None and len(texts[0]) != 4)
    ):
        return _LOCATION
    return _LAYOUTS.get((serving, len(texts)))


def _ends_complete(last: str, texts: list[str]) -> bool:
    """False where the row's last value may be cut; one that the row can spare is emptied."""
    if last in _FULL_WIDTH and re.fullmatch(_FULL_WIDTH[last], texts[-1]):
        return True
    if last in _SPARE:
        texts[-1] = ""
    return last in _SPARE


def _identity(values: Mapping[str, str]) -> dict[str, Any] | None:
    """Network, area and cell, empty where not decoded; None where the row is damaged."""
    if all(_FILLER.fullmatch(values.get(name) or "") for name in ("mcc", "mnc", "lac", "cellid")):
        return {}
    if not matches({name: form for name, form in _FORMS.items() if name in values}, values):
        return None
    return {
        "mcc": values["mcc"],
        "mnc": values["mnc"],
        "lac": area(values.get("lac") or "0"),
        "cid": cell_identity(values.get("cellid") or "0", 16),
    }


def _parse_scan(scan: re.Match[str]) -> CellReading | None:
    values = {name: text for name, text in scan.groupdict().items() if text is not None}
    if "bsic" in values:  # hexadecimal here, decimal in CENG; a single digit may be a cut line
        values["bsic"] = (
            str(int(values["bsic"], 16)) if re.fullmatch(r"[0-9A-Fa-f]{2}", values["bsic"]) else ""
        )
    identity = _identity(values)
    # The manual gives no dBm for Rxlev of CNETSCAN.
    return None if identity is None else _reading("scan", values, identity, dbm_of_rxl_0=None)


def _reading(
    role: Role,
    values: Mapping[str, str],
    identity: Mapping[str, Any],
    *,
    dbm_of_rxl_0: float | None,
) -> CellReading | None:
    channel, level, bsic = (_number(values, name) for name in ("bcch", "rxl", "bsic"))
    has_channel = channel is not None or "bcch" not in values
    if not matches({"rxl": _FORMS["rxl"]}, values) or not has_channel:
        return None
    if not identity and not channel and not level and values.get("rxl") != "99":
        return None  # an empty slot
    if role != "scan":
        channel, level, bsic = (
            None if number is None else NumberText(number, values[name], _WIDTHS[name])
            for name, number in (("bcch", channel), ("rxl", level), ("bsic", bsic))
        )
    plain: dict[str, Any] = {name: _number(values, name) for name in ("rxq", "ta", "c1", "c2")}
    return CellReading(
        role=role,
        rat="GSM",
        **identity,
        arfcn=None if channel is None else _arfcn(channel),
        arfcn_raw=channel,
        bsic=bsic if identity or bsic else None,  # 00 fills the field of a cell that is not decoded
        rxlev_raw=level,
        rssi_dbm=None if level is None or dbm_of_rxl_0 is None else dbm_of_rxl_0 + level,
        more={"operator": values["operator"]} if values.get("operator") else {},
        **plain,
    )


def _arfcn(printed: int) -> int | None:
    """Channel without the 1024 that a SIM800 adds in the 1900 MHz band (3GPP TS 45.005 2)."""
    if printed < 1024:
        return printed
    return printed - 1024 if 512 <= printed - 1024 <= 810 else None


def _number(values: Mapping[str, str], name: str) -> int | None:
    """Decimal value of a field, if it is one that the field can have."""
    text = values.get(name, "")
    if not re.fullmatch(r"-?\d{1,4}", text):
        return None
    return int(text) if int(text) in _RANGE[name] else None
