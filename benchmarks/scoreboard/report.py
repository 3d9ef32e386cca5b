"""The scoreboard as tables for the terminal, Markdown and JSON."""

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from math import isfinite

from rich.console import Console
from rich.table import Table

from .cases import CASES
from .claims import Claim, claims
from .run import Scores
from .score import BOUND, EXACT, LEAST_SQUARES, OURS
from .summary import Given, Row, rows_of, verdicts_of
from .targets import Assessment, assess

MOST_NAMED = 12
PACKAGES = ("cellwalk", "numpy", "scipy", "filterpy", "shapely")
HEADINGS = (
    *("method", "median m", "90 % m", "coverage", "area m2", "area/exact"),
    *("ANEES/2", "of one place", "runs", "failures", "s"),
)
LEGEND = (
    "Median and 90th percentile of the error; share of runs whose 95 % region contains the truth; "
    "median area of that "
    "region, and median over the runs of its ratio to the exact posterior's; ANEES/2 of the "
    "strongest mode with its "
    "own covariance (1 is exact), and the same over those runs only whose answer is one place; "
    "median CPU time. "
    "A failed run has an infinite error. The exact posterior knows the noise, the receiver's "
    "true places and the "
    "levels before clipping."
)

Lines = list[tuple[str, ...]]


@dataclass(frozen=True, slots=True)
class Board:
    """Everything that is reported."""

    date_utc: str
    versions: Mapping[str, str]
    seed: int
    scores: Mapping[str, Scores]
    targets: Sequence[Assessment]
    claims: Sequence[Claim]


def board(scores: Mapping[str, Scores], seed: int) -> Board:
    """The scoreboard of some runs, dated now."""
    versions = {"python": platform.python_version()} | {name: version(name) for name in PACKAGES}
    date_utc = datetime.now(UTC).strftime("%Y-%m-%dT%H:%MZ")
    return Board(date_utc, versions, seed, scores, assess(scores), claims(scores))


def show(found: Board, console: Console) -> None:
    """Print it."""
    for name, scores in found.scores.items():
        _show_table(console, f"{name}: {CASES[name].title}", HEADINGS, _lines(rows_of(scores)))
        console.print(_verdicts(scores), style="dim", highlight=False)
    if found.targets:
        _show_table(console, "targets", TARGET_HEADINGS, _target_lines(found.targets))
    if found.claims:
        _show_table(
            console, "the specification's table", CLAIM_HEADINGS, _claim_lines(found.claims)
        )
    console.print(LEGEND, style="dim")
    console.print(_date(found), style="dim", highlight=False)


def markdown(found: Board) -> str:
    """The same as Markdown."""
    parts = [f"# Accuracy\n\n{_date(found)}\n\n{LEGEND}"]
    if found.targets:
        parts.append(
            "## Targets\n\n" + _markdown_table(TARGET_HEADINGS, _target_lines(found.targets))
        )
    if found.claims:
        parts.append(
            "## The specification's table\n\n"
            + _markdown_table(CLAIM_HEADINGS, _claim_lines(found.claims))
        )
    for name, scores in found.scores.items():
        table = _markdown_table(HEADINGS, _lines(rows_of(scores)))
        parts.append(f"## {name}: {CASES[name].title}\n\n{table}\n\n{_verdicts(scores)}".rstrip())
    return "\n\n".join(parts) + "\n"


def as_json(found: Board) -> str:
    """The same as JSON, with every single run; what is infinite or unknown is null."""
    cases = [
        {
            "name": name,
            "title": CASES[name].title,
            "methods": [asdict(row) for row in rows_of(scores)],
            "verdicts": [asdict(given) for given in _given(scores)],
            "runs": [asdict(score) for column in scores.values() for score in column],
        }
        for name, scores in found.scores.items()
    ]
    targets = [
        {
            "cases": one.target.cases,
            "what": one.target.what,
            "low": one.target.low,
            "high": one.target.high,
            "value": one.value,
            "interval95": one.interval,
            "limit": one.limit,
            "runs": one.runs,
            "reached": one.is_reached,
        }
        for one in found.targets
    ]
    texts = [asdict(claim) | {"within_bound": claim.is_within_bound} for claim in found.claims]
    whole = {"date_utc": found.date_utc, "versions": found.versions, "seed": found.seed}
    return json.dumps(
        _finite(whole | {"targets": targets, "claims": texts, "cases": cases}),
        indent=1,
        allow_nan=False,
    )


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return value


TARGET_HEADINGS = (
    "case",
    "target",
    "wanted",
    "cellwalk",
    "95 % interval",
    "exact posterior",
    "runs",
    "",
)
CLAIM_HEADINGS = (
    "readings",
    "claimed m",
    "bound m",
    "exact m",
    "least squares m",
    "cellwalk m",
    "reference EKF m",
    "the claim is",
)


def _target_lines(found: Sequence[Assessment]) -> Lines:
    return [
        (
            ", ".join(one.target.cases),
            one.target.what,
            _limits(one.target.low, one.target.high),
            f"{one.value:.2f}",
            f"{one.interval[0]:.2f} to {one.interval[1]:.2f}",
            "-" if one.limit is None else f"{one.limit:.2f}",
            str(one.runs),
            "reached" if one.is_reached else "NOT REACHED",
        )
        for one in found
    ]


def _claim_lines(found: Sequence[Claim]) -> Lines:
    return [
        (
            f"{claim.readings}, {claim.where}",
            _number(claim.claimed_m),
            _number(claim.bound_m),
            *(
                _number(claim.median_error_m.get(method))
                for method in (EXACT, LEAST_SQUARES, OURS, "reference EKF")
            ),
            "within the bound" if claim.is_within_bound else "BEYOND THE BOUND",
        )
        for claim in found
    ]


def _limits(low: float, high: float) -> str:
    if not isfinite(high):
        return f">= {low:.2f}"
    return f"{low:.2f} to {high:.2f}" if isfinite(low) else f"<= {high:.2f}"


def _lines(rows: Sequence[Row]) -> Lines:
    return [
        (
            row.method,
            _number(row.median_error_m),
            _number(row.p90_error_m),
            "-" if row.coverage is None else f"{row.coverage:.2f}",
            _number(row.median_area_m2),
            _number(row.area_ratio),
            _number(row.half_anees),
            _number(row.half_anees_of_one_place),
            str(row.runs),
            str(row.failures),
            "-" if row.method == BOUND else f"{row.seconds:.2f}",
        )
        for row in rows
    ]


def _number(value: float | None) -> str:
    """Three digits."""
    if value is None:
        return "-"
    if not isfinite(value):
        return "inf"
    return (
        f"{value:.1e}"
        if abs(value) >= 1e6
        else f"{float(f'{value:.3g}'):.{0 if abs(value) >= 100 else 2 - (abs(value) >= 10)}f}"
    )


def _given(scores: Scores) -> list[Given]:
    return verdicts_of(scores[OURS]) if OURS in scores else []


def _verdicts(scores: Scores) -> str:
    texts = ", ".join(
        f"{verdict.verdict} {verdict.count}{_missed_runs(verdict.missed_runs)}"
        for verdict in _given(scores)
    )
    return f"cellwalk's verdicts: {texts}" if texts else ""


def _missed_runs(runs: Sequence[int]) -> str:
    """Numbers of the runs, by which each can be done again."""
    named = " ".join(map(str, runs[:MOST_NAMED])) + (" ..." if len(runs) > MOST_NAMED else "")
    return f" (truth outside the region in {len(runs)}: {named})" if runs else ""


def _date(found: Board) -> str:
    return f"{found.date_utc}, seed {found.seed}, " + ", ".join(
        f"{name} {v}" for name, v in found.versions.items()
    )


def _show_table(console: Console, title: str, headings: Sequence[str], lines: Lines) -> None:
    table = Table(title=title, title_justify="left", title_style="bold")
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 else "right")
    for line in lines:
        table.add_row(*line)
    console.print(table)


def _markdown_table(headings: Sequence[str], lines: Lines) -> str:
    rows = [tuple(headings), tuple("---" for _ in headings), *lines]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)
