"""Huawei, HiSilicon Balong: cells from ^MONSC and ^MONNC, levels from ^HCSQ.

    AT^MONSC
    ^MONSC: GSM,460,00,1,12,49,2D54,57B2,-68,,     band, ARFCN, BSIC, cell, area, dBm, quality, TA
    OK
    ^MONSC: LTE,460,00,38400,D975244,8,24C8,-85,-10,-54
                                                   EARFCN, cell, PCI, area, RSRP, RSRQ, RSSI
    AT^MONNC
    ^MONNC: NR,524910,17F,-157,-44,-24             neighbour: NR-ARFCN, PCI, RSRP, RSRQ, SINR
    AT^HCSQ?
    ^HCSQ:"LTE",30,19,66,0                         indices of RSSI, RSRP, SINR, RSRQ

Needs: nothing; the commands read what the modem measures anyway. GSM modules (MG323) have ^SMOND
instead, dongles without either the standard replies.
Known by: the maker, Huawei or TD Tech, or the series MT5700.
Doubts: cell, area and PCI are hexadecimal without leading zeros, so no width shows a lost digit;
all else is decimal. Unknown values are empty. Order and scale of ^HCSQ on NR are not documented.
Sources: measured replies in public code, those of NR from an MT5700; the format strings of the AT
layer published with the HiSilicon kernel sources; ModemManager's tests (firmware_notes/huawei.md).
"""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from logger.core.types import CellReading, Rat
from logger.drivers import network_mode
from logger.drivers.cinterion import grouped_cells
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.generic import Generic
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading.row_language import (
    VALUES,
    Form,
    Kinds,
    NoCell,
    Row,
    Scale,
    Signal,
    Value,
    form,
    number,
    pieces,
    split,
    values_like,
)
from logger.drivers.reading.standard_replies import with_serving_cell

_MON = re.compile(r"\^(MONSC|MONNC)\s*:\s*([\w ,.+-]*)", re.IGNORECASE | re.ASCII)
_HCSQ = re.compile(
    r'\^HCSQ\s*:\s*"?([A-Z]\w*(?: \w+)*)"?\s*((?:,\s*\d{1,3}(?!\d)\s*)*)', re.IGNORECASE | re.ASCII
)

_KINDS: Kinds = {
    **values_like(levels=r"[-+]?\d{1,4}", padding="(?:0x)?0?"),
    "gsm_band": Value("band", {"0": 850, "1": 900, "2": 1800, "3": 1900}.get, "[0-3]"),
    **{
        name: VALUES[name]._replace(pattern=VALUES["nrarfcn"].pattern)
        for name in ("arfcn", "uarfcn", "earfcn", "nrarfcn")
    },
    # a comma within the area would put digits of it here
    **{name: VALUES[name]._replace(pattern=r"-\d{1,4}|0") for name in ("rssi", "rscp", "rsrp")},
    # other makers' marks for unknown
    "rxq": VALUES["rxq"]._replace(pattern=r"\d|99"),
    "ta": VALUES["ta"]._replace(pattern=r"\d{1,2}|255"),
    "drx": number("", 0, 99999),
    "ura": number("", 0, 99999),
}
_FORMS: Mapping[str, tuple[Rat, str]] = {
    "MONSC GSM": ("GSM", "mcc mnc gsm_band arfcn bsic cid16 lac rssi [rxq ta _]"),
    "MONSC WCDMA": ("WCDMA", "mcc mnc uarfcn psc cid28 lac rscp [rssi ecn0 drx ura _]"),
    "MONSC LTE": ("LTE", "mcc mnc earfcn cid28 pci_hex tac rsrp [rsrq rssi _]"),
    "MONSC NR": ("NR", "mcc mnc nrarfcn _scs cid36 pci_nr_hex tac24 rsrp [rsrq sinr _]"),
    "MONNC GSM": ("GSM", "gsm_band arfcn bsic cid16 lac rssi [_]"),
    "MONNC WCDMA": ("WCDMA", "uarfcn psc rscp [ecn0 _]"),
    "MONNC LTE": ("LTE", "earfcn pci_hex rsrp [rsrq rssi _]"),
    "MONNC NR": ("NR", "nrarfcn pci_nr_hex rsrp [rsrq sinr _]"),
}
_ROWS: Mapping[str, Form] = {
    kind: form(rat, names, _KINDS, unknown="-*") for kind, (rat, names) in _FORMS.items()
}

_HCSQ_VALUES: Mapping[str, tuple[Rat, tuple[str, ...]]] = {
    "GSM": ("GSM", ("rssi_dbm",)),
    "WCDMA": ("WCDMA", ("rssi_dbm", "rscp_dbm", "ecio_db")),
    "LTE": ("LTE", ("rssi_dbm", "rsrp_dbm", "sinr_db", "rsrq_db")),
    "NR": ("NR", ()),
}
_SCALES = {  # 0 itself is "below", 255 unknown
    "rssi_dbm": Scale(96, -121.0, lowest=1),
    "rscp_dbm": Scale(96, -121.0, lowest=1),
    "ecio_db": Scale(65, -32.5, 0.5, lowest=1),
    "rsrp_dbm": Scale(97, -141.0, lowest=1),
    "sinr_db": Scale(251, -20.2, 0.2, lowest=1),
    "rsrq_db": Scale(34, -20.0, 0.5, lowest=1),
}


class Huawei(Family):
    """Cells by ^MONSC and ^MONNC, by ^SMOND, or by the standard commands."""

    name = "huawei"
    gives = MappingProxyType(
        {
            "GSM": cells_with("neighbours"),
            "WCDMA": cells_with("neighbours"),
            "LTE": cells_with(),
            "NR": cells_with("neighbours"),
        }
    )
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
        """Cells received now; the serving one from +CREG and its like without ^MONSC."""
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
    mode, *texts = split(text.upper())
    if mode == "NONE":
        return NoCell(status=mode) if kind == "MONSC" else None
    shape = _ROWS.get(f"{kind} {mode}")
    return shape.cell("serving" if kind == "MONSC" else "neighbour", texts) if shape else None


def _quality(mode: str, text: str) -> Row | None:
    """Without a service there is no cell."""
    raw = [int(value) for value in re.findall(r"\d+", text)]
    if not raw:
        return NoCell(status=mode) if mode.startswith("NO") else None
    rat, names = _HCSQ_VALUES.get(mode, (None, ()))
    levels: dict[str, Any] = {
        name: None if (value := _SCALES[name].value_at(index)) is None else round(value, 1)
        for name, index in zip(names, raw, strict=False)
    }
    return Signal(rat, **levels, more={"raw": raw})
