"""The measured walks as tables."""

from collections.abc import Callable, Sequence
from math import isnan

from .measured import LEVELS, WalkScore
from .strata import GEOMETRIES, SMALL_RADIUS_M, Figure, Stratum, strata
from .tables import Table, three_digits

LEGEND = (
    "Each walk goes through import, smoothing of the walker, locator and verdict; 10 m are allowed "
    "for survey and receiver. Coverage: share of the walks whose region holds the truth. Errors "
    "and areas are medians. Small region: of at most the area of a circle of "
    f"{SMALL_RADIUS_M:.0f} m. Wrong: the 95 % region misses the truth. In brackets: 90 % interval, "
    "drawn by session. Classes: "
    + "; ".join(f"{geometry} {meaning}" for geometry, meaning in GEOMETRIES.items())
    + "."
)

_COVERAGE = (
    "measured walks",
    "walks",
    "sessions",
    *(f"{level:.0%} region" for level in LEVELS[:-1]),
    "coverage (95 %)",
    "area km2",
)
_ERRORS = ("measured walks", "walks", "error m", "strongest reading m", "ratio")
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


def _coverage_row(row: Stratum) -> tuple[str, ...]:
    return (
        row.name,
        str(row.walks),
        str(row.sessions),
        *(f"{share:.2f}" for share in row.inner),
        share_text(row.coverage),
        _with_interval(row.area_km2, "{:.2g}".format),
    )


def _errors(row: Stratum) -> tuple[str, ...]:
    return (
        row.name,
        str(row.walks),
        _with_interval(row.error_m),
        three_digits(row.strongest_m),
        _with_interval(row.ratio),
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
