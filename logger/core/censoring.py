"""Levels of any technology, and where a modem's scale ends: a reading there says "at most" or "at
least", not how much.

GSM: RXLEV 0 is anything below -110 dBm, RXLEV 63 anything above -48 dBm (3GPP TS 45.008, 8.1.4).
Elsewhere the end of the scale is not known and shows as a pile of readings at the lowest or the
highest value.
"""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.column import UNKNOWN_ID
from logger.core.rows import Rows

GSM_FLOOR_DBM = -110.0
GSM_CEILING_DBM = -47.0
"""As nominal levels: -110 dBm + RXLEV."""

_LEAST_PILE = 5
_FEWEST_LEVELS = 5
_PILE_SHARE = 0.05
_NEXT_DB = 4.0
_PILE_OVER_NEXT = 3.0


def limits(level_dbm: FloatArray, rat: str | None) -> IntArray:
    """0 for a level, -1 for a reading at the floor of the scale, +1 at its ceiling; shape (n,) as
    the levels.
    """
    limit = np.zeros(len(level_dbm), np.int64)
    if not len(level_dbm):
        return limit
    finite = level_dbm[np.isfinite(level_dbm)]
    low, high = float(np.min(finite, initial=np.inf)), float(np.max(finite, initial=-np.inf))
    gsm = rat is not None and rat.upper() == "GSM"
    if (gsm and low == GSM_FLOOR_DBM) or _is_pile(finite, low):
        limit[level_dbm == low] = -1
    if (gsm and high == GSM_CEILING_DBM) or _is_pile(-finite, -high):
        limit[level_dbm == high] = 1
    return limit


def levels_dbm(readings: Rows) -> FloatArray:
    """Levels as `CellReading.level_dbm` defines them, for the table `readings`, shape (n,)."""
    level_dbm = np.where(readings["rxlev_raw"] == UNKNOWN_ID, np.nan, readings["rxlev_raw"] - 110.0)
    for name in ("rssi_dbm", "rscp_dbm", "rsrp_dbm"):
        level_dbm = np.where(np.isfinite(readings[name]), readings[name], level_dbm)
    return np.asarray(level_dbm, float)


def limit_of(level_dbm: float, rat: str | None) -> int:
    """As `limits` for a single reading, where only the scale of GSM is known."""
    if rat is None or rat.upper() != "GSM":
        return 0
    return int(level_dbm == GSM_CEILING_DBM) - int(level_dbm == GSM_FLOOR_DBM)


def _is_pile(level_dbm: FloatArray, end: float) -> bool:
    """Whether far more readings stand at the lowest value than just above it, as no walk would
    leave them.
    """
    if len(np.unique(level_dbm)) < _FEWEST_LEVELS:
        return False
    at = int(np.count_nonzero(level_dbm == end))
    above = int(np.count_nonzero((level_dbm > end) & (level_dbm <= end + _NEXT_DB)))
    return (
        at >= max(_LEAST_PILE, _PILE_SHARE * len(level_dbm))
        and at > _PILE_OVER_NEXT * above / _NEXT_DB
    )
