"""Readings from places where the scans name a cell regularly, not only where it is strong there.

A modem names its strongest cells. Where a cell is in some of the scans only, its readings are the
high ones of that place, and all together they decay with distance more slowly than the levels do
(truncation: J. Tobin, Econometrica 26, 1958). So readings count where most scans nearby name the
cell.
"""

import numpy as np

from logger.core.arrays import BoolArray, FloatArray

NEAR_M = 150.0
"""Along the walk to either side.

Farther, cells of a single walk through a dense city have no such place; nearer, slow shadowing
still selects the readings.
"""
LEAST_SHARE = 0.75
"""Of the scans near a reading.

Coverage of 259 cells of three synthetic cities of 80 and 200 stations: with all readings 0.87, with
0.75 of the scans 0.95, with 0.8 within 200 m 0.96. In 60 single walks in white noise 0.85, 0.92 and
0.85.
"""
FEWEST_LEVELS = 20
"""That have to remain, a few times the unknowns; else all readings count."""
_STRONGEST = 0.1
"""Share of the readings. A cell that is absent near these too is absent for another reason: the
modem lists what the network tells it, or names one cell at a time."""


def regularly_named(
    level_dbm: FloatArray, is_level: BoolArray, named_share: FloatArray
) -> BoolArray:
    """Which readings (n,) count; all of them where absence does not show weakness.

    `is_level` are those within the scale of the modem, `named_share` is the share of the scans near
    each reading that name the cell.
    """
    is_regular = named_share >= LEAST_SHARE
    n_strongest = int(np.ceil(_STRONGEST * len(level_dbm)))
    strongest = np.argsort(-level_dbm, kind="stable")[:n_strongest]
    is_by_level = np.mean(is_regular[strongest]) > 0.5 if n_strongest else False
    if is_by_level and np.count_nonzero(is_regular & is_level) >= FEWEST_LEVELS:
        return is_regular
    return np.ones_like(is_regular)
