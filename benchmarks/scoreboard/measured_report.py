"""The measured walks as tables."""

from collections.abc import Callable, Sequence
from math import isnan
from statistics import fmean

import numpy as np

from logger.core.arrays import FloatArray

from .measured import LEVELS, WalkScore
from .strata import (
    GEOMETRIES,
    SMALL_RADIUS_M,
    Figure,
    Stratum,
    count_wrong,
    coverage,
    groups,
    log_density,
    strata,
)
from .tables import Table, three_digits

LEGEND = (
    "Each walk goes through import, smoothing of the walker, locator and verdict; 10 m are allowed "
    "for survey and receiver. Coverage: share of the walks whose region holds the truth. Errors "
    "and areas are medians. Small region: of at most the area of a circle of "
    f"{SMALL_RADIUS_M:.0f} m. Wrong: the 95 % region misses the truth. In brackets: 90 % interval, "
    "drawn by session. Log density: of the probability per km2 at the surveyed place. Classes: "
    + "; ".join(f"{geometry} {meaning}" for geometry, meaning in GEOMETRIES.items())
    + "."
)

EQUAL_COVERAGE = 0.95
"""At which areas are compared, where both trees reach it."""
_CHANGES = (
    "measured walks",
    "walks",
    "log density",
    "change",
    "coverage (95 %)",
    "area km2 at equal coverage",
    "ratio",
    "located",
)
_COVERAGE = (
    "measured walks",
    "walks",
    "sessions",
    *(f"{level:.0%} region" for level in LEVELS[:-1]),
    "coverage (95 %)",
    "area km2",
)
_TRANSMITTERS = (
    "measured walks",
    "walks",
    "transmitters",
    *(f"{level:.0%} region" for level in LEVELS),
    "log density, mean of walks",
)
_ERRORS = ("measured walks", "walks", "error m", "strongest reading m", "ratio", "r95 m")
_AREA = ("measured walks", "walks", "r95 m", "located", "coverage (95 %)", "contradicted")
_VERDICTS = ("measured walks", "small region", "located", "ambiguous", "cannot tell")


def tables(scores: Sequence[WalkScore]) -> list[Table | str]:
    """Coverage and area, errors, small regions and verdicts, and what the columns mean."""
    rows = strata(scores)
    return [
        Table(
            "measured walks: do the regions hold the truth",
            _COVERAGE,
            [_coverage_row(row) for row in rows],
        ),
        Table(
            "measured walks: do the regions hold the truth, each transmitter counting once",
            _TRANSMITTERS,
            [_transmitters_row(row) for row in rows],
        ),
        Table(
            "measured walks: error of the position shown, and of the strongest reading's place",
            _ERRORS,
            [_errors(row) for row in rows],
        ),
        Table(
            "measured walks: small regions and verdicts, and how many of them are wrong",
            _VERDICTS,
            [_verdicts(row) for row in rows],
        ),
        LEGEND,
    ]


def area_tables(everywhere: Sequence[WalkScore], within: Sequence[WalkScore]) -> list[Table | str]:
    """What an area around the walk changes where the truth is inside of it, and where it is not."""
    before = {(one.trace.campaign, one.trace.name): one for one in everywhere}
    rows = []
    for name, is_inside in (("inside", True), ("outside", False)):
        some = [one for one in within if ((one.beyond_m or 0.0) <= 0.0) == is_inside]
        if some:
            same = [before[one.trace.campaign, one.trace.name] for one in some]
            rows.append((f"truth {name}", *_area_row(same, some)))
    legend = (
        "Everywhere -> within metres of the walk's hull. Contradicted: the readings speak against "
        "the area, and the answer says so; none of these is located."
    )
    return [Table("measured walks: looked for within metres of the walk", _AREA, rows), legend]


def _area_row(before: Sequence[WalkScore], now: Sequence[WalkScore]) -> tuple[str, ...]:
    r95_m = [float(np.median([one.r95_m for one in some])) for some in (before, now)]
    located = [[one for one in some if one.verdict == "located"] for some in (before, now)]
    return (
        str(len(now)),
        " -> ".join(map(three_digits, r95_m)),
        " -> ".join(_count_text(*count_wrong(some)) for some in located),
        f"{coverage(now):.3f}",
        str(sum(one.is_contradicted for one in now)),
    )


def _coverage_row(row: Stratum) -> tuple[str, ...]:
    return (
        row.name,
        str(row.walks),
        str(row.sessions),
        *(f"{share:.2f}" for share in row.inner),
        share_text(row.coverage),
        _with_interval(row.area_km2, "{:.2g}".format),
    )


def _transmitters_row(row: Stratum) -> tuple[str, ...]:
    return (
        row.name,
        str(row.walks),
        str(row.transmitters),
        *(f"{share:.3f}" for share in row.of_transmitters),
        f"{row.log_density:.2f}",
    )


def _errors(row: Stratum) -> tuple[str, ...]:
    return (
        row.name,
        str(row.walks),
        _with_interval(row.error_m),
        three_digits(row.strongest_m),
        _with_interval(row.ratio),
        _with_interval(row.r95_m),
    )


def _verdicts(row: Stratum) -> tuple[str, ...]:
    given = (row.verdicts.get(verdict, (0, 0)) for verdict in _VERDICTS[2:])
    return (row.name, *(_count_text(*count) for count in (row.small, *given)))


def _count_text(count: int, wrong: int) -> str:
    return f"{count}, {wrong} wrong" if count else "0"


def share_text(figure: Figure) -> str:
    """A share with its interval, where it has one."""
    if isnan(figure.low):
        return f"{figure.value:.3f}"
    return f"{figure.value:.3f} ({figure.low:.2f} to {figure.high:.2f})"


def _with_interval(figure: Figure, text: Callable[[float], str] = three_digits) -> str:
    if isnan(figure.low):
        return text(figure.value)
    return f"{text(figure.value)} ({text(figure.low)} to {text(figure.high)})"


def comparison(
    scores: Sequence[WalkScore], others: Sequence[WalkScore], name: str
) -> list[Table | str]:
    """The walks of both, before (`others`) and now: log density, and areas at equal coverage."""
    before = {(one.trace.campaign, one.trace.name): one for one in others if not one.variant}
    pairs = [
        (before[key], one)
        for one in scores
        if (key := (one.trace.campaign, one.trace.name)) in before
    ]
    now = dict(groups([one for _, one in pairs]))
    changes = {}
    lines = []
    for group, some in now.items():
        if not some or group.startswith(("region", "small")):  # other walks before and now
            continue
        same = [before[one.trace.campaign, one.trace.name] for one in some]
        if group in {one.trace.campaign for one in some}:
            changes[group] = log_density(some) - log_density(same)
        lines.append((group, *_change(same, some)))
    mean = f"{fmean(changes.values()):+.2f}" if changes else "-"
    worst = min(changes, key=lambda campaign: changes[campaign], default="-")
    legend = (
        f"Log density a walk, mean over {len(changes)} campaigns: {mean}; worst in {worst}. Areas "
        "are medians, of regions of the level that reaches the coverage in brackets in each tree."
    )
    return [Table(f"measured walks against {name}: before -> now", _CHANGES, lines), legend]


def _change(before: Sequence[WalkScore], now: Sequence[WalkScore]) -> tuple[str, ...]:
    least = log_density(before), log_density(now)
    covered, area_km2, other_km2 = areas_at_equal_coverage(before, now)
    located = [[one for one in some if one.verdict == "located"] for some in (before, now)]
    return (
        str(len(now)),
        f"{least[0]:.2f} -> {least[1]:.2f}",
        f"{least[1] - least[0]:+.2f}",
        f"{coverage(before):.3f} -> {coverage(now):.3f}",
        f"{area_km2:.3g} -> {other_km2:.3g} ({covered:.2f})",
        f"{other_km2 / area_km2:.2f}",
        " -> ".join(_count_text(*count_wrong(some)) for some in located),
    )


def areas_at_equal_coverage(
    before: Sequence[WalkScore], now: Sequence[WalkScore]
) -> tuple[float, float, float]:
    """A coverage that both can reach, `EQUAL_COVERAGE` if they do, and the median areas in km2."""
    has_curve = all(one.curve_held for one in (*before, *now))
    curves = [_curve(some, has_curve=has_curve) for some in (before, now)]
    low = max(covered[0] for covered, _ in curves)
    high = min(covered[-1] for covered, _ in curves)
    at = float(np.clip(EQUAL_COVERAGE, min(low, high), high))
    one, other = (
        float(np.exp(np.interp(at, covered, log_area))) / 1e6 for covered, log_area in curves
    )
    return at, one, other


def _curve(scores: Sequence[WalkScore], *, has_curve: bool) -> tuple[FloatArray, FloatArray]:
    """Coverage and log of the median area in m2 by level; both ascend."""
    held = np.array([one.curve_held if has_curve else one.held for one in scores], float)
    area_m2 = np.array([one.curve_area_m2 if has_curve else one.area_m2 for one in scores])
    covered = np.maximum.accumulate(np.mean(held, axis=0))
    # of levels that hold equally many the first is enough: its area is the smallest
    first = np.append(True, np.diff(covered) > 0.0)
    return covered[first], np.log(np.median(area_m2, axis=0))[first]
