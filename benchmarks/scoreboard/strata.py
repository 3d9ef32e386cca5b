"""The measured walks by geometry, distance and area: coverage, errors and what is called located.

Walks of one session share a receiver, a track or a transmitter. The intervals therefore are those
of a bootstrap that draws sessions, not walks (Davison & Hinkley, Bootstrap Methods, 1997, 3.8).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import inf, nan

import numpy as np

from .measured import LEVELS, WalkScore

SMALL_RADIUS_M = 150.0
"""Regions of at most this radius are small enough to go there."""
PASSES_M = (0.0, 50.0, 200.0, 800.0, 1200.0, inf)
BEYOND_M = (500.0, 800.0)
AREAS_KM2 = (0.0, 0.01, 0.1, 1.0, 10.0, inf)
GEOMETRIES = {
    "A": "passes within 50 m and sees 120 deg of azimuth",
    "B": "passes within 50 m, narrower",
    "C": "never within 50 m, sees 180 deg",
    "D": "never within 50 m, sees 90 to 180 deg",
    "E": "never within 50 m, one-sided",
}

_RESAMPLES = 1000
_INTERVAL = (5.0, 95.0)
_KM2 = 1e6

Statistic = Callable[[Sequence[WalkScore]], float]


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure with its 90 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Stratum:
    """Some of the measured walks.

    `inner` is the coverage of the smaller regions; `of_transmitters` that of all regions where each
    of the `transmitters` counts once, however many walks pass it. `log_density` is a mean. Errors,
    areas and radii are medians; `ratio` is the error by that of the strongest reading's place.
    `small` counts the regions with a radius of at most `SMALL_RADIUS_M` and those of them that miss
    the truth, `verdicts` the same by verdict.
    """

    name: str
    walks: int
    sessions: int
    coverage: Figure
    inner: tuple[float, ...]
    transmitters: int
    of_transmitters: tuple[float, ...]
    log_density: float
    area_km2: Figure
    error_m: Figure
    strongest_m: float
    ratio: Figure
    r95_m: Figure
    small: tuple[int, int]
    verdicts: dict[str, tuple[int, int]]


def strata(scores: Sequence[WalkScore]) -> list[Stratum]:
    """All walks, by geometry, closest pass, area of the region and data set."""
    return [_stratum(name, some) for name, some in groups(scores) if some]


def groups(scores: Sequence[WalkScore]) -> Iterator[tuple[str, list[WalkScore]]]:
    """The groups with their names; some may be empty."""
    yield "all", list(scores)
    for geometry in (*GEOMETRIES, "CDE"):
        name = "C to E" if geometry == "CDE" else geometry
        yield f"class {name}", [one for one in scores if one.trace.geometry in geometry]
    yield from _by_bin("closest pass", scores, lambda one: one.trace.closest_m, PASSES_M, "m")
    for beyond_m in BEYOND_M:
        far = [one for one in scores if one.trace.closest_m > beyond_m]
        yield f"truth beyond {beyond_m:g} m", far
    yield "may be distant", [one for one in scores if one.may_be_distant]
    yield "is not distant", [one for one in scores if not one.may_be_distant]
    yield from _by_bin("region", scores, lambda one: one.area_m2[-1] / _KM2, AREAS_KM2, "km2")
    yield "small region", small(scores)
    for campaign in dict.fromkeys(one.trace.campaign for one in scores):
        yield campaign, [one for one in scores if one.trace.campaign == campaign]


def _by_bin(
    what: str,
    scores: Sequence[WalkScore],
    value: Callable[[WalkScore], float],
    edges: Sequence[float],
    unit: str,
) -> Iterator[tuple[str, list[WalkScore]]]:
    for low, high in pairwise(edges):
        if low == 0.0:
            limits = f"< {high:g}"
        else:
            limits = f"> {low:g}" if high == inf else f"{low:g} to {high:g}"
        yield f"{what} {limits} {unit}", [one for one in scores if low <= value(one) < high]


def held_share(scores: Sequence[WalkScore], *, level: int) -> float:
    """Share of the walks whose region of a level of `LEVELS`, by its number, holds the truth."""
    return float(np.mean([one.held[level] for one in scores]))


def log_density(scores: Sequence[WalkScore]) -> float:
    """Mean log of the probability per km2 at the surveyed place."""
    return float(np.mean([one.log_density for one in scores]))


def by_transmitter(scores: Sequence[WalkScore]) -> list[list[WalkScore]]:
    """The walks past each transmitter."""
    found: dict[tuple[str, str], list[WalkScore]] = {}
    for one in scores:
        found.setdefault((one.trace.campaign, one.trace.transmitter), []).append(one)
    return list(found.values())


def over_transmitters(scores: Sequence[WalkScore], statistic: Statistic) -> float:
    """Mean of a statistic over the transmitters, of which each counts once."""
    return float(np.mean([statistic(some) for some in by_transmitter(scores)]))


def coverage(scores: Sequence[WalkScore]) -> float:
    """Share of the walks whose 95 % region holds the truth."""
    return float(np.mean([one.is_covered for one in scores]))


def wrong(scores: Sequence[WalkScore]) -> float:
    """Share of the walks whose 95 % region misses the truth."""
    return 1.0 - coverage(scores)


def error_ratio(scores: Sequence[WalkScore]) -> float:
    """Median error by the median error of the strongest reading's place."""
    return _median(scores, "error_m") / _median(scores, "strongest_m")


def count_wrong(scores: Sequence[WalkScore]) -> tuple[int, int]:
    """Number of walks, and of those whose 95 % region misses the truth."""
    return len(scores), sum(not one.is_covered for one in scores)


def small(scores: Sequence[WalkScore]) -> list[WalkScore]:
    """Those with a small region."""
    return [one for one in scores if one.radius_m <= SMALL_RADIUS_M]


def _stratum(name: str, scores: Sequence[WalkScore]) -> Stratum:
    verdicts = {one.verdict for one in scores}
    return Stratum(
        name,
        walks=len(scores),
        sessions=len({one.trace.session for one in scores}),
        coverage=figure_of(scores, coverage),
        inner=tuple(held_share(scores, level=k) for k in range(len(LEVELS) - 1)),
        transmitters=len(by_transmitter(scores)),
        of_transmitters=tuple(
            over_transmitters(scores, partial(held_share, level=k)) for k in range(len(LEVELS))
        ),
        log_density=log_density(scores),
        area_km2=figure_of(
            scores, lambda some: float(np.median([one.area_m2[-1] for one in some])) / _KM2
        ),
        error_m=figure_of(scores, lambda some: _median(some, "error_m")),
        strongest_m=_median(scores, "strongest_m"),
        ratio=figure_of(scores, error_ratio),
        r95_m=figure_of(scores, lambda some: _median(some, "r95_m")),
        small=count_wrong(small(scores)),
        verdicts={
            verdict: count_wrong([one for one in scores if one.verdict == verdict])
            for verdict in sorted(verdicts)
        },
    )


def figure_of(scores: Sequence[WalkScore], statistic: Statistic) -> Figure:
    """A statistic with its interval."""
    return Figure(statistic(scores), *interval(scores, statistic))


def interval(scores: Sequence[WalkScore], statistic: Statistic) -> tuple[float, float]:
    """90 % interval of a statistic; not a number where there is one session only."""
    by_session: dict[str, list[WalkScore]] = {}
    for one in scores:
        by_session.setdefault(one.trace.session, []).append(one)
    sessions = list(by_session.values())
    if len(sessions) < 2:
        return nan, nan
    rng = np.random.default_rng(0)
    draws = rng.integers(len(sessions), size=(_RESAMPLES, len(sessions)))
    values = [statistic([one for k in draw for one in sessions[k]]) for draw in draws]
    low, high = np.percentile(values, _INTERVAL)
    return float(low), float(high)


def _median(scores: Sequence[WalkScore], name: str) -> float:
    return float(np.median([getattr(one, name) for one in scores]))
