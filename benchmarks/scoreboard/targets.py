"""The targets, as data, and whether they are reached.

A target is assessed by the measured value alone; the interval beside it states the random error:
of simulated walks 95 % (bootstrap over the runs, Wilson's for a share), of measured ones 90 %,
drawn by session.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isnan, nan

import numpy as np
from scipy.stats import binomtest

from logger.core.arrays import IntArray

from . import facts, strata
from .cases import CLIPPED_SHARES, GPS_ERRORS, SPECIFIED_READINGS
from .measured import WalkScore
from .run import Scores
from .score import (
    EXACT,
    EXACT_CLIPPED,
    OURS,
    OURS_KNOWN_NOISE,
    OURS_UNCENSORED,
    Score,
)
from .summary import Columns, half_anees, quantile
from .walks import TELLING

Table = Mapping[str, Columns]
"""Scores of a case by method."""
Measure = Callable[[Table, str, IntArray], float]
"""A figure of one method over some runs of a case; the runs are given by their indices."""

_RESAMPLES = 1000


@dataclass(frozen=True, slots=True)
class Target:
    """A figure of a method that has to be within limits, over all runs of some cases together."""

    cases: tuple[str, ...]
    what: str
    measure: Measure
    low: float = -inf
    high: float = inf
    is_share: bool = False
    method: str = OURS


@dataclass(frozen=True, slots=True)
class MeasuredTarget:
    """A figure of some of the measured walks, by the name of their group in `strata`."""

    group: str
    what: str
    measure: Callable[[Sequence[WalkScore]], float]
    low: float = -inf
    high: float = inf


@dataclass(frozen=True, slots=True)
class Assessment:
    """A target on some walks, the value reached, its interval, and the number of walks.

    `limit` is what the exact posterior reaches on the same runs, None where there is none.
    """

    walks: str
    what: str
    low: float
    high: float
    value: float
    interval: tuple[float, float]
    runs: int
    limit: float | None = None

    @property
    def is_reached(self) -> bool:
        """Whether the value is within the limits."""
        return self.low <= self.value <= self.high


def _coverage(table: Table, method: str, runs: IntArray) -> float:
    return float(np.mean(table[method].covered[runs]))


def _half_anees(table: Table, method: str, runs: IntArray) -> float:
    found = half_anees(table[method].nees[runs])
    return inf if found is None else found


def _error_by(*others: str) -> Measure:
    """Median error by that of the best of some methods."""

    def measure(table: Table, method: str, runs: IntArray) -> float:
        best = min(_median_error_m(table[other], runs) for other in others)
        return _median_error_m(table[method], runs) / best

    return measure


def _median_error_m(columns: Columns, runs: IntArray) -> float:
    return float(np.median(columns.error_m[runs]))


def _area_by_exact(table: Table, method: str, runs: IntArray) -> float:
    return float(np.nanmedian(table[method].area_m2[runs] / table[EXACT].area_m2[runs]))


def _share(fact: str) -> Measure:
    def measure(table: Table, method: str, runs: IntArray) -> float:
        return float(np.mean(table[method].facts[fact][runs]))

    return measure


def _white(shape: str) -> list[Target]:
    case = (f"white-{shape}",)
    known_noise = OURS_KNOWN_NOISE
    return [
        Target(case, "coverage", _coverage, 0.92, 0.98, is_share=True),
        Target(case, "ANEES / 2", _half_anees, 0.87, 1.15),
        Target(
            case,
            "coverage, white noise known",
            _coverage,
            0.92,
            0.98,
            True,
            method=known_noise,
        ),
        Target(case, "ANEES / 2, white noise known", _half_anees, 0.87, 1.15, method=known_noise),
    ]


def _simulated_aims() -> list[Target]:
    white = tuple(f"white-{shape}" for shape in TELLING)
    shadow6, shadow8 = (tuple(f"shadow{s}-{kind}" for kind in ("path", "field")) for s in (6, 8))
    error, area = "median error / exact posterior's", "area of the region / exact posterior's"
    return [
        Target(white, error, _error_by(EXACT), high=1.05),
        Target(white, area, _area_by_exact, high=1.3),
        Target(shadow6, "coverage", _coverage, 0.93, is_share=True),
        Target(shadow6, area, _area_by_exact, high=4.0),
        Target(shadow8, "coverage", _coverage, 0.93, is_share=True),
        Target(("two-scale",), "coverage", _coverage, 0.93, 0.98, is_share=True),
        Target(("two-scale",), area, _area_by_exact, high=1.5),
        *(
            Target((case,), facts.BOTH_LISTED, _share(facts.BOTH_LISTED), 0.99, is_share=True)
            for case in ("twin-straight", "twin-circle")
        ),
        Target(
            (f"spec-{SPECIFIED_READINGS[-1]}-around",), "coverage", _coverage, 0.9, is_share=True
        ),
    ]


def _measured_aims() -> list[MeasuredTarget]:
    areas = [name for name, _ in strata.groups(()) if name.startswith("region")]
    return [
        MeasuredTarget("all", "coverage", strata.coverage, 0.93),
        MeasuredTarget("class C to E", "coverage", strata.coverage, 0.92),
        MeasuredTarget("class D", "coverage", strata.coverage, 0.92),
        *(MeasuredTarget(name, "coverage", strata.coverage, 0.89) for name in areas),
        MeasuredTarget("small region", "share of wrong regions", strata.wrong, high=0.05),
        MeasuredTarget(
            "class A", "median error / strongest reading's", strata.error_ratio, high=1.0
        ),
    ]


def _all_of(case: str, *names: str) -> list[Target]:
    return [Target((case,), name, _share(name), 1.0, is_share=True) for name in names]


def _censored_targets(share: float) -> list[Target]:
    case = (f"clip-{100 * share:.0f}",)
    return [
        Target(case, "coverage", _coverage, 0.90, is_share=True),
        Target(
            case,
            "median error / exact posterior's, levels not clipped",
            _error_by(EXACT),
            high=1.15,
        ),
        Target(
            case,
            "median error / exact posterior's, levels clipped",
            _error_by(EXACT_CLIPPED),
            high=1.15,
        ),
        Target(
            case,
            "median error / cellwalk's own, levels not clipped",
            _error_by(OURS_UNCENSORED),
            high=1.15,
        ),
    ]


def _clipped_shadowed() -> list[Target]:
    case = ("clip-45-shadow",)
    return [
        Target(case, "coverage", _coverage, 0.90, is_share=True),
        Target(
            case,
            "median error / cellwalk's own, levels not clipped",
            _error_by(OURS_UNCENSORED),
            high=1.15,
        ),
    ]


MEASURED_TARGETS: tuple[MeasuredTarget, ...] = tuple(_measured_aims())
TARGETS: tuple[Target, ...] = (
    *_simulated_aims(),
    *(target for shape in TELLING for target in _white(shape)),
    *_all_of("twin-straight", facts.MIRROR_INSIDE, facts.PAIRED, facts.NOT_ONE_PLACE),
    *_all_of("twin-circle", facts.MIRROR_INSIDE, facts.PAIRED, facts.NOT_ONE_PLACE),
    *(target for share in CLIPPED_SHARES for target in _censored_targets(share)),
    *_clipped_shadowed(),
    *(Target((name,), "coverage", _coverage, 0.90, is_share=True) for name in GPS_ERRORS),
    *_all_of("two-sources", facts.REPORTED_NOT_TO_FIT, facts.NOT_BETWEEN),
)


def assess_measured(scores: Sequence[WalkScore]) -> list[Assessment]:
    """The targets of measured walks, but for those whose group is empty."""
    found = dict(strata.groups(scores))
    return [
        Assessment(
            f"measured, {target.group}",
            target.what,
            target.low,
            target.high,
            target.measure(some),
            strata.interval(some, target.measure),
            len(some),
        )
        for target in MEASURED_TARGETS
        if (some := found[target.group])
    ]


def assess(found: Mapping[str, Scores], targets: Sequence[Target] = TARGETS) -> list[Assessment]:
    """Those targets whose cases were run with all methods they need."""
    results = []
    for target in targets:
        if not all(case in found for case in target.cases):
            continue
        try:
            results.append(_assess(target, _together([found[case] for case in target.cases])))
        except KeyError:  # a method that was left out
            continue
    return results


def _together(parts: Sequence[Scores]) -> Table:
    methods = set.intersection(*(set(part) for part in parts))
    return {method: Columns.of(_concatenate(parts, method)) for method in methods}


def _concatenate(parts: Sequence[Scores], method: str) -> list[Score]:
    return [score for part in parts for score in part[method]]


def _assess(target: Target, table: Table) -> Assessment:
    count = len(table[target.method].error_m)
    value = target.measure(table, target.method, np.arange(count))
    interval = nan, nan
    if target.is_share and not isnan(value):
        interval = binomtest(round(value * count), count).proportion_ci(method="wilson")
    elif not target.is_share:
        interval = _bootstrap(target, table, count)
    limit = target.measure(table, EXACT, np.arange(count)) if EXACT in table else None
    walks = ", ".join(target.cases)
    return Assessment(walks, target.what, target.low, target.high, value, interval, count, limit)


def _bootstrap(target: Target, table: Table, count: int) -> tuple[float, float]:
    rng = np.random.default_rng(0)
    values = [
        target.measure(table, target.method, rng.integers(count, size=count))
        for _ in range(_RESAMPLES)
    ]
    return quantile(np.array(values), 0.025), quantile(np.array(values), 0.975)
