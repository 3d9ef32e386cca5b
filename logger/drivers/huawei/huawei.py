"""Huawei, HiSilicon Balong: cells from ^MONSC and ^MONNC, levels from ^HCSQ.

    ^MONSC: GSM,460,00,1,12,49,2D54,57B2,-68,,     band, ARFCN, BSIC, cell, area, dBm, quality, TA
    ^MONSC: LTE,460,00,38400,D975244,8,24C8,-85,-10,-54
                                                   EARFCN, cell, PCI, area, RSRP, RSRQ, RSSI
    ^MONNC: NR,524910,17F,-157,-44,-24             neighbour: NR-ARFCN, PCI, RSRP, RSRQ, SINR
    ^HCSQ:"LTE",30,19,66,0                         indices of RSSI, RSRP, SINR, RSRQ

Cell, area and PCI are hexadecimal without leading zeros, all else is decimal (the format strings of
the firmware's AT layer, published with the HiSilicon kernel sources). Unknown values are empty
(firmware_notes/huawei.md).
"""

import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from logger.core.types import CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.cinterion.grouped_cells import grouped_cells
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.generic.generic import Generic
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.cell_values import VALUES, Readers, read_values
from logger.drivers.reading.fields import (
    level,
    network,
    pieces,
)
from logger.drivers.reading.fields import values as split
from logger.drivers.reading.rows import NoCell, Row, Signal
from logger.drivers.reading.serving_cell import with_serving_cell

_MON = re.compile(r"\^(MONSC|MONNC)\s*:\s*([\w ,.+-]*)", re.IGNORECASE | re.ASCII)
_HCSQ = re.compile(
    r'\^HCSQ\s*:\s*"?([A-Z]\w*(?: \w+)*)"?\s*((?:,\s*\d{1,3}(?!\d)\s*)*)', re.IGNORECASE | re.ASCII
)

_NETWORK = ("mcc", "mnc")
_LAYOUTS: Mapping[tuple[str, str], tuple[Rat, tuple[str, ...]]] = {
    ("MONSC", "GSM"): (
        "GSM",
        (*_NETWORK, "gsm_band", "arfcn", "bsic", "cid16", "lac", "rssi", "rxq", "ta"),
    ),
    ("MONSC", "WCDMA"): (
        "WCDMA",
        (*_NETWORK, "arfcn", "psc", "cid28", "lac", "rscp", "rssi", "ecn0", "drx", "ura"),
    ),
    ("MONSC", "LTE"): (
        "LTE",
        (*_NETWORK, "arfcn", "cid28", "pci_hex", "tac", "rsrp", "rsrq", "rssi"),
    ),
    ("MONSC", "NR"): (
        "NR",
        (*_NETWORK, "arfcn", "scs", "cid36", "pci_hex", "tac24", "rsrp", "rsrq", "sinr"),
    ),
    ("MONNC", "GSM"): ("GSM", ("gsm_band", "arfcn", "bsic", "cid16", "lac", "rssi")),
    ("MONNC", "WCDMA"): ("WCDMA", ("arfcn", "psc", "rscp", "ecn0")),
    ("MONNC", "LTE"): ("LTE", ("arfcn", "pci_hex", "rsrp", "rsrq", "rssi")),
    ("MONNC", "NR"): ("NR", ("arfcn", "pci_hex", "rsrp", "rsrq", "sinr")),
}
_SPARE = frozenset({"rxq", "ta", "drx", "ura", "rssi", "rsrq", "ecn0", "sinr"})
"""The last values of a row, which it can do without."""

_IDENTITY = frozenset({"lac", "tac", "tac24", "cid16", "cid28", "cid36"})

_SIGNED = r"[-+]?\d{1,4}"
_FORMS = {
    "mcc": r"\d{3}",
    "mnc": r"\d{2,3}",
    "gsm_band": r"[0-3]",
    "arfcn": r"\d{1,7}",
    "bsic": r"\d{1,2}",
    "psc": r"\d{1,3}",
    "pci_hex": r"[0-9A-F]{1,3}",
    "lac": r"[0-9A-F]{1,4}",
    "tac": r"[0-9A-F]{1,4}",
    "tac24": r"[0-9A-F]{1,6}",
    "cid16": r"[0-9A-F]{1,4}",
    "cid28": r"[0-9A-F]{1,7}",
    "cid36": r"[0-9A-F]{1,9}",
    "drx": r"\d{1,5}",
    "ura": r"\d{1,5}",
}
_GSM_BANDS = {"0": 850, "1": 900, "2": 1800, "3": 1900}
_READERS: Readers = {
    **VALUES,
    "gsm_band": ("band", _GSM_BANDS.get),
    "arfcn": VALUES["nrarfcn"],  # of any technology
    "rsrq": ("rsrq_db", partial(level, low=-43.0, high=20.0)),  # -44 is not measured, 0 is a value
}

_HCSQ_FORMS: Mapping[str, tuple[Rat, tuple[str, ...]]] = {
    "GSM": ("GSM", ("rssi_dbm",)),
    "WCDMA": ("WCDMA", ("rssi_dbm", "rscp_dbm", "ecio_db")),
    "LTE": ("LTE", ("rssi_dbm", "rsrp_dbm", "sinr_db", "rsrq_db")),
    "NR": ("NR", ()),
}
_SCALES = {  # highest index, value at 0, step; 0 itself is "below", 255 unknown
    "rssi_dbm": (96, -121.0, 1.0),
    "rscp_dbm": (96, -121.0, 1.0),
    "ecio_db": (65, -32.5, 0.5),
    "rsrp_dbm": (97, -141.0, 1.0),
    "sinr_db": (251, -20.2, 0.2),
    "rsrq_db": (34, -20.0, 0.5),
}


class Huawei(Family):
    """Cells by ^MONSC and ^MONNC, by ^SMOND of the GSM modules, else by the standard commands."""

    name = "huawei"
    claim = Claim(maker=r"\bHUAWEI\b|\bTD[ -]?TECH\b", series=r"\bMT5700")
    setup_commands = Generic.setup_commands
    poll_commands = (
        Command("AT^MONSC"),
        Command("AT^MONNC"),
        Command("AT^HCSQ?"),
        Command("AT^SMOND"),
        *Generic.poll_commands,
    )
    survey_commands = Generic.survey_commands
    mode_commands = network_mode.SYSCFG

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now; the serving one from +CREG and its like where ^MONSC is unknown."""
        rows = yield from self.ask(self.poll_commands)
        if rows is None or any(isinstance(row, CellReading) for row in rows):
            return rows
        return with_serving_cell(rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Rows of ^MONSC, ^MONNC, ^HCSQ, ^SMONC and ^SMOND."""
        rows: list[Row | None] = []
        for line in pieces(lines):
            rows += (_cell(kind.upper(), text) for kind, text in _MON.findall(line))
            rows += (_quality(mode.upper(), text) for mode, text in _HCSQ.findall(line))
            rows += grouped_cells(line)
        return tuple(row for row in rows if row is not None)


def _cell(kind: str, text: str) -> Row | None:
    """Reading of a row; None where it is damaged or more than its last values are missing."""
    mode, *fields = split(text)
    mode = mode.upper()
    if mode == "NONE":
        return NoCell(status=mode) if kind == "MONSC" else None
    rat, layout = _LAYOUTS.get((kind, mode), (None, ()))
    named = dict(zip(layout, fields, strict=False))
    if rat is None or not fields or not _is_complete(layout, fields) or not _well_formed(named):
        return None
    mcc, mnc = network(named.get("mcc", ""), named.get("mnc", ""))
    if mcc is None and "mcc" in layout:
        named = {name: value for name, value in named.items() if name not in _IDENTITY}
    role: Role = "serving" if kind == "MONSC" else "neighbour"
    return CellReading(role=role, rat=rat, mcc=mcc, mnc=mnc, **read_values(named, _READERS))


def _is_complete(layout: Sequence[str], fields: Sequence[str]) -> bool:
    """True where nothing is missing but last values that the row can do without."""
    missing = layout[len(fields) :]
    last = layout[min(len(fields), len(layout)) - 1]
    return len(fields) <= len(layout) + 1 and _SPARE.issuperset(missing) and last not in _IDENTITY


def _well_formed(named: Mapping[str, str]) -> bool:
    return all(
        not text or re.fullmatch(_FORMS.get(name, _SIGNED), text, re.ASCII | re.IGNORECASE)
        for name, text in named.items()
    )


def _quality(mode: str, text: str) -> Row | None:
    """Indices of ^HCSQ and their values; without a service there is no cell."""
    raw = [int(value) for value in re.findall(r"\d+", text)]
    if not raw:
        return NoCell(status=mode) if mode.startswith("NO") else None
    rat, names = _HCSQ_FORMS.get(mode, (None, ()))
    values: dict[str, Any] = {
        name: _value_of(name, index) for name, index in zip(names, raw, strict=False)
    }
    return Signal(rat, **values, more={"raw": raw})


def _value_of(name: str, index: int) -> float | None:
    most, at_zero, step = _SCALES[name]
    return round(at_zero + step * index, 1) if 0 < index <= most else None
