"""The white share of a filter's noise, chosen by the readings.

The locator averages readings in blocks and considers a few shares only, so that its mean share is
rough, and the innovations of a filter with a wrong share are too large or too small. The likelihood
of the levels, with the position taken as certain, distinguishes the shares (prediction error
decomposition: Schweppe, IEEE Trans. Inf. Theory 11(1), 1965).
"""

from collections.abc import Sequence
from math import isnan, log

from logger.core.arrays import FloatArray
from logger.core.readings import Readings
from logger.core.shadow_ekf import ShadowNoise, hold, split_noise, step

_WHITE_SHARES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
_NEARLY_WHITE = 0.95  # the decorrelation distance of so little correlated noise is arbitrary
_FEWEST = 50  # readings, with which a share is known to a factor of 2


def candidates(
    sigma_db: float, decorrelation_m: float, white_share: float, height_m: float
) -> list[ShadowNoise]:
    """The locator's noise, then the same with other white shares.

    All of it is taken for white where nearly all is.
    """
    if white_share >= _NEARLY_WHITE:
        return [split_noise(sigma_db, 0.0, 1.0, height_m)]
    shares = white_share, *_WHITE_SHARES
    return [split_noise(sigma_db, decorrelation_m, share, height_m) for share in shares]


def likeliest(noises: Sequence[ShadowNoise], mean: FloatArray, readings: Readings) -> ShadowNoise:
    """The noise under which the readings are likeliest, given [x, y, P0, eta].

    The first for fewer than 50 readings. Takes a step of the filter for each pair of noise and
    reading.
    """
    if len(readings) < _FEWEST:
        return noises[0]
    return max(noises, key=lambda noise: _log_likelihood(noise, mean, readings))


def _log_likelihood(noise: ShadowNoise, mean: FloatArray, readings: Readings) -> float:
    """Log-likelihood of the levels that are not at a limit, but for a constant."""
    state = hold(mean, noise, readings.places)
    total, places = 0.0, readings.places
    columns = places.x_m, places.y_m, places.sigma_m, readings.level_dbm, readings.limit
    for reading in zip(*(column.tolist() for column in columns), strict=True):
        state, innovation_db, variance_db2 = step(state, noise, *reading)
        if not isnan(innovation_db):
            total -= 0.5 * (log(variance_db2) + innovation_db * innovation_db / variance_db2)
    return total
