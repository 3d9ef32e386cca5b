"""SIMCom SIM7000, SIM702x, SIM7070, SIM7080, SIM7090: cells from AT+CENG and AT+CPSI.

    AT+CENG?
    +CENG: 1,1,2,LTE CAT-M1                                    header: mode, Ncell, cells, system
    +CENG: 0,"1550,339,-73,-47,-12,17,102,303617,284,05,255"   serving cell, decimal
    +CENG: 1,"1550,414,-88,-51,-20,17"                         neighbour
    OK

    +CENG: 1,1,6,GSM
    +CENG: 0,"0665,35,02,4b2c,404,95,c1c0"                     any cell, hexadecimal

    +CENG: 3740,1,137,"02D3C4B5",-101,-11,-92,6,20,"4E5F",0,9  SIM7020, serving cell
    +CENG: 3740,1,138,-108

Needs: engineering mode, AT+CENG=1,1; a poll switches it on again where it is off.
Known by: the series SIM7000, SIM702x, SIM7070, SIM7080 and SIM7090.
Doubts: the level of a GSM row is an index; AT+CPSI? has it in dBm. A SIM800 prints other rows under
a header of two values: under such a header nothing is read.
Sources: measured replies in public code; those of a SIM7020 not verified
(firmware_notes/simcom.md).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from logger.core.types import CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.generic import name_nbiot
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.row_language import (
    HEX,
    VALUES,
    Kinds,
    NoCell,
    Row,
    cell,
    form,
    matches,
    network,
    number,
    padded_number,
)
from logger.drivers.reading.standard_replies import is_serving, merge_serving_cells
from logger.drivers.sim7600 import cpsi_cells

ENGINEERING_ON = Command("AT+CENG=1,1")

_PREFIX = re.compile(r"(?:\+|(?<![A-Z0-9+]))CENG:", re.IGNORECASE)
_HEADER = re.compile(
    r"\s*([0-4])\s*,\s*([01])\s*(?:,\s*\d{1,2}\s*,\s*([A-Z][-\w ]*))?\s*(?:[^-\w\s,].*)?\Z",
    re.ASCII | re.IGNORECASE,
)
_ROW = re.compile(
    r'\s*(\d{1,2})\s*,\s*(?:"([-\w,. ]*)(?:(")(?![-\w,"])|\Z)|([-\w,. ]*)(?=[^-\w,. "]|\Z))',
    re.ASCII,
)
_OFF = re.compile(r"CENG:\s*0\s*,\s*[01]\s*(?:,|\Z)")
_RATS: Mapping[str, Rat] = {  # by a part of the name of a system
    "GSM": "GSM",
    "CAT-M": "LTE-M",
    "NB": "NB-IoT",
}
_NO_SERVICE = "NO SERVICE"

_KINDS: Kinds = {
    **VALUES,
    **{name: VALUES[name]._replace(pattern=".*") for name in ("rssi", "rsrq", "sinr")},
    "rsrp": VALUES["rsrp"]._replace(pattern=r"-\d{1,3}"),
    "bcch": padded_number("arfcn_raw", 2047, 4),
    "rxl": padded_number("rxlev_raw", 66, 2),
    "bsic": number("bsic", 0, 63)._replace(pattern=r"\d{0,3}"),
    "cid16": VALUES["cid16"]._replace(pattern=HEX),
    "lac": VALUES["lac"]._replace(pattern=HEX),
    "tac_10": VALUES["tac_10"]._replace(pattern=r"\d{1,5}"),
    "cid28_10": VALUES["cid28_10"]._replace(pattern=r"\d{1,9}"),
}
# instead of the RSRP a SIM800 prints its rxq, which is never negative
_LTE = form(None, "earfcn pci rsrp rssi rsrq sinr", _KINDS, unknown="(?!)")
_LTE_IDENTITY, _LTE_VALUES = ("tac_10", "cid28_10", "mcc", "mnc"), 11
_GSM = form("GSM", "bcch rxl bsic cid16 mcc mnc lac", _KINDS, unknown="(?!)")
# the number of the row, which its manual has in one place only, may stand in front
_SIM7020 = re.compile(
    r'\s*(?:0,)?(?P<earfcn>\d{2,6}),\d{0,2},(?P<pci>\d{1,3}),"(?P<cid28>[0-9A-F]{1,8})",'
    r"(?P<rsrp>-\d{2,3})?,(?P<rsrq>-?\d{1,2})?,(?P<rssi>-\d{2,3})?,(?:-?\d{1,3})?,"
    r'(?P<band>\d{1,2}),"(?P<tac>[0-9A-F]{1,4})"',
    re.ASCII | re.IGNORECASE,
)
_SIM7020_NEIGHBOUR = re.compile(
    r"\s*(?:1,)?(?P<earfcn>\d{2,6}),\d{0,2},(?P<pci>\d{1,3}),(?P<rsrp>-\d{2,3})\s*\Z", re.ASCII
)
_FULL_LAC = re.compile("[0-9A-Fa-f]{4}")
_FULL_LEVEL = {"bcch": r"\d{4}", "rxl": r"\d\d"}


class Sim7000(Family):
    """Cells by `AT+CENG?`; `AT+CPSI?` adds band, C1, C2 and a GSM level in dBm."""

    name = "sim7000"
    gives = MappingProxyType(
        {
            "GSM": cells_with("neighbours", "C1 and C2"),
            "WCDMA": cells_with(),
            "LTE": cells_with(),
            "LTE-M": cells_with("neighbours"),
            "NB-IoT": cells_with("neighbours"),
        }
    )
    claim = Claim(series=r"SIM70(?:00|2\d|70|80|90)(?!\d)")
    setup_commands = (ENGINEERING_ON,)
    poll_commands = (Command("AT+CENG?"), Command("AT+CPSI?"))
    survey_commands = (Command("AT+COPS=?", timeout_s=180.0),)
    gnss_start_commands = modem_gnss.CGNSINF_ON
    gnss_poll_commands = modem_gnss.CGNSINF
    either_or = "SIM70[789]0"
    long_numbers = modem_gnss.CGNSINF_TIME
    mode_commands = network_mode.CNMP

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now; switches a lost engineering mode on again."""
        lines: list[str] = []
        answered = is_refused = False
        for command in self.poll_commands:
            reply = yield command
            answered |= reply.ok
            is_refused |= reply.is_refusal
            lines += [*reply.marked_lines, *filter(None, [reply.final])]
        if any(map(_OFF.search, lines)):
            yield ENGINEERING_ON
        rows = merge_serving_cells(self.read(lines))
        is_read = any(isinstance(row, CellReading | NoCell) for row in rows)
        if is_refused and not is_read and not any(map(_has_header, lines)):
            # a SIM7020 with other rows, or without AT+CENG
            return (yield from name_nbiot(self, ()))
        if any(map(_lacks_network, rows)):
            rows = (yield from name_nbiot(self, rows)) or rows
        return rows if answered or any(isinstance(row, CellReading) for row in rows) else None

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in CENG rows and CPSI lines; fixes of the modem's receiver."""
        return (*_engineering(lines), *cpsi_cells(lines), *modem_gnss.read_cgnsinf(lines))


def _has_header(line: str) -> bool:
    return any(map(_HEADER.match, _PREFIX.split(line)[1:]))


def _lacks_network(row: Row) -> bool:
    return is_serving(row) and row.rat == "NB-IoT" and (row.mcc, row.cid is None) == (None, False)


def _engineering(lines: Sequence[str]) -> Iterator[Row]:
    system: str | None = None  # no header yet
    for line in lines:
        for text in _PREFIX.split(line.replace('\\"', '"'))[1:]:
            header = _HEADER.match(text)
            if header:
                system = (header[3] or "").strip().upper()
                if system == _NO_SERVICE:
                    yield NoCell(status=system)
            elif reading := _sim7020(text):
                yield reading
            elif system != "" and (row := _ROW.match(text)):
                reading = _reading(row, system)
                if reading is not None:
                    yield reading


def _sim7020(text: str) -> CellReading | None:
    text = re.sub(r"\s*,\s*", ",", text)
    row = _SIM7020.match(text) or _SIM7020_NEIGHBOUR.match(text)
    named = row.groupdict("") if row else {}
    return cell("serving" if "tac" in named else "neighbour", "NB-IoT", named, _KINDS)


def _reading(row: re.Match[str], system: str | None) -> CellReading | None:
    number, marked, end, plain = row.groups()
    values = [value.strip() for value in (marked if marked is not None else plain).split(",")]
    role: Role = "neighbour" if int(number) else "serving"
    rat = next((rat for mark, rat in _RATS.items() if mark in (system or "")), None)
    if rat != "GSM" and (reading := _lte(role, rat, values, closed=end is not None)):
        return reading
    if rat == "GSM" or (system is None and len(values) == len(_GSM.names)):
        return _gsm(role, values, closed=end is not None)
    return None


def _lte(role: Role, rat: Rat | None, texts: list[str], *, closed: bool) -> CellReading | None:
    """A row of another number of values keeps its levels, the first six."""
    if not closed:
        texts = [*texts[:-1], ""]  # the last one may be cut
    named = _LTE.texts_by_name(texts[: len(_LTE.names)])
    if named is None:
        return None
    if len(texts) == _LTE_VALUES:
        named |= dict(zip(_LTE_IDENTITY, texts[len(_LTE.names) :], strict=False))
    reading = cell(role, rat, named, _KINDS)
    is_empty = reading is None or (reading.mcc is None and reading.rsrp_dbm is None)
    return None if is_empty else reading


def _gsm(role: Role, texts: list[str], *, closed: bool) -> CellReading | None:
    """A row of another number of values keeps a level of full width."""
    named = _GSM.texts_by_name(texts) if closed or _FULL_LAC.fullmatch(texts[-1]) else None
    is_identified = named is not None and network(named["mcc"], named["mnc"])[0] is not None
    if not is_identified or named is None:
        named = dict(zip(_GSM.names[:3], texts, strict=False))
        if not (closed and matches(_FULL_LEVEL, named)):
            return None
    reading = cell(role, "GSM", named, _KINDS)
    channel = reading.arfcn_raw if reading else None
    if reading is None or channel is None or (not is_identified and not reading.rxlev_raw):
        return None  # an empty slot
    return replace(
        reading,
        arfcn=int(channel) if channel < 1024 else None,
        bsic=reading.bsic if is_identified or reading.bsic else None,  # 00 fills the field
    )
