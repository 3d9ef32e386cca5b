"""SIMCom SIM5xxx, SIM7100 to SIM79xx, SIM82xx/83xx, A76xx, SIM7670: AT+CPSI, +CCINFO, +CMGRMI.

    +CCINFO:[SCELL],ARFCN:34,MCC:240,MNC:24,LAC:10001,ID:31,BSIC:18,RXLev:-78dbm,C1:33,...
    +CCINFO:[NCell1],UARFCN:4436,PSC:230,SSC:0,RSCP:97,ECIO:15.5,RXLev:-97dbm

    +CMGRMI: Serving_Cell,1300,262,02,5432,2,7654321,3,5,5,12,211,-95,-912,-604,0
    +CMGRMI: LTE_InterFreq1_Cell1,417,-125,-1011,-772,0

Area and cell of +CCINFO are decimal; levels of +CMGRMI are tenths of a dB. `cpsi` reads +CPSI; the
sources are in firmware_notes/simcom.md.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from logger.core.types import CellReading, Role
from logger.drivers import network_mode
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.cell_values import read_values
from logger.drivers.reading.fields import (
    area,
    cell_identity,
    level,
    network,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
)
from logger.drivers.reading.rows import Row
from logger.drivers.reading.serving_cell import merge_serving_cells
from logger.drivers.simcom import cpsi

_CCINFO = re.compile(
    r"(?<![A-Z])CCINFO:\s*\[\s*(SCELL|NCELL\s*\d{0,2})\s*\]([^\\]*?)(?=\+?CCINFO:|\\|\Z)",
    re.ASCII | re.IGNORECASE,
)
_PAIR = re.compile(r",\s*([A-Z]\w*)\s*:\s*([-\w.]+)\s*(?=(,)|\Z)", re.ASCII | re.IGNORECASE)
_LAST = frozenset({"RXLEV", "C2"})
"""Labels that may end a row; another value at the end is cut."""
_WHO = re.compile(
    r",\s*(U)?ARFCN\s*:\s*\d{1,5}\s*,\s*MCC\s*:\s*(\d{3})\s*,\s*MNC\s*:\s*(\d{1,3})\s*,"
    r"\s*LAC\s*:\s*(\d{1,5})\s*,\s*ID\s*:\s*(\d{1,10})\s*,\s*(?(1)PSC|BSIC)\s*:",
    re.IGNORECASE | re.ASCII,
)
_CCINFO_VALUES = ("ARFCN", "UARFCN", "PSC", "TA", "C1", "C2")
_DBM = re.compile(r"(-\d{1,3})\s*dBm", re.IGNORECASE)

_CMGRMI = re.compile(r"(?<![A-Z])CMGRMI:\s*(\w+)\s*,([-\w, ]*)", re.IGNORECASE | re.ASCII)
_SERVING = (
    *("earfcn", "mcc", "mnc", "tac", "mnc_digits", "cellid", "band", "dlbw", "ulbw", "sinr"),
    *("pci", "rsrq", "rsrp", "rssi", "srxlev"),
)
_NEIGHBOUR = ("pci", "rsrq", "rsrp", "rssi", "srxlev")
_LTE_VALUES = ("earfcn", "band", "pci", "sinr")
_INTRA_CELL = re.compile(r"LTE_INTRA_CELL\d{1,2}")
_INTER_CELL = re.compile(r"LTE_INTERFREQ(\d{1,2})_CELL\d{1,2}")
_FREQUENCY = re.compile(r"Freq(\d{1,2})\s*,\s*(\d{1,6})\s*,", re.IGNORECASE | re.ASCII)


class Sim7600(Family):
    """The serving cell by AT+CPSI, neighbours by AT+CCINFO (GSM, WCDMA) and AT+CMGRMI (LTE)."""

    name = "sim7600"
    claim = Claim(series=r"SIM(?:5\d|7[1-9]|8[23])\d\d(?!\d)|(?<![0-9A-Z])A7[69]\d\d(?!\d)")
    poll_commands = (
        Command("AT+CPSI?"),
        Command("AT+CCINFO"),
        Command("AT+CMGRMI=4"),
        Command("AT+CESQ"),  # the level of LTE in dBm where CPSI prints an index
    )
    survey_commands = (Command("AT+COPS=?", timeout_s=180.0),)
    gnss_start_commands = modem_gnss.CGPSINFO_ON
    gnss_poll_commands = modem_gnss.CGPSINFO
    mode_commands = network_mode.CNMP

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now, the serving one once; a modem refuses the commands it lacks."""
        rows = yield from self.ask(self.poll_commands)
        return None if rows is None else merge_serving_cells(rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in lines of CPSI, CCINFO and CMGRMI; fixes of the modem's receiver."""
        return (
            *cpsi.serving_cells(lines),
            *_system(lines),
            *_environment(lines),
            *modem_gnss.read_cgpsinfo(lines),
        )


def _system(lines: Sequence[str]) -> Iterator[Row]:
    for line in lines:
        for cell, text in _CCINFO.findall(line):
            reading = _system_cell("serving" if cell.upper() == "SCELL" else "neighbour", text)
            if reading is not None:
                yield reading


def _system_cell(role: Role, text: str) -> CellReading | None:
    """Reading of one CCINFO row; the unit behind RXLev shows that the level is complete."""
    pairs = ((label.upper(), value, comma) for label, value, comma in _PAIR.findall(text))
    named = {label: value for label, value, comma in pairs if comma or label in _LAST}
    if ("ARFCN" in named) == ("UARFCN" in named):
        return None
    on_gsm = "ARFCN" in named
    received = _DBM.match(named.get("RXLEV", ""))
    levels: dict[str, Any] = {
        "rssi_dbm": rssi_dbm(received[1]) if received else None,
        **({} if on_gsm else _code_levels(named)),
    }
    row = _WHO.match(text)
    ids = _system_identity(row, cid_bits=16 if on_gsm else 28) if row else {}
    if not ids and not any(value is not None for value in levels.values()):
        return None
    texts = {name.lower(): named[name] for name in _CCINFO_VALUES if name in named}
    return CellReading(
        role=role,
        rat="GSM" if on_gsm else "WCDMA",
        **ids,
        **levels,
        **read_values(texts),
        more={"bsic_raw": named["BSIC"]} if "BSIC" in named else {},  # its base is undocumented
    )


def _code_levels(named: Mapping[str, str]) -> dict[str, float | None]:
    """RSCP and EC/IO, printed without their sign."""
    rscp, ecio = (named.get(name, "").removeprefix("-") for name in ("RSCP", "ECIO"))
    return {"rscp_dbm": rssi_dbm(rscp, -1.0), "ecio_db": level(ecio, -32.0, -0.1, -1.0)}


def _system_identity(found: re.Match[str], cid_bits: int) -> dict[str, Any]:
    mcc, mnc, lac, cell = found.groups()[1:]
    if network(mcc, "00")[0] is None:
        return {}
    padded = len(mnc) == 1 or (len(mnc) == 3 and mnc.startswith("0"))  # 001 is printed for 01
    return {
        "mcc": mcc,
        "mnc": None if padded else mnc,
        "lac": area(lac, 10),
        "cid": cell_identity(cell, cid_bits, 10),
    }


def _environment(lines: Sequence[str]) -> Iterator[Row]:
    """LTE cells of CMGRMI; a neighbour's channel stands in the row of its group, further up."""
    channels: dict[str, str] = {}
    serving: tuple[int | None, int | None] | None = None
    for line in lines:
        for name, text in _CMGRMI.findall(line):
            kind, values = name.upper(), [value.strip() for value in text.split(",")]
            if kind == "SERVING_CELL" and len(values) == len(_SERVING):
                channels = {}
                reading = _lte("serving", dict(zip(_SERVING, values, strict=False)))
                serving = (reading.arfcn, reading.pci)
                yield reading
            elif kind == "LTE_INTRA" and len(values) > 2:
                channels["intra"] = values[1]
            elif kind == "LTE_INTER":
                channels |= dict(_FREQUENCY.findall(text))
            elif (group := _group(kind)) and len(values) == len(_NEIGHBOUR):
                named = dict(zip(_NEIGHBOUR, values, strict=False))
                reading = _lte("neighbour", {**named, "earfcn": channels.get(group, "")})
                if reading.rsrp_dbm is not None and (reading.arfcn, reading.pci) != serving:
                    yield reading


def _group(kind: str) -> str | None:
    inter = _INTER_CELL.fullmatch(kind)
    return inter[1] if inter else "intra" if _INTRA_CELL.fullmatch(kind) else None


def _lte(role: Role, named: Mapping[str, str]) -> CellReading:
    texts = {name: named[name] for name in _LTE_VALUES if name in named}
    levels = {
        "rsrp_dbm": rsrp_dbm(named["rsrp"], 0.1),
        "rsrq_db": rsrq_db(named["rsrq"], 0.1),
        "rssi_dbm": rssi_dbm(named["rssi"], 0.1),
    }
    return CellReading(
        role=role,
        rat="LTE",
        **(_measured_identity(named) if role == "serving" else {}),
        **read_values(texts),
        **cpsi.tenths(levels),
    )


def _measured_identity(named: Mapping[str, str]) -> dict[str, Any]:
    mcc, mnc = network(named["mcc"], named["mnc"])
    if mcc is None or str(len(mnc or "")) != named["mnc_digits"]:
        return {}
    return {
        "mcc": mcc,
        "mnc": mnc,
        "tac": area(named["tac"], 10),
        "cid": cell_identity(named["cellid"], 28, 10),
    }
