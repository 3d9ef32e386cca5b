"""The targets, as data, and whether they are reached.

A target is assessed by the measured value alone; the 95 % interval beside it (bootstrap over the
runs, Wilson's for a share) states the random error.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from logger.core.arrays import IntArray

from . import facts
from .cases import CLIPPED_SHARES, GPS_ERRORS
from .run import Scores
from .score import (
    EXACT,
    EXACT_CLIPPED,
    LEAST_SQUARES,
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
_Z95 = 1.96


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
class Assessment:
    """A target, what its method reaches, its 95 % interval, how many runs that took.

    `limit` is what the exact posterior reaches on the same runs, None where there is none.
    """

    target: Target
    value: float
    interval: tuple[float, float]
    runs: int
    limit: float | None

    @property
    def is_reached(self) -> bool:
        """Whether the value is within the limits."""
        return self.target.low <= self.value <= self.target.high


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
    return [
        Target(case, "coverage", _coverage, 0.92, 0.98, is_share=True),
        Target(case, "ANEES / 2", _half_anees, 0.87, 1.15),
        Target(case, "median error / exact posterior's", _error_by(EXACT), high=1.10),
        Target(case, "median error / least squares'", _error_by(LEAST_SQUARES), high=0.85),
        Target(
            case,
            "coverage, told that noise is white",
            _coverage,
            0.92,
            0.98,
            is_share=True,
            method=OURS_KNOWN_NOISE,
        ),
        Target(
            case,
            "ANEES / 2, told that noise is white",
            _half_anees,
            0.87,
            1.15,
            method=OURS_KNOWN_NOISE,
        ),
        Target(
            case,
            "median error / exact posterior's, told so",
            _error_by(EXACT),
            high=1.10,
            method=OURS_KNOWN_NOISE,
        ),
    ]


def _shadowing_targets(name: str) -> list[Target]:
    return [
        Target((name,), "coverage", _coverage, 0.90, is_share=True),
        Target((name,), "median error / exact posterior's", _error_by(EXACT), high=1.10),
        Target((name,), "area of the region / exact posterior's", _area_by_exact, high=1.5),
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


TARGETS: tuple[Target, ...] = (
    *(target for shape in TELLING for target in _white(shape)),
    *(
        target
        for name in ("shadow6-path", "shadow6-field", "shadow8-path", "shadow8-field")
        for target in _shadowing_targets(name)
    ),
    *_all_of(
        "twin-straight", facts.MIRROR_INSIDE, facts.BOTH_LISTED, facts.PAIRED, facts.NOT_ONE_PLACE
    ),
    *_all_of(
        "twin-circle", facts.MIRROR_INSIDE, facts.BOTH_LISTED, facts.PAIRED, facts.NOT_ONE_PLACE
    ),
    *(target for share in CLIPPED_SHARES for target in _censored_targets(share)),
    *_clipped_shadowed(),
    *(Target((name,), "coverage", _coverage, 0.90, is_share=True) for name in GPS_ERRORS),
    *_all_of("two-sources", facts.REPORTED_NOT_TO_FIT, facts.NOT_BETWEEN),
)


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
    interval = _wilson(value, count) if target.is_share else _bootstrap(target, table, count)
    limit = target.measure(table, EXACT, np.arange(count)) if EXACT in table else None
    return Assessment(target, value, interval, count, limit)


def _bootstrap(target: Target, table: Table, count: int) -> tuple[float, float]:
    rng = np.random.default_rng(0)
    values = [
        target.measure(table, target.method, rng.integers(count, size=count))
        for _ in range(_RESAMPLES)
    ]
    return quantile(np.array(values), 0.025), quantile(np.array(values), 0.975)


def _wilson(share: float, count: int) -> tuple[float, float]:
    """Interval of a binomial share (Wilson, JASA 22, 1927)."""
    z2 = _Z95**2
    middle = share + z2 / (2.0 * count)
    half = _Z95 * sqrt(share * (1.0 - share) / count + z2 / (4.0 * count**2))
    return (middle - half) / (1.0 + z2 / count), (middle + half) / (1.0 + z2 / count)
