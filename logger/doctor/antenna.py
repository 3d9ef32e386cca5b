"""Test of the antenna: whether the levels are what this place should give."""

from collections.abc import Mapping

import numpy as np

from logger.core.baseline import Baseline
from logger.core.censoring import levels_dbm
from logger.core.rows import Rows
from logger.core.squares import square_of
from logger.device.check_line import Line

LOST_DB = 20.0
"""A modem without an antenna receives some 20 dB less; two modems differ by a few."""
WEAK_DBM: Mapping[bytes, float] = {b"GSM": -95.0, b"WCDMA": -105.0, b"LTE": -115.0}
"""Outdoors the strongest cell is seldom this weak, some 10 dB above what a modem can hear."""
_FEWEST = 3
"""Cells that are compared: one alone may have changed."""


def antenna_line(readings: Rows, fixes: Rows, baseline: Baseline | None) -> Line | None:
    """Compare with earlier walks here, else with what is usual outdoors; None without a level."""
    heard = _mean_levels(readings)
    if not heard:
        return None
    differences = _differences(heard, fixes, baseline)
    if len(differences) >= _FEWEST:
        median_db = float(np.median(differences))
        text = f"{len(differences)} cells are {abs(median_db):.0f} dB"
        if median_db <= -LOST_DB:
            text = f"{text} weaker here than on earlier walks: is the antenna connected?"
            return Line("warn", "antenna", text)
        side = "stronger" if median_db > 0 else "weaker"
        return Line("ok", "antenna", f"{text} {side} here than on earlier walks")
    return _absolute(readings)


def _mean_levels(readings: Rows) -> dict[str, float]:
    """Mean level of each cell with an identity."""
    levels = levels_dbm(readings)
    usable = (readings["cell"] != b"") & np.isfinite(levels)
    cells = readings["cell"][usable]
    return {
        name.decode(): float(np.mean(levels[usable][cells == name])) for name in np.unique(cells)
    }


def _differences(heard: dict[str, float], fixes: Rows, baseline: Baseline | None) -> list[float]:
    valid = fixes[fixes["valid"] == 1]
    if baseline is None or not len(valid):
        return []
    place = square_of(float(valid["lat_deg"][-1]), float(valid["lon_deg"][-1]))
    known = baseline.square(place).cells
    return [level - known[name].mean_dbm for name, level in heard.items() if name in known]


def _absolute(readings: Rows) -> Line:
    levels = levels_dbm(readings)
    for rat, weak_dbm in WEAK_DBM.items():
        own = levels[(readings["rat"] == rat) & np.isfinite(levels)]
        if not len(own):
            continue
        text = f"strongest {rat.decode()} cell {own.max():.0f} dBm"
        if own.max() < weak_dbm:
            text = f"{text}: weak for a place outdoors; is the antenna connected?"
            return Line("warn", "antenna", text)
        return Line("ok", "antenna", text)
    return Line("ok", "antenna", "no level of GSM, UMTS or LTE to compare")
