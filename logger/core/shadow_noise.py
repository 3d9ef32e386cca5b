"""The share of the noise that is white, from the readings themselves.

The locator gathers readings into blocks and holds only a few shares for possible, so that its mean
share is rough, and a filter with a wrong share is surprised by every reading or by none. How likely
the levels are, with the place taken as certain, tells the shares apart (prediction error
decomposition: Schweppe, IEEE Trans. Inf. Theory 11(1), 1965).
"""

from collections.abc import Sequence
from math import isnan, log

from logger.core.arrays import FloatArray
from logger.core.shadow_ekf import ShadowNoise, hold, split_noise, step

_WHITE_SHARES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
_NEARLY_WHITE = 0.95
_FEWEST = 50

Reading = tuple[float, float, float, float, int]
"""Receiver's x and y and its error per axis (m), level (dBm), limit: as `shadow_ekf.step` takes
them.
"""


def candidates(
    sigma_db: float, decorrelation_m: float, white_share: float, height_m: float
) -> list[ShadowNoise]:
    """What the locator says of the noise, then the same with other white shares.

    Where nearly all of it is white, its mean decorrelation distance says nothing, and all of it is
    taken for white.
    """
    if white_share >= _NEARLY_WHITE:
        return [split_noise(sigma_db, 0.0, 1.0, height_m)]
    return [
        split_noise(sigma_db, decorrelation_m, share, height_m)
        for share in (white_share, *_WHITE_SHARES)
    ]


def likeliest(
    found: Sequence[ShadowNoise], mean: FloatArray, readings: Sequence[Reading]
) -> ShadowNoise:
    """That of the candidates under which the readings are likeliest, given [x, y, P0, eta].

    The first where there are fewer than 50 readings, which tell too little. Costs a step for each
    pair of both.
    """
    if len(readings) < _FEWEST:
        return found[0]
    return max(found, key=lambda noise: _log_likelihood(noise, mean, readings))


def _log_likelihood(noise: ShadowNoise, mean: FloatArray, readings: Sequence[Reading]) -> float:
    """Of the levels that are no limits, but for a constant."""
    state = hold(mean, noise, readings[0][0], readings[0][1])
    total = 0.0
    for reading in readings:
        state, innovation_db, variance_db2 = step(state, noise, *reading)
        if not isnan(innovation_db):
            total -= 0.5 * (log(variance_db2) + innovation_db * innovation_db / variance_db2)
    return total
