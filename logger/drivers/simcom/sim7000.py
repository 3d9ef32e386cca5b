"""SIMCom SIM7000, SIM7070, SIM7080, SIM7090: cells from AT+CENG and AT+CPSI.

    +CENG: 1,1,2,LTE CAT-M1                                    header: mode, Ncell, cells, system
    +CENG: 0,"1550,339,-73,-47,-12,17,102,303617,284,05,255"   serving cell, decimal
    +CENG: 1,"1550,414,-88,-51,-20,17"                         neighbour

    +CENG: 1,1,6,GSM
    +CENG: 0,"0665,35,02,4b2c,404,95,c1c0"                     any cell, hexadecimal

A SIM800 prints other rows under a header of two values: under such a header nothing is read
(firmware_notes/simcom.md).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from logger.core.types import CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.cell_values import read_values
from logger.drivers.reading.fields import HEX, area, cell_identity, decimal, matches, network
from logger.drivers.reading.number_text import NumberForm, NumberText
from logger.drivers.reading.rows import NoCell, Row
from logger.drivers.reading.serving_cell import merge_serving_cells
from logger.drivers.simcom import cpsi

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

_LTE = ("earfcn", "pci", "rsrp", "rssi", "rsrq", "sinr", "tac", "cellid", "mcc", "mnc", "txpwr")
_LTE_LEVELS = _LTE[:6]
_GSM = ("bcch", "rxl", "bsic", "cellid", "mcc", "mnc", "lac")

_LTE_FORM = {  # instead of the RSRP a SIM800 prints its rxq, which is never negative
    "earfcn": r"\d{1,6}",
    "pci": r"\d{1,3}",
    "rsrp": r"-\d{1,3}",
}
_LTE_IDENTITY = {"tac": r"\d{1,5}", "cellid": r"\d{1,9}"}
_GSM_IDENTITY = {
    "bcch": r"\d{1,4}",
    "rxl": r"\d{1,2}",
    "bsic": r"\d{0,3}",
    "cellid": HEX,
    "lac": HEX,
}
_FULL_LAC = {"lac": r"[0-9A-Fa-f]{4}"}
_FULL_LEVEL = {"bcch": r"\d{4}", "rxl": r"\d\d"}
_CHANNEL, _LEVEL = NumberForm(10, frozenset({4})), NumberForm(10, frozenset({2}))


class Sim7000(Family):
    """Cells by `AT+CENG?`; `AT+CPSI?` adds band, C1, C2 and the level of a GSM cell in dBm."""

    name = "sim7000"
    claim = Claim(series=r"SIM70(?:00|70|80|90)(?!\d)")
    setup_commands = (ENGINEERING_ON,)
    poll_commands = (Command("AT+CENG?"), Command("AT+CPSI?"))
    survey_commands = (Command("AT+COPS=?", timeout_s=180.0),)
    gnss_start_commands = modem_gnss.CGNSINF_ON
    gnss_poll_commands = modem_gnss.CGNSINF
    mode_commands = network_mode.CNMP

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now, the serving one once; switches a lost engineering mode on again."""
        lines: list[str] = []
        answered = False
        for command in self.poll_commands:
            reply = yield command
            answered |= reply.ok
            lines += [*reply.marked_lines, *filter(None, [reply.final])]
        if any(map(_OFF.search, lines)):
            yield ENGINEERING_ON
        rows = merge_serving_cells(self.read(lines))
        return rows if answered or any(isinstance(row, CellReading) for row in rows) else None

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in CENG rows and CPSI lines; fixes of the modem's receiver."""
        return (*_engineering(lines), *cpsi.serving_cells(lines), *modem_gnss.read_cgnsinf(lines))


def _engineering(lines: Sequence[str]) -> Iterator[Row]:
    system: str | None = None  # no header yet
    for line in lines:
        for text in _PREFIX.split(line.replace('\\"', '"'))[1:]:
            header = _HEADER.match(text)
            if header:
                system = (header[3] or "").strip().upper()
                if system == _NO_SERVICE:
                    yield NoCell(status=system)
            elif system != "" and (row := _ROW.match(text)):
                reading = _reading(row, system)
                if reading is not None:
                    yield reading


def _reading(row: re.Match[str], system: str | None) -> CellReading | None:
    number, marked, end, plain = row.groups()
    values = [value.strip() for value in (marked if marked is not None else plain).split(",")]
    role: Role = "neighbour" if int(number) else "serving"
    rat = next((rat for mark, rat in _RATS.items() if mark in (system or "")), None)
    named = dict(zip(_LTE, values, strict=False))
    if rat != "GSM" and matches(_LTE_FORM, named):
        return _lte(role, rat, values, closed=end is not None)
    if rat == "GSM" or (system is None and len(values) == len(_GSM)):
        return _gsm(role, values, closed=end is not None)
    return None


def _lte(role: Role, rat: Rat | None, texts: list[str], *, closed: bool) -> CellReading | None:
    """Reading of a row of LTE; one of another number of values keeps its levels, the first six."""
    if len(texts) < len(_LTE_LEVELS):
        return None
    if not closed:
        texts = [*texts[:-1], ""]  # the last one may be cut
    named = dict(zip(_LTE, texts, strict=False))
    values = read_values({name: named[name] for name in _LTE_LEVELS})
    ids = _lte_identity(named) if len(texts) == len(_LTE) else {}
    if not ids and values["rsrp_dbm"] is None:
        return None
    return CellReading(role=role, rat=rat, **ids, **values)


def _lte_identity(named: Mapping[str, str]) -> dict[str, Any]:
    mcc, mnc = network(named["mcc"], named["mnc"])
    if mcc is None or not matches(_LTE_IDENTITY, named):
        return {}
    return {
        "mcc": mcc,
        "mnc": mnc,
        "tac": area(named["tac"], 10),
        "cid": cell_identity(named["cellid"], 28, 10),
    }


def _gsm(role: Role, texts: list[str], *, closed: bool) -> CellReading | None:
    """Reading of a row of GSM; one of another number of values keeps a level of full width."""
    named = dict(zip(_GSM, texts, strict=False))
    complete = len(texts) == len(_GSM) and (closed or matches(_FULL_LAC, named))
    ids = _gsm_identity(named) if complete else {}
    if not ids and not (closed and matches(_FULL_LEVEL, named)):
        return None
    channel, rxl = decimal(named["bcch"], 0, 2047), decimal(named["rxl"], 0, 66)
    bsic = decimal(named.get("bsic", ""), 0, 63)
    if channel is None or (not ids and not rxl):
        return None  # an empty slot
    return CellReading(
        role=role,
        rat="GSM",
        **ids,
        arfcn=channel if channel < 1024 else None,
        arfcn_raw=NumberText(channel, named["bcch"], _CHANNEL),
        bsic=bsic if ids or bsic else None,  # 00 fills the field of a cell that is not decoded
        rxlev_raw=None if rxl is None else NumberText(rxl, named["rxl"], _LEVEL),
    )


def _gsm_identity(named: Mapping[str, str]) -> dict[str, Any]:
    mcc, mnc = network(named["mcc"], named["mnc"])
    if mcc is None or not matches(_GSM_IDENTITY, named):
        return {}
    return {
        "mcc": mcc,
        "mnc": mnc,
        "lac": area(named["lac"]),
        "cid": cell_identity(named["cellid"], 16),
    }
