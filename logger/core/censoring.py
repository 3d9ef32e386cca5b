"""Levels of any technology, and the limits of a modem's scale: a reading there is censored.

It means "at most" or "at least" this level. GSM: RXLEV 0 is anything below -110 dBm, RXLEV 63
anything above -48 dBm (3GPP TS 45.008, 8.1.4). The limits of other scales are not known and show as
a pile of readings at the lowest or the highest value.
"""

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.column import UNKNOWN_ID
from logger.core.rows import Rows
from logger.core.types import RXLEV_0_DBM

GSM_FLOOR_DBM = RXLEV_0_DBM
GSM_CEILING_DBM = RXLEV_0_DBM + 63.0
"""As nominal levels."""

_LEAST_PILE = 5
_PILE_SHARE = 0.05
"""A pile has at least this share of the readings, and at least `_LEAST_PILE` of them."""
_FEWEST_LEVELS = 5
"""With fewer different levels a walk that stands still looks like a pile."""
_NEXT_DB = 4.0
_PILE_OVER_NEXT = 3.0
"""A pile has this many times the readings of the mean decibel of the `_NEXT_DB` beside it."""


def limits(level_dbm: FloatArray, rat: str | None) -> IntArray:
    """0 for a level, -1 for a reading at the floor of the scale, +1 at its ceiling; shape (n,)."""
    limit = np.zeros(len(level_dbm), np.int64)
    finite_dbm = level_dbm[np.isfinite(level_dbm)]
    if not len(finite_dbm):
        return limit
    low_dbm, high_dbm = float(np.min(finite_dbm)), float(np.max(finite_dbm))
    if (_is_gsm(rat) and low_dbm == GSM_FLOOR_DBM) or _is_pile(finite_dbm, low_dbm):
        limit[level_dbm == low_dbm] = -1
    if (_is_gsm(rat) and high_dbm == GSM_CEILING_DBM) or _is_pile(-finite_dbm, -high_dbm):
        limit[level_dbm == high_dbm] = 1
    return limit


def levels_dbm(readings: Rows) -> FloatArray:
    """Levels as `CellReading.level_dbm` defines them, for the table `readings`, shape (n,)."""
    rxlev = readings["rxlev_raw"]
    level_dbm = np.where(rxlev == UNKNOWN_ID, np.nan, rxlev + RXLEV_0_DBM)
    for name in ("rssi_dbm", "rscp_dbm", "rsrp_dbm"):
        level_dbm = np.where(np.isfinite(readings[name]), readings[name], level_dbm)
    return np.asarray(level_dbm, float)


def limit_of(level_dbm: float, rat: str | None) -> int:
    """As `limits` for a single reading, for which only the scale of GSM is known."""
    if not _is_gsm(rat):
        return 0
    return int(level_dbm == GSM_CEILING_DBM) - int(level_dbm == GSM_FLOOR_DBM)


def _is_gsm(rat: str | None) -> bool:
    return rat is not None and rat.upper() == "GSM"


def _is_pile(level_dbm: FloatArray, lowest_dbm: float) -> bool:
    """Whether far more readings are at the lowest level than just above, as no walk leaves them."""
    if len(np.unique(level_dbm)) < _FEWEST_LEVELS:
        return False
    is_next = (level_dbm > lowest_dbm) & (level_dbm <= lowest_dbm + _NEXT_DB)
    n_lowest, n_next = int(np.sum(level_dbm == lowest_dbm)), int(np.sum(is_next))
    least = max(_LEAST_PILE, _PILE_SHARE * len(level_dbm))
    return n_lowest >= least and n_lowest > _PILE_OVER_NEXT * n_next / _NEXT_DB
