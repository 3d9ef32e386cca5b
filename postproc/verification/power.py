"""Power of the tests: the chance to reject a claim when the transmitter is somewhere else."""

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.places import Places
from postproc.verification.claim_test import ClaimTest
from postproc.verification.verdicts import Detectable

POWER = 0.95
BEARINGS_DEG = (0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)

_SHARES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0)
_DRAWS = 32
_NEARLY = 0.9
_BATCH = 256


def power(
    test: ClaimTest,
    positions: Places,
    p_fa: float,
    draws: int,
    rng: np.random.Generator,
    *,
    trusting: bool,
) -> tuple[FloatArray, FloatArray]:
    """Share of simulated walks in which each test rejects the claim, shape (m,) each.

    There are `draws` walks for each position (m,) of the transmitter.
    """
    each = positions.part(np.repeat(np.arange(len(positions)), draws))
    direct, indirect = [], []
    for k in range(0, len(each), _BATCH):
        level_dbm = test.walk.noise.walks(each.part(slice(k, k + _BATCH)), rng)
        direct.append(test.p_direct(level_dbm, trusting=trusting) <= p_fa)
        indirect.append(test.p_indirect(level_dbm, trusting=trusting) <= p_fa)
    found = (
        np.concatenate(one).reshape(len(positions), draws).mean(axis=1)
        for one in (direct, indirect)
    )
    return next(found), next(found)


def detectable(
    test: ClaimTest, p_fa: float, rng: np.random.Generator, *, trusting: bool
) -> list[Detectable]:
    """Detectable displacements for each of eight azimuths.

    They are tried up to 20 times the claim's distance from the walk.
    """
    middle = np.mean(test.claim, axis=1)
    radius = distance_m(test) * np.array(_SHARES)
    azimuth = np.radians(BEARINGS_DEG)
    x = middle[0] + np.outer(np.sin(azimuth), radius).ravel()
    y = middle[1] + np.outer(np.cos(azimuth), radius).ravel()
    found = (
        one.reshape(len(azimuth), len(radius))
        for one in power(test, Places.of(x, y), p_fa, _DRAWS, rng, trusting=trusting)
    )
    rows = zip(BEARINGS_DEG, *found, strict=True)
    return [_row(deg, radius, one, other) for deg, one, other in rows]


def _row(deg: float, radius: FloatArray, direct: FloatArray, indirect: FloatArray) -> Detectable:
    (direct_m, direct_blind), (indirect_m, indirect_blind) = (
        _crossing(radius, direct),
        _crossing(radius, indirect),
    )
    return Detectable(deg, direct_m, indirect_m, direct_blind, indirect_blind, float(radius[-1]))


def distance_m(test: ClaimTest) -> float:
    """The claim's distance from the walk, at least the size of a block."""
    middle, blocks = np.mean(test.claim, axis=1), test.walk.blocks
    nearest = float(np.min(blocks.places.distances_m(Places.of(*middle))))
    return max(nearest, 2.0 * blocks.size_m)


def _crossing(radius: FloatArray, share: FloatArray) -> tuple[float | None, float | None]:
    """Where the share first reaches 95 %, and where it later falls below 90 %.

    Between the radii it is interpolated by their logarithm.
    """
    reached = np.flatnonzero(share >= POWER)
    if not len(reached):
        return None, None
    k = int(reached[0])
    again = np.flatnonzero(share[k:] < _NEARLY)
    blind = float(radius[k + again[0]]) if len(again) else None
    if k == 0:
        return float(radius[0]), blind
    part = (POWER - share[k - 1]) / (share[k] - share[k - 1])
    return float(radius[k - 1] * (radius[k] / radius[k - 1]) ** part), blind
