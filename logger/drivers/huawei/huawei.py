"""Huawei, HiSilicon Balong: cells from ^MONSC and ^MONNC, levels from ^HCSQ
(firmware_notes/huawei.md).

    ^MONSC: GSM,460,00,1,12,49,2D54,57B2,-68,,          serving: band, ARFCN, BSIC, cell, area, level, quality, TA
    ^MONSC: LTE,460,00,38400,D975244,8,24C8,-85,-10,-54 EARFCN, cell, PCI, area, RSRP, RSRQ, RSSI
    ^MONNC: NR,524910,17F,-157,-44,-24                  neighbour: NR-ARFCN, PCI, RSRP, RSRQ, SINR
    ^HCSQ:"LTE",30,19,66,0                              indices of RSSI, RSRP, SINR, RSRQ

Cell, area and PCI are hexadecimal without leading zeros, all else is decimal (the format strings of
the firmware's AT layer, published with the HiSilicon kernel sources). What is not known is left
empty.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from logger.core.types import CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.cinterion.cinterion import grouped
from logger.drivers.claim import Claim
from logger.drivers.family import Family
from logger.drivers.generic.generic import Generic, serving_cell
from logger.drivers.network_mode import ModeCommand
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.reading.fields import (
    area,
    cell_identity,
    decimal,
    hexadecimal,
    level,
    network,
    pieces,
    rsrp_dbm,
    rssi_dbm,
)
from logger.drivers.reading.fields import values as split
from logger.drivers.reading.rows import NoCell, Row, Signal

_MON = re.compile(r"\^(MONSC|MONNC)\s*:\s*([\w ,.+-]*)", re.IGNORECASE | re.ASCII)
_HCSQ = re.compile(
    r'\^HCSQ\s*:\s*"?([A-Z]\w*(?: \w+)*)"?\s*((?:,\s*\d{1,3}(?!\d)\s*)*)', re.IGNORECASE | re.ASCII
)

_NETWORK = ("mcc", "mnc")
_LAYOUTS: Mapping[tuple[str, str], tuple[Rat, tuple[str, ...]]] = {
    ("MONSC", "GSM"): (
        "GSM",
        (*_NETWORK, "gsm_band", "arfcn", "bsic", "cell16", "lac", "rssi", "rxq", "ta"),
    ),
    ("MONSC", "WCDMA"): (
        "WCDMA",
        (*_NETWORK, "arfcn", "psc", "cell28", "lac", "rscp", "rssi", "ecn0", "drx", "ura"),
    ),
    ("MONSC", "LTE"): (
        "LTE",
        (*_NETWORK, "arfcn", "cell28", "pci", "tac16", "rsrp", "rsrq", "rssi"),
    ),
    ("MONSC", "NR"): (
        "NR",
        (*_NETWORK, "arfcn", "scs", "cell36", "pci", "tac24", "rsrp", "rsrq", "sinr"),
    ),
    ("MONNC", "GSM"): ("GSM", ("gsm_band", "arfcn", "bsic", "cell16", "lac", "rssi")),
    ("MONNC", "WCDMA"): ("WCDMA", ("arfcn", "psc", "rscp", "ecn0")),
    ("MONNC", "LTE"): ("LTE", ("arfcn", "pci", "rsrp", "rsrq", "rssi")),
    ("MONNC", "NR"): ("NR", ("arfcn", "pci", "rsrp", "rsrq", "sinr")),
}
_SPARE = frozenset({"rxq", "ta", "drx", "ura", "rssi", "rsrq", "ecn0", "sinr"})
"""The last values of a row, which it can do without."""

_IDENTITY = frozenset({"lac", "tac16", "tac24", "cell16", "cell28", "cell36"})

_SIGNED = r"[-+]?\d{1,4}"
_FORMS = {
    "mcc": r"\d{3}",
    "mnc": r"\d{2,3}",
    "gsm_band": r"[0-3]",
    "arfcn": r"\d{1,7}",
    "bsic": r"\d{1,2}",
    "psc": r"\d{1,3}",
    "pci": r"[0-9A-F]{1,3}",
    "lac": r"[0-9A-F]{1,4}",
    "tac16": r"[0-9A-F]{1,4}",
    "tac24": r"[0-9A-F]{1,6}",
    "cell16": r"[0-9A-F]{1,4}",
    "cell28": r"[0-9A-F]{1,7}",
    "cell36": r"[0-9A-F]{1,9}",
    "drx": r"\d{1,5}",
    "ura": r"\d{1,5}",
}
_GSM_BANDS = {"0": 850, "1": 900, "2": 1800, "3": 1900}
_VALUES: Mapping[str, tuple[str, Callable[[str], Any]]] = {
    "gsm_band": ("band", _GSM_BANDS.get),
    "arfcn": ("arfcn", lambda text: decimal(text, 0, 3279165)),
    "bsic": ("bsic", lambda text: decimal(text, 0, 63)),
    "psc": ("psc", lambda text: decimal(text, 0, 511)),
    "pci": ("pci", lambda text: hexadecimal(text, 0, 1007)),
    "lac": ("lac", area),
    "tac16": ("tac", area),
    "tac24": ("tac", lambda text: area(text, bits=24)),
    "cell16": ("cid", lambda text: cell_identity(text, 16)),
    "cell28": ("cid", lambda text: cell_identity(text, 28)),
    "cell36": ("cid", lambda text: cell_identity(text, 36)),
    "rssi": ("rssi_dbm", rssi_dbm),
    "rxq": ("rxq", lambda text: decimal(text, 0, 7)),
    "ta": ("ta", lambda text: decimal(text, 0, 63)),
    "rscp": ("rscp_dbm", rssi_dbm),
    "ecn0": ("ecio_db", lambda text: level(text, -32.0, 0.0)),
    "rsrp": ("rsrp_dbm", rsrp_dbm),
    "rsrq": (
        "rsrq_db",
        lambda text: level(text, -43.0, 20.0),
    ),  # -44 with -157 and -24: not measured
    "sinr": ("sinr_db", lambda text: level(text, -23.0, 40.0)),
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
    """Serving cell and neighbours by ^MONSC and ^MONNC, by ^SMOND of the GSM modules, or else what
    all modems tell.
    """

    name: ClassVar[str] = "huawei"
    claim: ClassVar[Claim] = Claim(maker=r"\bHUAWEI\b|\bTD[ -]?TECH\b", series=r"\bMT5700")
    setup_commands: ClassVar[tuple[Command, ...]] = Generic.setup_commands
    poll_commands: ClassVar[tuple[Command, ...]] = (
        Command("AT^MONSC"),
        Command("AT^MONNC"),
        Command("AT^HCSQ?"),
        Command("AT^SMOND"),
        *Generic.poll_commands,
    )
    survey_commands: ClassVar[tuple[Command, ...]] = Generic.survey_commands
    mode_commands: ClassVar[tuple[ModeCommand, ...]] = network_mode.SYSCFG

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells heard now; the serving one put together from +CREG and its like where ^MONSC is not
        known.
        """
        rows = yield from self.ask(self.poll_commands)
        if rows is None or any(isinstance(row, CellReading) for row in rows):
            return rows
        serving = serving_cell(rows)
        return rows if serving is None else (serving, *rows)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Rows of ^MONSC, ^MONNC, ^HCSQ, ^SMONC and ^SMOND."""
        found: list[Row] = []
        for line in pieces(lines):
            found += (
                row
                for kind, text in _MON.findall(line)
                if (row := _cell(kind.upper(), text)) is not None
            )
            found += (
                row
                for mode, text in _HCSQ.findall(line)
                if (row := _quality(mode.upper(), text)) is not None
            )
            found += grouped(line)
        return tuple(found)


def _cell(kind: str, text: str) -> Row | None:
    """Reading of a row in one of the layouts; None where it is damaged or lacks more than its last
    values.
    """
    mode, *fields = split(text)
    mode = mode.upper()
    if mode == "NONE":
        return NoCell(status=mode) if kind == "MONSC" else None
    rat, layout = _LAYOUTS.get((kind, mode), (None, ()))
    named = dict(zip(layout, fields, strict=False))
    if rat is None or not fields or not _whole(layout, fields) or not _well_formed(named):
        return None
    mcc, mnc = network(named.get("mcc", ""), named.get("mnc", ""))
    if mcc is None and "mcc" in layout:
        named = {name: value for name, value in named.items() if name not in _IDENTITY}
    known = {key: read(named[name]) for name, (key, read) in _VALUES.items() if name in named}
    role: Role = "serving" if kind == "MONSC" else "neighbour"
    return CellReading(role=role, rat=rat, mcc=mcc, mnc=mnc, **known)


def _whole(layout: Sequence[str], fields: Sequence[str]) -> bool:
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
    """Indices of ^HCSQ and what they stand for; without a service there is no cell."""
    raw = [int(value) for value in re.findall(r"\d+", text)]
    if not raw:
        return NoCell(status=mode) if mode.startswith("NO") else None
    rat, names = _HCSQ_FORMS.get(mode, (None, ()))
    scaled: dict[str, Any] = {
        name: _scaled(name, index) for name, index in zip(names, raw, strict=False)
    }
    return Signal(rat, **scaled, more={"raw": raw})


def _scaled(name: str, index: int) -> float | None:
    most, at_zero, step = _SCALES[name]
    return round(at_zero + step * index, 1) if 0 < index <= most else None
