"""One measured walk through the whole path: what the locator states, and whether that is true."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import hypot, log, pi, sqrt
from multiprocessing import Pool
from pathlib import Path
from time import process_time

import numpy as np
from threadpoolctl import threadpool_limits

from . import traces, tree
from .model_free import strongest_sample
from .traces import SURVEY_SLACK_M, Trace
from .tree import Prior
from .world import Place, Walk

LEVELS = (0.5, 0.8, 0.95)
"""Of the regions; the last is the one that is shown."""
CURVE = (0.3, 0.5, 0.65, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995)
"""Of the regions by which two trees are compared at equal coverage."""
VARIANTS: Mapping[str, Prior] = {"": Prior()}
"""The locator as it is."""

_PER_KM2 = 1e6
_LEAST_DENSITY = 1e-12
"""Probability per square metre beyond the reach of the prior: of one in a million square km."""
_RINGS = 5
"""Circles of points on which the density around the surveyed place is averaged."""
_ROUND = 12


@dataclass(frozen=True, slots=True)
class WalkScore:
    """What the locator states of one measured walk.

    `error_m` is that of the position shown, `strongest_m` that of the strongest reading's place.
    `held` tells for each of `LEVELS` whether the region holds the truth, `area_m2` its area;
    `curve_held` and `curve_area_m2` are the same for `CURVE`, empty where they were not kept.
    `log_density` is the log of the mean probability per km2 within the error of the survey.
    `variant` names the prior that was used. Where it has an area, `beyond_m` is how far outside of
    it the truth stands, negative inside, and `is_contradicted` whether the readings contradict it.
    `may_be_distant` is the posterior's.
    """

    trace: Trace
    variant: str
    readings: int
    error_m: float
    strongest_m: float
    held: tuple[bool, ...]
    area_m2: tuple[float, ...]
    r95_m: float
    log_density: float
    verdict: str
    seconds: float
    curve_held: tuple[bool, ...] = ()
    curve_area_m2: tuple[float, ...] = ()
    beyond_m: float | None = None
    is_contradicted: bool = False
    may_be_distant: bool = False

    @property
    def is_covered(self) -> bool:
        """Whether the 95 % region holds the truth."""
        return self.held[-1]

    @property
    def radius_m(self) -> float:
        """Radius of a circle with the area of the 95 % region."""
        return sqrt(self.area_m2[-1] / pi)


def score_walk(
    trace: Trace, variants: Mapping[str, Prior] = VARIANTS, *, decide: bool = True
) -> list[WalkScore]:
    """Scores of one walk, one for each prior, with a verdict or without; on one core."""
    with threadpool_limits(1):
        obs, source = traces.observe(trace.campaign, trace.name)
        usable = obs.usable()
        strongest = strongest_sample(Walk(usable.x_m, usable.y_m, usable.level_dbm))
        away_m = _off_m((strongest.x_m, strongest.y_m), source)
        return [
            _score(trace, name, usable, prior, source, away_m, decide=decide)
            for name, prior in variants.items()
        ]


def _score(
    trace: Trace,
    variant: str,
    obs: tree.Readings,
    prior: Prior,
    source: Place,
    strongest_m: float,
    *,
    decide: bool,
) -> WalkScore:
    start = process_time()
    posterior = tree.locate(obs, prior)
    verdict, reasons = tree.decide(posterior, obs)[:2] if decide else ("", [])
    seconds = process_time() - start
    regions = [tree.region(posterior, level) for level in LEVELS]
    curve = [tree.region(posterior, level) for level in CURVE]
    density = max(float(np.mean(tree.density(posterior, *_around(source)))), _LEAST_DENSITY)
    return WalkScore(
        trace,
        variant,
        readings=len(obs),
        error_m=_off_m((posterior.x_m, posterior.y_m), source),
        strongest_m=strongest_m,
        held=tuple(region.holds(source, SURVEY_SLACK_M) for region in regions),
        area_m2=tuple(region.area_m2 for region in regions),
        r95_m=float(posterior.r95_m),
        log_density=log(density * _PER_KM2),
        verdict=verdict,
        seconds=seconds,
        curve_held=tuple(region.holds(source, SURVEY_SLACK_M) for region in curve),
        curve_area_m2=tuple(region.area_m2 for region in curve),
        beyond_m=_beyond_m(posterior, source),
        is_contradicted=any("contradict the area" in reason for reason in reasons),
        may_be_distant=getattr(posterior, "may_be_distant", False),
    )


def prior_within(metres: float) -> Prior:
    """The default prior within some metres of the hull of the walk."""
    from logger.core.model.area import Area  # noqa: PLC0415 (earlier trees have none)

    return replace(Prior(), area=Area.within_walk(metres))


def _beyond_m(posterior: tree.Posterior, source: Place) -> float | None:
    area = getattr(posterior.prior, "area", None)
    if area is None:
        return None
    from logger.core.places import Places  # noqa: PLC0415 (earlier trees have none)

    return float(area.beyond_m(Places.of(*source))[0])


def _off_m(one: Place, other: Place) -> float:
    return hypot(one[0] - other[0], one[1] - other[1])


def _around(place: Place) -> tuple[np.ndarray, np.ndarray]:
    """Points that fill the circle of the survey's error evenly."""
    radius_m = SURVEY_SLACK_M * np.sqrt((np.arange(_RINGS) + 0.5) / _RINGS)
    angle = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    x_m = place[0] + np.outer(radius_m, np.cos(angle)).ravel()
    return x_m, place[1] + np.outer(radius_m, np.sin(angle)).ravel()


def score_walks(
    chosen: Sequence[Trace],
    processes: int,
    variants: Mapping[str, Prior] = VARIANTS,
    on_done: Callable[[], None] = lambda: None,
    *,
    decide: bool = True,
) -> list[WalkScore]:
    """Scores of several walks in their order; `on_done` is called after each walk."""
    found: list[WalkScore] = []
    if not chosen:
        return found
    with Pool(processes) as pool:
        for scores in pool.imap(partial(score_walk, variants=variants, decide=decide), chosen):
            found += scores
            on_done()
    return found


def read_scores(file: Path) -> list[WalkScore]:
    """The scores that `--json` wrote."""
    known = {(one.campaign, one.name): one for one in traces.traces()}
    found = []
    for values in json.loads(file.read_text()):
        trace = Trace(*values.pop("trace"))
        lists = {name: tuple(v) for name, v in values.items() if isinstance(v, list)}
        same = known.get((trace.campaign, trace.name), trace)
        found.append(WalkScore(same, **(values | lists)))
    return found
