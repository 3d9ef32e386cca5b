"""What the runs of a case add up to: a row for each method."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from logger.core.arrays import BoolArray, FloatArray

from .score import EXACT, Score


@dataclass(frozen=True, slots=True)
class Columns:
    """Scores of one method in the order of the runs, shape (n,); NaN for a missing score."""

    error_m: FloatArray
    covered: FloatArray
    area_m2: FloatArray
    nees: FloatArray
    failed: BoolArray
    facts: Mapping[str, FloatArray]

    @classmethod
    def of(cls, scores: Sequence[Score]) -> "Columns":
        """From scores in the order of the runs."""
        names = {name for score in scores for name in score.facts}
        return cls(
            np.array([score.error_m for score in scores]),
            _numbers([score.covered for score in scores]),
            _numbers([score.area_m2 for score in scores]),
            _numbers([score.nees for score in scores]),
            np.array([score.failure is not None for score in scores]),
            {
                name: _numbers([score.facts.get(name, not score.failure) for score in scores])
                for name in sorted(names)
            },
        )


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table; None where the method has no such thing.

    `area_ratio` is the median over the runs of the region's area by the exact posterior's in the
    same run. `half_anees` is the mean of NEES / 2, 1 for an honest Gaussian;
    `half_anees_of_one_place` that of the runs whose answer is a single place. A failed run has an
    infinite error.
    """

    method: str
    runs: int
    failures: int
    median_error_m: float
    p90_error_m: float
    coverage: float | None
    median_area_m2: float | None
    area_ratio: float | None
    half_anees: float | None
    half_anees_of_one_place: float | None
    seconds: float


def rows_of(scores: Mapping[str, Sequence[Score]]) -> list[Row]:
    """A row for each method of a case."""
    exact_area_m2 = Columns.of(scores[EXACT]).area_m2 if EXACT in scores else None
    return [_row(method, column, exact_area_m2) for method, column in scores.items()]


@dataclass(frozen=True, slots=True)
class VerdictCount:
    """How often a verdict was given, and in which runs the region did not hold the truth then."""

    verdict: str
    count: int
    missed_runs: tuple[int, ...]


def verdicts_of(scores: Sequence[Score]) -> list[VerdictCount]:
    """Verdicts given, the most frequent first."""
    by_verdict = Counter(score.verdict for score in scores if score.verdict).most_common()
    missed = [score for score in scores if not score.covered]
    return [
        VerdictCount(name, count, tuple(one.run for one in missed if one.verdict == name))
        for name, count in by_verdict
    ]


def _row(method: str, scores: Sequence[Score], exact_area_m2: FloatArray | None) -> Row:
    columns = Columns.of(scores)
    return Row(
        method,
        runs=len(scores),
        failures=int(np.sum(columns.failed)),
        median_error_m=float(np.median(columns.error_m)),
        p90_error_m=quantile(columns.error_m, 0.9),
        coverage=_mean(columns.covered),
        median_area_m2=_median(columns.area_m2),
        area_ratio=None if exact_area_m2 is None else _median(columns.area_m2 / exact_area_m2),
        half_anees=half_anees(columns.nees),
        half_anees_of_one_place=half_anees(columns.nees[[score.places == 1 for score in scores]]),
        seconds=float(np.median([score.seconds for score in scores])),
    )


def quantile(values: FloatArray, share: float) -> float:
    """Smallest value that is not exceeded by this share of all; it bears infinite ones."""
    return float(np.quantile(values, share, method="inverted_cdf"))


def half_anees(nees: FloatArray) -> float | None:
    """Mean of NEES over its two degrees of freedom."""
    mean = _mean(nees)
    return None if mean is None else 0.5 * mean


def _numbers(values: Sequence[float | None]) -> FloatArray:
    return np.array([np.nan if value is None else float(value) for value in values])


def _finite(values: FloatArray) -> FloatArray:
    return values[~np.isnan(values)]


def _mean(values: FloatArray) -> float | None:
    return float(np.mean(_finite(values))) if len(_finite(values)) else None


def _median(values: FloatArray) -> float | None:
    return float(np.median(_finite(values))) if len(_finite(values)) else None
