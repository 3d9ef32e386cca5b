"""SIMCom SIM800, SIM808 and SIM900: cells from AT+CENG and AT+CNETSCAN.

    AT+CENG?
    +CENG: 1,1                                              header: mode, Ncell
    +CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"    serving cell
    +CENG: 1,"0128,15,30,a53f,310,411,178d"                 neighbour
    OK

Needs: engineering mode, AT+CENG=1,1.
Known by: the series SIM8xx and SIM9xx.
Doubts: area and cell id are hexadecimal. A row is read only in a documented layout. Its identity is
read completely or not at all; a row that is damaged further right keeps the level of its channel.
1024 is added to channels of the 1900 MHz band. The manual gives no dBm for AT+CNETSCAN.
Sources: measured rows (github sitch-io/sensor, ceng-SIM808.txt) under the header of mode 1; SIM800
manual V1.09 p161-163 and p197-198 (firmware_notes/simcom.md).
"""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar

from logger.core.types import CellReading, Role
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.row_language import (
    HEX,
    VALUES,
    Form,
    Kinds,
    Row,
    Value,
    form,
    identity,
    matches,
    padded_number,
    read_values,
)

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
    r"\s*Cellid:\s*(?P<cid16>\w*),\s*Arfcn:\s*(?P<bcch>\d+)"
    r"(?:,\s*Lac:\s*(?P<lac>\w*),\s*Bsic:\s*(?P<bsic>\w*))?\s*\Z",
    re.ASCII | re.IGNORECASE,
)
_FULL_WIDTH = {  # of a last value, with which a row without its closing mark may end
    "lac": r"[0-9A-Fa-f]{4}",
    "rxl": r"\d\d",
    "ta": r"(?!25)\d\d|255",
}
_SPARE = frozenset({"ta", "c2", "ch_mod"})  # a row is worth reading without these
_FILLER = re.compile(r"0*|[fF]*")
_FULL_LEVEL = {"bcch": r"\d{4}", "rxl": r"\d\d"}  # no comma before them is lost
_INDEX = r"\d{1,2}"
_POWER = Value("", str, r"\d{1,2}|255")

_KINDS: Kinds = {  # the marks for unknown (99, 255, x) are outside the ranges
    "bcch": padded_number("arfcn_raw", 2047, 4, ".*"),
    "rxl": padded_number("rxlev_raw", 66, 2, _INDEX),  # to -47 dBm
    "bsic": padded_number("bsic", 63, 2, r"\d{0,3}"),
    **{name: VALUES[name]._replace(pattern=".*") for name in ("rxq", "ta", "c1", "c2")},
    "mcc": VALUES["mcc"]._replace(pattern=r"(?!000)\d{3}"),  # 001 is a real test network
    "mnc": VALUES["mnc"],
    "lac": VALUES["lac"]._replace(pattern=HEX),
    "cid16": VALUES["cid16"]._replace(pattern=HEX),
    # a lost comma shows here, and the order of the SIM900 manual V1.01
    "rla": _POWER,
    "txp": _POWER,
    "ch_mod": Value("", str, ".*"),
}


def _form(names: str) -> Form:
    return form("GSM", names, _KINDS, unknown="(?!)")


_SERVING = "bcch rxl rxq mcc mnc bsic cid16 rla txp lac ta"
_NEIGHBOUR = "bcch rxl bsic mcc mnc lac"
_NEIGHBOUR_CELLID = "bcch rxl bsic cid16 mcc mnc lac"
_LOCATION = _form("mcc mnc lac cid16 bsic rxl")  # mode 3, all rows
_SCANNED = _form("mcc mnc rxl cid16 bcch [lac bsic]")
_LAYOUTS: Mapping[tuple[bool, int], Form] = {  # (serving, number of values), modes 1, 2 and 4
    (True, 11): _form(_SERVING),
    (True, 21): _form(_SERVING + " _ c1 c2 _ _ _ _ _ _ ch_mod"),
    (False, 6): _form(_NEIGHBOUR),
    (False, 7): _form(_NEIGHBOUR_CELLID),
    (False, 8): _form(_NEIGHBOUR + " c1 c2"),
    (False, 9): _form(_NEIGHBOUR_CELLID + " c1 c2"),
}
_IDENTITY = ("mcc", "mnc", "lac", "cid16")


class Sim800(Family):
    """Cells by `AT+CENG?`, all networks by `AT+CNETSCAN`."""

    name = "sim800"
    gives = MappingProxyType(
        {
            "GSM": cells_with("neighbours", "timing advance", "C1 and C2"),
        }
    )
    claim = Claim(series=r"SIM(?:COM_SIM)?[89]\d\d(?!\d)")
    setup_commands = (
        Command("AT+CNETSCAN=1"),  # with area and BSIC
        Command("AT+CENG=1,1", needed=True),
    )
    poll_commands = (Command("AT+CENG?"),)
    survey_commands = (Command("AT+CNETSCAN", timeout_s=90.0, silence_s=50.0),)
    gnss_start_commands = modem_gnss.CGNSINF_ON
    gnss_poll_commands = modem_gnss.CGNSINF
    long_numbers = modem_gnss.CGNSINF_TIME
    unnamed_rows: ClassVar[Mapping[str, str]] = {
        "+CNETSCAN": "Operator MCC MNC Rxlev Cellid Arfcn Lac Bsic"
    }

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now; None without an answer or where engineering mode is off."""
        reply = yield self.poll_commands[0]
        modes = [header[1] for header in map(_HEADER.search, reply.lines) if header]
        has_rows = any(map(self.role_of, reply.lines))
        answered = has_rows or (reply.ok and bool(modes))
        is_off = reply.is_refusal or "0" in modes
        return self.read(reply.marked_lines) if answered and not is_off else None

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
    """None for an empty slot and for a row damaged on its left."""
    blank, number, body, end = row.groups()
    role: Role = "serving" if int(number) == 0 else "neighbour"
    texts = [text.strip() for text in body.split(",")]
    layout = _layout(role == "serving", texts, mode)
    closed = end is not None
    if not closed and not (layout and _ends_complete(layout.names[-1], texts)):
        return None
    named = dict(zip(layout.names if layout else ("bcch", "rxl"), texts, strict=False))
    ids = _identity(layout, named) if layout else None
    if ids is None and not (closed and matches(_FULL_LEVEL, named)):
        return None
    return _reading(role, named, ids or {}, dbm_of_rxl_0=DBM_OF_RXL_0 if blank else None)


def _layout(serving: bool, texts: Sequence[str], mode: int | None) -> Form | None:
    """Six values are mode 3, or a neighbour, whose channel has four digits."""
    if len(texts) == len(_LOCATION.names) and (
        serving or mode == 3 or (mode is None and len(texts[0]) != 4)
    ):
        return _LOCATION
    return _LAYOUTS.get((serving, len(texts)))


def _ends_complete(last: str, texts: list[str]) -> bool:
    """False where the last value may be cut; one that the row can spare is emptied."""
    if last in _FULL_WIDTH and re.fullmatch(_FULL_WIDTH[last], texts[-1]):
        return True
    if last in _SPARE:
        texts[-1] = ""
    return last in _SPARE


def _identity(layout: Form, named: Mapping[str, str]) -> dict[str, Any] | None:
    """Empty where not decoded; None where the row is damaged."""
    if all(_FILLER.fullmatch(named.get(name) or "") for name in _IDENTITY):
        return {}
    return identity(named, _KINDS) if layout.looks_right(named) else None


def _parse_scan(scan: re.Match[str]) -> CellReading | None:
    named = {name: text for name, text in scan.groupdict().items() if text is not None}
    operator = named.pop("operator")
    if "bsic" in named:  # hexadecimal here, decimal in CENG; a single digit may be a cut line
        is_whole = re.fullmatch(r"[0-9A-Fa-f]{2}", named["bsic"])
        named["bsic"] = str(int(named["bsic"], 16)) if is_whole else ""
    ids = _identity(_SCANNED, named)
    if ids is None:
        return None
    # The manual gives no dBm for Rxlev of CNETSCAN.
    return _reading("scan", named, ids, dbm_of_rxl_0=None, operator=operator)


def _reading(
    role: Role,
    named: Mapping[str, str],
    ids: Mapping[str, Any],
    *,
    dbm_of_rxl_0: float | None,
    operator: str = "",
) -> CellReading | None:
    values = read_values({n: text for n, text in named.items() if n not in _IDENTITY}, _KINDS)
    channel, level, bsic = (values.pop(name, None) for name in ("arfcn_raw", "rxlev_raw", "bsic"))
    has_channel = channel is not None or "bcch" not in named
    if not re.fullmatch(_INDEX, named.get("rxl", "")) or not has_channel:
        return None
    is_named = any(ids.get(name) is not None for name in ("lac", "cid"))
    if not is_named and not channel and not level and named.get("rxl") != "99":
        return None  # an empty slot
    if role == "scan":  # no firmware pads these
        channel, level, bsic = (n if n is None else int(n) for n in (channel, level, bsic))
    return CellReading(
        role=role,
        rat="GSM",
        **ids,
        arfcn=None if channel is None else _arfcn(channel),
        arfcn_raw=channel,
        bsic=bsic if ids or bsic else None,  # 00 fills the field of a cell that is not decoded
        rxlev_raw=level,
        rssi_dbm=None if level is None or dbm_of_rxl_0 is None else dbm_of_rxl_0 + level,
        more={"operator": operator} if operator else {},
        **values,
    )


def _arfcn(printed: int) -> int | None:
    """Channel without the 1024 that a SIM800 adds in the 1900 MHz band (3GPP TS 45.005 2)."""
    if printed < 1024:
        return printed
    return printed - 1024 if 512 <= printed - 1024 <= 810 else None
