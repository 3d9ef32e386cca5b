"""Whether an identity is heard from one place or from two: the signature of a cloned cell.

Of one run the locator's own finding is used (`logger.core.locator.two_source_test`): the walk
divided in two, each part located alone. Of two runs each is located alone, and both together; with
p the evidence of a run over places h of prior mass m,

    log factor = log sum_h m p1(h) + log sum_h m p2(h) - log sum_h m p1(h) p2(h)

Both run through the same calibration: walks past one transmitter, drawn from what was found, with
the noise of the walk, and the share of them whose factor is as large. Draws end early when several
were (Besag & Clifford, Biometrika 78(2), 1991).
"""

from dataclasses import dataclass, replace

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.geo import Utm
from logger.core.locator.mixture import log_sum
from logger.core.locator.posterior import Posterior
from logger.core.locator.two_source_test import divide
from logger.core.model.noise import correlation, independent_variance
from logger.core.model.path_loss import level_dbm, log_distance_db
from logger.core.observations import CellObservations
from postproc.verification.bootstrap import calibrated
from postproc.verification.claim_test import Listened
from postproc.verification.likelihood_grid import LikelihoodGrid, refined

DRAWS = 39
"""Past one transmitter, for one run: p can then be as small as 0.025."""

_ENOUGH = 4
_PAIRS = 240
_MOST_READINGS = 800
_MOST_SQUARES = 1400


@dataclass(frozen=True, slots=True)
class Sites:
    """Log Bayes factor of two places against one, with the chance of one as large where there is
    one transmitter.

    `one_m, other_m` are the likeliest places, x and y.
    """

    log_factor: float
    p: float
    draws: int
    one_m: tuple[float, float]
    other_m: tuple[float, float]
    utm: Utm

    @property
    def places_deg(self) -> list[tuple[float, float]]:
        """Latitude and longitude of both."""
        return [self.utm.to_latlon(*self.one_m), self.utm.to_latlon(*self.other_m)]


def within_one(
    obs: CellObservations, posterior: Posterior, rng: np.random.Generator, draws: int = DRAWS
) -> Sites | None:
    """One run; None where one place leaves nothing to explain, or the walk has no two loud
    places.
    """
    found = divide(obs, posterior)
    if found is None:
        return None
    if found.log_factor <= 0.0:
        return Sites(found.log_factor, 1.0, 0, found.one_m, found.other_m, obs.utm)
    walk = _fewer(obs.usable().part(obs.usable().limit == 0))
    one_place = _Past(walk, posterior)
    as_large = done = 0
    while done < draws and as_large < _ENOUGH:
        drawn = divide(one_place.drawn(rng), posterior)
        as_large += drawn is not None and drawn.log_factor >= found.log_factor
        done += 1
    p = as_large / done if as_large >= _ENOUGH else (as_large + 1.0) / (done + 1.0)
    return Sites(found.log_factor, p, done, found.one_m, found.other_m, obs.utm)


class _Past:
    """Walks past the one transmitter that the posterior names."""

    def __init__(self, obs: CellObservations, posterior: Posterior) -> None:
        best, prior = posterior.modes[0], posterior.prior
        self.obs = obs
        dx_m, dy_m = obs.x_m - best.x_m, obs.y_m - best.y_m
        distance_db = log_distance_db(dx_m, dy_m, prior.height_m, obs.position_sigma_m)
        self.level_dbm = level_dbm(best.state[2], best.state[3], distance_db)
        apart_m = np.hypot(obs.x_m[:, None] - obs.x_m, obs.y_m[:, None] - obs.y_m)
        white = posterior.white_share
        k = (1.0 - white) * correlation(apart_m, posterior.decorrelation_m)
        k[np.diag_indices_from(k)] += independent_variance(1.0, white, posterior.sigma_db)
        self.root = posterior.sigma_db * np.linalg.cholesky(k)

    def drawn(self, rng: np.random.Generator) -> CellObservations:
        drawn_dbm = self.level_dbm + self.root @ rng.normal(size=len(self.obs))
        return replace(self.obs, level_dbm=drawn_dbm, known_limit=np.zeros(len(self.obs), np.int64))


def _fewer(obs: CellObservations) -> CellObservations:
    """Every second or third reading of a long walk: a covariance of thousands of readings costs
    minutes.
    """
    step = -(-len(obs) // _MOST_READINGS)
    return obs.part(slice(None, None, step)) if step > 1 else obs


def between_two(one: Listened, other: Listened, utm: Utm, rng: np.random.Generator) -> Sites:
    """Two runs in the same zone."""
    field = one.field.with_walk(other.blocks, other.field.whiteners)
    fine = refined(field, other.level_dbm[:, None], _MOST_SQUARES)
    fields = one.field.with_squares(fine.squares), fine
    levels = one.level_dbm, other.level_dbm
    logs = [_over_places(f, v[:, None], f.trust)[:, 0] for f, v in zip(fields, levels, strict=True)]
    log_mass = fine.log_mass - log_sum(fine.log_mass)
    joint = log_mass + logs[0] + logs[1]
    p = np.exp(joint - log_sum(joint))
    at = rng.choice(len(p), _PAIRS, p=p / np.sum(p))
    x, y = fine.squares[0, at], fine.squares[1, at]
    drawn = [
        _over_places(f, walk.noise.walks(x, y, rng), np.ones(len(f.whiteners)))
        for f, walk in zip(fields, (one, other), strict=True)
    ]
    calm = np.sort(np.exp(-_factor(drawn[0], drawn[1], log_mass)))
    factor = float(_factor(logs[0][:, None], logs[1][:, None], log_mass)[0])
    chance = float(calibrated(calm, np.exp(-np.array([factor])))[0])
    places = [fine.squares[:2, int(np.argmax(log + log_mass))].tolist() for log in logs]
    return Sites(factor, chance, _PAIRS, tuple(places[0]), tuple(places[1]), utm)


def _factor(one: FloatArray, other: FloatArray, log_mass: FloatArray) -> FloatArray:
    """Log factor for walks (h, b), shape (b,)."""
    apart = log_sum((log_mass[:, None] + one).T) + log_sum((log_mass[:, None] + other).T)
    return np.asarray(apart - log_sum((log_mass[:, None] + one + other).T), float)


def _over_places(field: LikelihoodGrid, level_dbm: FloatArray, trust: FloatArray) -> FloatArray:
    """Log evidence of walks (n, b) at places, each hypothesis tempered and then mixed: (h, b)."""
    log_p, _ = field.evaluate(level_dbm)
    log_mass = (field.log_mass - log_sum(field.log_mass))[:, None]
    tempered = trust[:, None, None] * log_p
    norm = log_sum(np.swapaxes(tempered + log_mass, 1, 2))[:, None]
    log_weight = np.log(np.maximum(field.weights(log_p), 1e-300))[:, None]
    return log_sum(np.moveaxis(tempered - norm + log_weight, 0, 2))
