"""What a cell can have and a telephone can report: ranges of levels, and codes that mean nothing.

Modems and other programs print fillers where they know no level or no cell. All of them are outside
of these ranges or among these codes.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from logger.core.types import CellReading, Rat

_GSM_DBM = (-113.0, -47.0)
"""Lowest index (SIM800 manual V1.09 p163) to RXLEV 63 (3GPP TS 45.008 8.1.4)."""
_RSRP_DBM = (-140.0, -43.0)
"""3GPP TS 36.133 9.1.4, and one step more at the strong end, where modems round."""
_COVERAGE_DBM = (-156.0, -43.0)
"""The same with enhanced coverage: NB-IoT (36.133 9.1.22.9) and LTE-M (9.1.4, extended)."""
_CARRIER_DBM = (-120.0, -25.0)
"""Total power on a channel, up to the highest that a receiver must bear (3GPP TS 36.101 7.4)."""
_RANGES_DBM: Mapping[str, Mapping[Rat | None, tuple[float, float]]] = {
    "rssi_dbm": {"GSM": _GSM_DBM, None: _CARRIER_DBM},
    "rscp_dbm": {None: (-120.0, -25.0)},  # 3GPP TS 25.133 9.1.1.3
    "rsrp_dbm": {
        "NB-IoT": _COVERAGE_DBM,
        "LTE-M": _COVERAGE_DBM,
        "NR": (-156.0, -31.0),  # 3GPP TS 38.133 10.1.6
        None: _RSRP_DBM,
    },
}
"""Range of a level by technology, None for others; outside is a filler or damage."""
_OWN = {
    "WCDMA": "rscp_dbm",
    "LTE": "rsrp_dbm",
    "LTE-M": "rsrp_dbm",
    "NB-IoT": "rsrp_dbm",
    "NR": "rsrp_dbm",
}
"""The level of the cell alone, not replaced by the carrier's where damaged."""
_CARRIER_ABOVE_DB = (-3.0, 60.0)
"""Carrier above cell: up to 20 dB (resource blocks) and 34 dB (RSRQ), averaged separately."""
_IDENTITY_BITS: Mapping[Rat | None, int] = {"GSM": 16, "NR": 36}
"""Others have 28 (3GPP TS 23.003 4.3, TS 36.413 9.2.1.38, TS 38.413 9.3.1.7)."""


def widest_dbm(name: str) -> tuple[float, float]:
    """Lowest and highest value of a level of any technology, for example of `rsrp_dbm`."""
    lowest, highest = zip(*_RANGES_DBM[name].values(), strict=True)
    return min(lowest), max(highest)


def range_dbm(rat: Rat) -> tuple[float, float]:
    """Lowest and highest level of a cell of a technology."""
    ranges = _RANGES_DBM[_OWN.get(rat, "rssi_dbm")]
    return ranges.get(rat, ranges[None])


def reportable(reading: CellReading) -> CellReading:
    """The reading without levels that its technology cannot report."""
    outside = {name for name in _RANGES_DBM if not _is_reportable(reading, name)}
    own = _OWN.get(reading.rat or "", "")
    if own in outside or (own and not _holds(reading.rssi_dbm, getattr(reading, own))):
        outside.add("rssi_dbm")
    if not outside:
        return reading
    nothing: dict[str, Any] = dict.fromkeys(outside)
    return replace(reading, **nothing)


def area_marks(bits: int = 16) -> set[int]:
    """Location or tracking area codes that mean no area (3GPP TS 24.008 10.5.1.3)."""
    return {0, 0xFFFE, 0xFFFF, 2**bits - 2, 2**bits - 1}


def identity_marks(bits: int) -> set[int]:
    """Cell identities that modems and programs print for no cell: 0 and all ones."""
    return {0, 0xFFFF, 2**bits - 1}


def identity_bits(rat: Rat | None) -> int:
    """Length of a cell identity."""
    return _IDENTITY_BITS.get(rat, 28)


def _holds(carrier_dbm: float | None, cell_dbm: float | None) -> bool:
    low, high = _CARRIER_ABOVE_DB
    return carrier_dbm is None or cell_dbm is None or low <= carrier_dbm - cell_dbm <= high


def _is_reportable(reading: CellReading, name: str) -> bool:
    value: float | None = getattr(reading, name)
    ranges = _RANGES_DBM[name]
    low, high = ranges.get(reading.rat, ranges[None])
    return value is None or low <= value <= high
