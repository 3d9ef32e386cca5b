"""By how much a cell is stronger in walk B, and how likely that is if nothing changed.

The likelihood of a change m of the mean is that of Student's t for each difference, and of its
tail for each censored one. The test compares the best m with the best under the null hypothesis,
which allows the offset of the other cells and its uncertainty (likelihood ratio, chi-square with
one degree of freedom).
"""

from typing import NamedTuple

import numpy as np
from scipy import stats

from logger.core.arrays import FloatArray
from postproc.comparison.differences import Differences
from postproc.comparison.noise import (
    CELL_DB,
    FREEDOM,
    MISS,
    OTHER_MODEM_DB,
    SAME_MODEM_DB,
    scale_db,
)

_MOST_DB, _STEP_DB = 60.0, 0.1
_CHANGES_DB = np.arange(-_MOST_DB, _MOST_DB + _STEP_DB / 2, _STEP_DB)
"""Changes of the mean that are tried."""
_MAD = 1.4826
"""Standard deviation of a Gaussian from its median absolute deviation."""
_FEWEST_SCALE = 20
"""Differences from which the scale of the noise of two walks can be estimated."""


class Offset(NamedTuple):
    """Offset of walk B against walk A and its standard deviation in dB."""

    db: float
    sigma_db: float


class Change(NamedTuple):
    """Change of the mean level in dB with its standard deviation, both with the offset in them.

    `log_likelihood` has shape (changes,), over the changes that are tried.
    """

    db: float
    sigma_db: float
    log_likelihood: FloatArray


def change_of(differences: Differences, scale: float) -> Change:
    """The likeliest change of the mean; `scale` is the factor of the variance."""
    log_likelihood = _log_likelihood(differences, scale)
    best = int(np.argmax(log_likelihood))
    # where half a nat is lost on either side
    inside = np.flatnonzero(log_likelihood >= log_likelihood[best] - 0.5)
    half_width_db = 0.5 * _STEP_DB * (inside[-1] - inside[0] + 1)
    sigma_db = float(np.hypot(half_width_db, np.sqrt(scale) * CELL_DB))
    return Change(float(_CHANGES_DB[best]), sigma_db, log_likelihood)


def probability(change: Change, offset: Offset, scale: float) -> float:
    """Probability of a change as large as this one if the cell has only the offset."""
    sigma_db = np.hypot(offset.sigma_db, np.sqrt(scale) * CELL_DB)
    penalty = 0.5 * ((_CHANGES_DB - offset.db) / sigma_db) ** 2
    null = float(np.max(change.log_likelihood - penalty))
    ratio = 2.0 * (float(np.max(change.log_likelihood)) - null)
    return float(stats.chi2.sf(max(ratio, 0.0), 1))


def offset_of(others: list[Change], *, same_modem: bool) -> Offset:
    """Offset that the changes of other cells show.

    Their weighted median, which a minority of changed cells does not move, with the prior.
    """
    prior_db2 = (SAME_MODEM_DB if same_modem else OTHER_MODEM_DB) ** 2
    if not others:
        return Offset(0.0, float(np.sqrt(prior_db2)))
    changes_db = np.array([change.db for change in others])
    weight = np.array([1.0 / change.sigma_db**2 for change in others])
    order = np.argsort(changes_db)
    half = int(np.searchsorted(np.cumsum(weight[order]), 0.5 * np.sum(weight)))
    median_db = float(changes_db[order][min(half, len(order) - 1)])
    # the median of Gaussians has pi/2 times the variance of the mean
    of_median_db2 = 0.5 * np.pi / float(np.sum(weight))
    gain = prior_db2 / (prior_db2 + of_median_db2)
    return Offset(gain * median_db, float(np.sqrt(gain * of_median_db2)))


def scale_of(differences: list[Differences]) -> float:
    """Factor of the variance for two walks that differ more than the measured ones; at least 1.

    From the differences within each cell; a few cells that have changed do not matter.
    """
    deviations = [part for one in differences if (part := _deviations(one)) is not None]
    if sum(map(len, deviations)) < _FEWEST_SCALE:
        return 1.0
    return max(1.0, float(_MAD * np.median(np.abs(np.concatenate(deviations)))) ** 2)


def _deviations(differences: Differences) -> FloatArray | None:
    """Deviations from the cell's own median by their standard deviation; None for one block."""
    measured = differences.bound == 0
    n = int(np.count_nonzero(measured))
    if n < 2:
        return None
    values = differences.difference_db[measured]
    apart = (values - np.median(values)) / np.sqrt(differences.variance_db2[measured])
    # what the median of n blocks takes with it
    return np.asarray(apart * np.sqrt(n / (n - 1)), float)


def _log_likelihood(differences: Differences, scale: float) -> FloatArray:
    width_db = scale_db(scale * differences.variance_db2)
    away = (differences.difference_db - _CHANGES_DB[:, None]) / width_db
    measured = differences.bound == 0
    log_density = stats.t.logpdf(away[:, measured], FREEDOM)
    side = -differences.bound[~measured]
    log_tail = np.log(MISS + (1.0 - MISS) * stats.t.cdf(side * away[:, ~measured], FREEDOM))
    return np.asarray(np.sum(log_density, axis=1) + np.sum(log_tail, axis=1), float)
