"""The only interface to the locator under test: its input, its result, its priors."""

from dataclasses import dataclass, replace
from math import log

import numpy as np
import shapely

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.pipeline import decide, locate
from logger.core.locator.region import Squares as Leaves
from logger.core.locator.region import mode_regions
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR
from logger.core.model.prior import WHITE, Hypothesis, NoiseGroup, Prior, prior_for

from .answer import Answer, Mode
from .tree import region
from .world import Noise, Walk, World, observations

PRIOR = Prior()
SECTOR_PRIOR = prior_for("any", antenna="sector")
_MODE_LEVEL = 0.999
_REACH_NODES = 32


@dataclass(frozen=True, slots=True)
class LinearPrior:
    """Normal prior of (P0 in dBm, eta): mean and precision (inverse variances), shape (2,)."""

    mean: FloatArray
    precision: FloatArray


LINEAR_PRIOR = LinearPrior(
    np.array([PRIOR.p0_dbm, PRIOR.eta]), np.array([PRIOR.p0_sigma_db**-2, PRIOR.eta_sigma**-2])
)
REACH_M = PRIOR.reach_m


def log_reach_odds(walk: Walk) -> FloatArray:
    """Log of each reach's probability over its integral in the plane, shape (r,).

    The density t of a reach with power p is exceeded within flat_m t^(-1 / p) of the walk. Its
    integral is that of these areas over t from 0 to 1; with t = s^12 it has no pole.
    """
    line = shapely.LineString(np.column_stack([walk.x_m, walk.y_m]))
    nodes, weights = np.polynomial.legendre.leggauss(_REACH_NODES)
    s = 0.5 * (nodes + 1.0)
    found = []
    for one in PRIOR.reaches:
        area_m2 = shapely.area(shapely.buffer(line, one.flat_m * s ** (-12.0 / one.power)))
        found.append(log(one.probability) - log(weights @ (6.0 * s**11 * area_m2)))
    return np.array(found)


def log_position_prior(nearest_m: FloatArray, log_odds: FloatArray) -> FloatArray:
    """Log density of a place by its distance from the walk, of which `log_odds` (r,) are known."""
    each = [
        odds - one.power * np.log(np.maximum(nearest_m / one.flat_m, 1.0))
        for one, odds in zip(PRIOR.reaches, log_odds, strict=True)
    ]
    return np.asarray(np.logaddexp.reduce(each), float)


def known_noise_prior(noise: Noise) -> Prior:
    """Prior for a known kind of noise, white or with a decorrelation distance.

    The strength of the noise is unknown.
    """
    if noise.shadow_db == 0.0:
        return replace(PRIOR, noise=(NoiseGroup(1.0, (WHITE,)),))
    white_share = noise.white_db**2 / (noise.white_db**2 + noise.shadow_db**2)
    known = Hypothesis(white_share, noise.decorrelation_m)
    return replace(PRIOR, noise=(NoiseGroup(1.0, (known,)),))


def answer(world: World, walk: Walk, prior: Prior = PRIOR) -> Answer:
    """The locator's answer for a walk; raises `EstimationError`."""
    obs = observations(world, walk)
    found = locate(obs, prior)
    verdict_text, _, division, _ = decide(found, obs)
    return Answer(
        x_m=found.x_m,
        y_m=found.y_m,
        modes=tuple(Mode(m.x_m, m.y_m, m.covariance[:2, :2], m.probability) for m in found.modes),
        region=region(found),
        verdict=verdict_text,
        fits=division is None or division.log_factor <= LEAST_LOG_FACTOR,
    )


def split_into_places(
    x_m: FloatArray, y_m: FloatArray, size_m: FloatArray, probability: FloatArray
) -> list[IntArray]:
    """Indices of the cells of each place: the limit tells places apart by the same rule."""
    return mode_regions(Leaves(x_m, y_m, size_m, probability), _MODE_LEVEL)
