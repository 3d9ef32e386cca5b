"""The noise of differences between two walks between which nothing changed.

Null hypothesis: the difference in a block of 50 m is an offset of the modem plus an error that is
independent from block to block, of Student's t distribution, with variance

    PLACE_DB^2 + READING_DB^2 (1/n_a + 1/n_b)

for n_a and n_b readings. It was measured on 78 pairs of walks along one route over 14 weeks, 1443
blocks (`benchmarks/comparison.py` has the set): what two walks past the same houses differ by,
which is less than shadowing.
"""

import numpy as np

from logger.core.arrays import FloatArray, IntArray

PLACE_DB = 3.0
READING_DB = 3.5
"""Standard deviations of the two terms; at 1 and 1 readings 5.8 dB, at 3 and 3 readings 4.2 dB."""
CELL_DB = 1.0
"""Of a cell as a whole, beyond its blocks: the mean of 11 to 20 blocks differs by 1.0 dB."""
FREEDOM = 5.0
"""Degrees of freedom of a block's error.

The kurtosis was 3.3 to 4.8 for walks and 4.2 to 8.4 for cars; a Gaussian has 3, this has 9.
"""
SAME_MODEM_DB, OTHER_MODEM_DB = 2.0, 6.0
"""Prior of the offset: 2.0 dB between walks with one phone; between models a few dB more."""
MISS = 0.2
"""Smallest chance not to hear a cell in a block although its level is above the floor.

A GSM phone that drove over its own ground again missed 47 of 282 cells that it had heard there 6 dB
or more above the floor, and not fewer of the strongest.
"""

_FREEDOM_SHARE = (FREEDOM - 2.0) / FREEDOM
"""Square of the scale of Student's t by its variance."""


def variance_db2(count_a: IntArray, count_b: IntArray) -> FloatArray:
    """Variance of the difference of two blocks by their numbers of readings, shape (n,)."""
    return np.asarray(PLACE_DB**2 + READING_DB**2 * (1.0 / count_a + 1.0 / count_b), float)


def scale_db(variance_db2: FloatArray) -> FloatArray:
    """Scale of Student's t distribution with these variances, shape as the argument."""
    return np.asarray(np.sqrt(variance_db2 * _FREEDOM_SHARE), float)
