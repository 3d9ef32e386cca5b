"""The JSON of `postproc smooth --json`, of `run.post.h5` and of what is made from them.

Positions are degrees (WGS84), lengths metres, levels dBm, times nanoseconds since boot. A value
that is unknown or not finite is null; a field whose default is UNSET is left out where it does not
apply. `docs/result.schema.json` is made from these types.
"""

import json
from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import UNSET, Struct, UnsetType

from logger.core.answer import Mode, MultiPolygon, Position, StrongestReading
from logger.core.ellipse import Ellipse
from logger.core.locator.alternatives import Alternative
from logger.core.model.prior import Prior
from logger.core.types import Verdict
from postproc.info import RunFacts

Values = list[float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary(RunFacts):
    """A run; `n_readings_without_position` includes those that no fix is near."""

    n_readings_without_position: int
    warnings: list[str]


class Best(Struct, kw_only=True):
    """The posterior: the position shown, a mode; radii that hold 95 and 50 %, P0 at 1 m and eta."""

    lat: float | None = None
    lon: float | None = None
    r95_m: float | None = None
    r50_m: float | None = None
    drms_m: float | None = None
    p0_dbm: float | None = None
    p0_sigma_db: float | None = None
    eta: float | None = None
    eta_sigma: float | None = None
    strongest: StrongestReading | None = None


class Region(Struct, kw_only=True):
    """Smallest region that holds a share of the probability."""

    area_m2: float | None = None
    geojson: MultiPolygon | None = None


class Noise(Struct, kw_only=True):
    """Mean of the noise over the posterior."""

    sigma_db: float | None
    decorrelation_m: float | None
    white_share: float | None


class State(Struct, kw_only=True):
    """State of an estimator after `n` readings; null where it was not run."""

    lat: float | None = None
    lon: float | None = None
    drms_m: float | None = None
    p0_dbm: float | None = None
    p0_sigma_db: float | None = None
    eta: float | None = None
    eta_sigma: float | None = None
    ellipse95: Ellipse | None = None
    n: int = 0


class FinalState(State, kw_only=True):
    """Last state of an estimator after `n` readings; `converged` is null where it was not run."""

    converged: bool | None = None


class Point(Struct, kw_only=True):
    """A position."""

    lat: float
    lon: float


class LeastSquares(State, kw_only=True):
    """As `FinalState`; `rivals` are other minima that fit as well."""

    sigma_db: float | UnsetType | None = UNSET
    converged: bool | None = None
    bounded: bool | UnsetType = UNSET
    correlation_inflation: float | UnsetType | None = UNSET
    rivals: list[Point] | UnsetType = UNSET


class Agreement(Struct, kw_only=True):
    """EKF backward minus forward, in combined standard deviations by component."""

    sigmas: dict[str, float | None]
    agrees: bool


class Bins(Struct, kw_only=True):
    """Mean residuals in bins, of one length."""

    centre: Values
    mean_db: Values
    sigma_db: Values
    readings: list[int]


class Innovations(Struct, kw_only=True):
    """Consistency of the EKF's innovations."""

    n: int
    n_at_limit: int
    mean_nis: float | None
    nis_bounds: tuple[float | None, float | None]
    autocorrelation: Values
    white_bound: float | None


class Outlier(Struct, kw_only=True):
    """A reading too far from the model."""

    scan_seq: int
    t_ns: int
    residual_db: float
    sigmas: float


class Residuals(Struct, kw_only=True):
    """Statistics of the residuals at the best position."""

    sigma_db: float | None
    skewness: float | None
    excess_kurtosis: float | None
    beyond_3_sigma: float | None
    lag1: float | None
    decorrelation_m: float | None
    independent: float | None
    by_distance: Bins | None
    by_azimuth: Bins | None
    innovations: Innovations | None
    outliers: list[Outlier]


class Spike(Struct, kw_only=True):
    """A level that the readings before and after contradict by `above_db`; `k` is its index."""

    k: int
    scan_seq: int
    t_ns: int
    level_dbm: float
    above_db: float


class TruthCheck(Struct, kw_only=True):
    """True position of a simulated cell."""

    lat: float
    lon: float
    error_m: float | None = None
    inside_region95: bool | None = None


class Timing(Struct, kw_only=True):
    """Points where a timing advance was read, and those that contradict the posterior."""

    places: int
    disagree: int


class Offset(Struct, kw_only=True):
    """What a run contributes to a cell, and how much higher its modem reads than the first."""

    run: str
    n: int
    offset_db: float | None
    sigma_db: float | None


class Area(Struct, kw_only=True):
    """Of a region."""

    area_m2: float | None = None


class Without(Struct, kw_only=True):
    """The answer without the run `run`."""

    n: int
    verdict: Verdict
    best: Position | None
    region95: Area
    run: str


class Cell(Struct, kw_only=True):
    """Every estimator over one cell; `offsets` and `without` are of several runs only.

    `error` is that of the program which ended some of the work; it is left out where none did.
    """

    cell: str
    n: int
    n_scans: int | None
    verdict: Verdict
    best: Best
    modes: list[Mode]
    region95: Region
    region50: Region
    prior: Prior | None
    alternatives: list[Alternative]
    noise: Noise | UnsetType = UNSET
    reference_ekf: FinalState
    ekf: FinalState
    ekf_backward: FinalState
    agreement: Agreement | None
    rts: FinalState
    batch: LeastSquares
    residuals: Residuals | None
    set_aside: list[Spike]
    truth: TruthCheck | None
    warnings: list[str]
    timing: Timing | UnsetType = UNSET
    offsets: list[Offset] | UnsetType = UNSET
    without: list[Without] | UnsetType = UNSET
    error: str | UnsetType = UNSET


class SummaryOfRun(Struct, kw_only=True):
    """What `postproc smooth --json` prints of one run."""

    run: RunSummary
    cells: list[Cell]


class SummaryOfRuns(Struct, kw_only=True):
    """What it prints of several runs; `warnings` are about the runs together."""

    runs: list[RunSummary]
    warnings: list[str]
    cells: list[Cell]


Summary = SummaryOfRun | SummaryOfRuns


def schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of both forms."""
    forms, definitions = msgspec.json.schema_components(
        (SummaryOfRun, SummaryOfRuns), ref_template="#/$defs/{name}"
    )
    for name in ("Alternative", "Ellipse", "Prior"):  # described where they are defined
        definitions[name].pop("description", None)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "postproc smooth --json",
        "anyOf": list(forms),
        "$defs": definitions,
    }


if __name__ == "__main__":
    print(json.dumps(schema(), indent=2))  # noqa: T201 (to docs/result.schema.json)
