"""The only interface to the locator under test: its input, its result, its priors."""

from dataclasses import dataclass, replace

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.pipeline import decide, locate
from logger.core.locator.region import Squares as Leaves
from logger.core.locator.region import mode_regions
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR
from logger.core.model.prior import ANTENNAS, WHITE, Hypothesis, NoiseGroup, Prior

from .answer import Answer, Mode
from .tree import region
from .world import Noise, Walk, World, observations

PRIOR = Prior()
SECTOR_PRIOR = replace(PRIOR, antenna_db=ANTENNAS["sector"])
_MODE_LEVEL = 0.999


@dataclass(frozen=True, slots=True)
class LinearPrior:
    """Normal prior of (P0 in dBm, eta): mean and precision (inverse variances), shape (2,)."""

    mean: FloatArray
    precision: FloatArray


LINEAR_PRIOR = LinearPrior(
    np.array([PRIOR.p0_dbm, PRIOR.eta]), np.array([PRIOR.p0_sigma_db**-2, PRIOR.eta_sigma**-2])
)
REACH_M = PRIOR.reach_m


def log_position_prior(nearest_m: FloatArray) -> FloatArray:
    """Log density of a place (up to a constant) by its distance from the walk, shape as given."""
    return np.asarray(-PRIOR.far_power * np.log(np.maximum(nearest_m / PRIOR.near_m, 1.0)), float)


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
    verdict_text, _, division = decide(found, obs)
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
