"""The scoreboard as tables for the terminal, Markdown and JSON."""

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from math import isfinite, isnan

from rich.console import Console

from . import measured_report
from .cases import CASES
from .claims import Claim, claims
from .measured import WalkScore
from .peer_table import peer_table
from .run import Scores
from .score import BOUND, EXACT, LEAST_SQUARES, OURS
from .summary import Row, VerdictCount, rows_of, verdicts_of
from .tables import Lines, Table, in_markdown, limits, three_digits
from .tables import show as show_parts
from .targets import Assessment, assess, assess_measured

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


@dataclass(frozen=True, slots=True)
class Board:
    """Everything that is reported."""

    date_utc: str
    versions: Mapping[str, str]
    seed: int
    measured: Sequence[WalkScore]
    scores: Mapping[str, Scores]
    targets: Sequence[Assessment]
    claims: Sequence[Claim]


def board(scores: Mapping[str, Scores], measured: Sequence[WalkScore], seed: int) -> Board:
    """The scoreboard of some runs, dated now."""
    versions = {"python": platform.python_version()} | {name: version(name) for name in PACKAGES}
    date_utc = datetime.now(UTC).strftime("%Y-%m-%dT%H:%MZ")
    targets = [*assess_measured(measured), *assess(scores)]
    return Board(date_utc, versions, seed, measured, scores, targets, claims(scores))


def show(found: Board, console: Console) -> None:
    """Print it."""
    show_parts([*_parts(found), _date(found)], console)


def markdown(found: Board) -> str:
    """The same as Markdown."""
    return in_markdown([f"# Accuracy\n\n{_date(found)}", *_parts(found)]) + "\n"


def _parts(found: Board) -> list[Table | str]:
    """Measured walks, targets, the specification's table, and a table for each case."""
    parts = measured_report.tables(found.measured) if found.measured else []
    parts += peer_table(found.measured, found.scores)
    if found.targets:
        parts.append(Table("targets", TARGET_HEADINGS, _target_lines(found.targets)))
    if found.claims:
        parts.append(Table("the specification's table", CLAIM_HEADINGS, _claim_lines(found.claims)))
    for name, scores in found.scores.items():
        parts.append(Table(f"{name}: {CASES[name].title}", HEADINGS, _lines(rows_of(scores))))
        parts += [text] if (text := _verdicts(scores)) else []
    return [*parts, LEGEND] if found.scores else parts


def as_json(found: Board) -> str:
    """The same as JSON, with every single run; what is infinite or unknown is null."""
    cases = [
        {
            "name": name,
            "title": CASES[name].title,
            "methods": [asdict(row) for row in rows_of(scores)],
            "verdicts": [asdict(given) for given in _verdict_counts(scores)],
            "runs": [asdict(score) for column in scores.values() for score in column],
        }
        for name, scores in found.scores.items()
    ]
    targets = [asdict(one) | {"reached": one.is_reached} for one in found.targets]
    texts = [asdict(claim) | {"within_bound": claim.is_within_bound} for claim in found.claims]
    whole = {"date_utc": found.date_utc, "versions": found.versions, "seed": found.seed}
    return json.dumps(
        _finite(
            whole
            | {"targets": targets, "claims": texts, "cases": cases}
            | {"measured": [asdict(one) for one in found.measured]}
        ),
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
    "walks",
    "target",
    "wanted",
    "cellwalk",
    "interval",
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
            one.walks,
            one.what,
            limits(one.low, one.high),
            f"{one.value:.2f}",
            "-" if isnan(one.interval[0]) else f"{one.interval[0]:.2f} to {one.interval[1]:.2f}",
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
            three_digits(claim.claimed_m),
            three_digits(claim.bound_m),
            *(
                three_digits(claim.median_error_m.get(method))
                for method in (EXACT, LEAST_SQUARES, OURS, "reference EKF")
            ),
            "within the bound" if claim.is_within_bound else "BEYOND THE BOUND",
        )
        for claim in found
    ]


def _lines(rows: Sequence[Row]) -> Lines:
    return [
        (
            row.method,
            three_digits(row.median_error_m),
            three_digits(row.p90_error_m),
            "-" if row.coverage is None else f"{row.coverage:.2f}",
            three_digits(row.median_area_m2),
            three_digits(row.area_ratio),
            three_digits(row.half_anees),
            three_digits(row.half_anees_of_one_place),
            str(row.runs),
            str(row.failures),
            "-" if row.method == BOUND else f"{row.seconds:.2f}",
        )
        for row in rows
    ]


def _verdict_counts(scores: Scores) -> list[VerdictCount]:
    return verdicts_of(scores[OURS]) if OURS in scores else []


def _verdicts(scores: Scores) -> str:
    texts = ", ".join(
        f"{verdict.verdict} {verdict.count}{_missed_runs(verdict.missed_runs)}"
        for verdict in _verdict_counts(scores)
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
