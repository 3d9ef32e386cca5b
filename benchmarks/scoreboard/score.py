"""One method on one world: error, honesty, and what it claims."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import hypot, inf, nan
from time import process_time

import numpy as np

from logger.core.errors import EstimationError
from postproc.reproductions.specification_walks import median_error_m

from . import exact, ours
from .answer import Answer, Ellipse95
from .bound import covariance_bound
from .clipped import ClippedLikelihood
from .facts import facts_of
from .filters import FILTERS
from .model_free import strongest_sample, weighted_centroid
from .peers import disc_of_observables, least_squares_fit
from .world import World

OURS, OURS_KNOWN_NOISE, OURS_UNCENSORED, OURS_SECTOR = (
    "cellwalk",
    "cellwalk, kind of noise known",
    "cellwalk, unclipped",
    "cellwalk, sector antenna",
)
EXACT, BOUND = "exact posterior", "Cramer-Rao bound"
EXACT_CLIPPED = "exact posterior, clipped"
LEAST_SQUARES, CENTROID, STRONGEST = "least squares", "weighted centroid", "strongest sample"
DISC = "disc of the observables"

_DIVERGED_M = 1e6


@dataclass(frozen=True, slots=True)
class Score:
    """What a method reached in one run.

    `covered`, `area_m2`, `nees` and `places` (how many are named) are None for a method without a
    region. NEES takes the mean of the strongest mode and that mode's own covariance, so a run whose
    truth is in another mode counts in full. A failure has the error inf, and its region, had the
    method one, does not hold the truth. For the bound `error_m` is the median error of a Gaussian
    that reaches it. `r95_m` is the radius of the region about the position, `extent_m` the diagonal
    of the box around the walk.
    """

    method: str
    run: int
    error_m: float
    covered: bool | None = None
    area_m2: float | None = None
    nees: float | None = None
    places: int | None = None
    seconds: float = 0.0
    verdict: str | None = None
    failure: str | None = None
    facts: dict[str, bool] = field(default_factory=dict)
    world: str = ""
    r95_m: float | None = None
    extent_m: float = nan


def _exact(world: World) -> Answer:
    if world.noise is None:
        raise EstimationError("nobody knows the noise of a measured walk")
    return exact.answer(world.whole, world.noise)


def _ours_known_noise(world: World) -> Answer:
    if world.noise is None:
        raise EstimationError("nobody knows the noise of a measured walk")
    return ours.answer(world, world.walk, ours.known_noise_prior(world.noise))


def _exact_clipped(world: World) -> Answer:
    if world.noise is None or world.floor_dbm is None:
        raise EstimationError("nothing is clipped where the noise is known")
    return exact.posterior(ClippedLikelihood(world.walk, world.noise, world.floor_dbm))


ANSWERS: dict[str, Callable[[World], Answer]] = {
    OURS: lambda world: ours.answer(world, world.walk),
    OURS_KNOWN_NOISE: _ours_known_noise,
    OURS_UNCENSORED: lambda world: ours.answer(world, world.whole),
    OURS_SECTOR: lambda world: ours.answer(world, world.walk, ours.SECTOR_PRIOR),
    EXACT: _exact,
    EXACT_CLIPPED: _exact_clipped,
    LEAST_SQUARES: lambda world: least_squares_fit(world.walk),
    **FILTERS,
    CENTROID: lambda world: weighted_centroid(world.walk),
    STRONGEST: lambda world: strongest_sample(world.walk),
    DISC: disc_of_observables,
}
METHODS = (
    OURS,
    OURS_KNOWN_NOISE,
    OURS_UNCENSORED,
    OURS_SECTOR,
    EXACT,
    EXACT_CLIPPED,
    BOUND,
    LEAST_SQUARES,
    *FILTERS,
    CENTROID,
    STRONGEST,
    DISC,
)
WITHOUT_REGION = (CENTROID, STRONGEST)


def score(world: World, method: str, run: int) -> Score:
    """Run one method on one world; what fails is counted, not raised."""
    if method == BOUND:
        return _bound(world, run)
    start = process_time()
    try:
        with np.errstate(all="ignore"):
            found = ANSWERS[method](world)
            seconds = process_time() - start
            return _score(world, method, run, found, seconds)
    except (EstimationError, ArithmeticError, ValueError) as error:  # LinAlgError is a ValueError
        covered = None if method in WITHOUT_REGION else False
        return Score(
            method,
            run,
            inf,
            covered,
            seconds=process_time() - start,
            failure=f"{type(error).__name__}: {error}",
            world=world.name,
            extent_m=_extent_m(world),
        )


def published_scores(world: World, run: int) -> list[Score]:
    """Errors that others have reached on this world."""
    return [
        Score(method, run, error_m, world=world.name)
        for method, error_m in world.published_scores.items()
    ]


def _extent_m(world: World) -> float:
    return hypot(np.ptp(world.walk.x_m), np.ptp(world.walk.y_m))


def _score(world: World, method: str, run: int, found: Answer, seconds: float) -> Score:
    error_m = world.error_m((found.x_m, found.y_m))
    if not error_m < _DIVERGED_M:
        raise ValueError("diverged")
    region, modes = found.region, found.modes
    return Score(
        method,
        run,
        error_m,
        covered=any(region.holds(source, world.slack_m) for source in world.sources)
        if region
        else None,
        area_m2=region.area_m2 if region else None,
        nees=min(modes[0].nees(source) for source in world.sources) if modes else None,
        places=len(modes) or None,
        seconds=seconds,
        verdict=found.verdict,
        facts=facts_of(world, found),
        world=world.name,
        r95_m=region.radius_m((found.x_m, found.y_m)) if region else None,
        extent_m=_extent_m(world),
    )


def _bound(world: World, run: int) -> Score:
    if world.noise is None or world.eta is None:
        raise ValueError("no bound without a known world")
    covariance_db2 = world.noise.covariance_db2(world.whole.x_m, world.whole.y_m)
    precision = ours.LINEAR_PRIOR.precision
    bound = covariance_bound(world.whole, world.sources[0], world.eta, covariance_db2, precision)[
        :2, :2
    ]
    return Score(
        BOUND, run, median_error_m(bound), area_m2=Ellipse95(world.sources[0], bound).area_m2
    )
