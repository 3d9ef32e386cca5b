"""The result of `smooth`: every estimator over every cell of one run or of several.

One run is several with n = 1. Tables, report, view, exports and JSON are made of this and of
nothing else; positions are UTM, times nanoseconds (conventions: `logger.core`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from logger.core import ekf
from logger.core.answer import (
    Answer,
    PathEnd,
    Paths,
    Place,
    Provenance,
    Region,
    Word,
    answer_of,
    place_of,
)
from logger.core.arrays import FloatArray, IntArray
from logger.core.ellipse import ellipse95
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import LEVEL, area_m2
from logger.core.locator.timing_advance import TimingCheck
from logger.core.locator.verdict import DESK_M
from logger.core.model.prior import ENVIRONMENTS, Prior
from logger.core.places import Places, Utm
from logger.core.readings import Observations, Readings, SpikeLevel
from logger.core.runfile import Run
from logger.core.types import Verdict
from postproc.cell_work import Failure
from postproc.estimators.direction_check import Comparison
from postproc.estimators.filters import FilterPath
from postproc.estimators.least_squares import BatchFit, Loss
from postproc.estimators.region_outline import geojson
from postproc.estimators.residuals import Residuals


@dataclass(frozen=True, slots=True)
class Options:
    """What the user may choose.

    The prior, the loss of the least-squares fit, and the radius that holds 95 % of the probability
    where a cell is located.
    """

    prior: Prior = ENVIRONMENTS["any"]
    loss: Loss = "linear"
    within_m: float = DESK_M


@dataclass(frozen=True, slots=True)
class ObservedRun:
    """A run with its readings at the walker's smoothed positions, and warnings about the run.

    `observations` is None where the run has no position fix. Of several runs all observations are
    in the UTM zone of the first run that has a position.
    """

    run: Run
    observations: Observations | None
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RunShare:
    """What a run contributes to a cell: `n` readings, and the offset of its modem.

    `run` is the index in `Result.runs`. `offset_db` is how much higher its modem reads than that of
    the first run that observed the cell; None where it could not be estimated.
    """

    run: int
    n: int
    offset_db: float | None
    sigma_db: float | None


class Estimator(NamedTuple):
    """An estimator beside the posterior: attribute of `CellResult`, key in JSON, and name."""

    key: str
    json_key: str
    name: str


BATCH: Final = Estimator("batch", "batch", "least squares")
EKF: Final = Estimator("ekf", "ekf", "EKF")
BACKWARD: Final = Estimator("backward", "ekf_backward", "EKF backward")
RTS: Final = Estimator("rts", "rts", "RTS")
REFERENCE: Final = Estimator("reference", "reference_ekf", "reference EKF")
ESTIMATORS: Final = (BATCH, EKF, BACKWARD, RTS, REFERENCE)
"""In the order of the tables."""


@dataclass(frozen=True, slots=True)
class CellResult:
    """What each estimator states about one cell; None where it has nothing reliable to state.

    `n` counts the readings with a position, `n_scans` the scans that identified the cell without
    doubt. `answer` is made of `posterior` and `verdict`; the reference EKF, the EKF forward and
    backward with their comparison, the RTS smoother and the least-squares fit (`batch`) are for
    comparison. `residuals` are those at the posterior's best position. `timing` compares timing
    advances with the posterior; None where none was read. `failed` names the estimators that did
    not converge; their values are dropped. `heard_utc_ns` are the times of the first and the last
    reading in UTC, None where unknown. `set_aside` are levels that the readings before and
    after contradict; only the reference EKF and `residuals` use them. `error` is that of the
    program which ended some of the work on the cell, None where none did.

    Of several runs, `run_index` (n,) is the index in `Result.runs` of each reading of `obs`,
    `shares` what each run contributed, and `without` the answer without one run, by its index;
    empty unless two or more runs observed the cell.
    """

    cell: str
    n: int
    obs: Readings | None
    verdict: Verdict
    warnings: tuple[str, ...]
    posterior: Posterior | None = None
    reference: FilterPath | None = None
    ekf: FilterPath | None = None
    rts: FilterPath | None = None
    batch: BatchFit | None = None
    backward: FilterPath | None = None
    comparison: Comparison | None = None
    residuals: Residuals | None = None
    timing: TimingCheck | None = None
    failed: tuple[str, ...] = ()
    set_aside: tuple[SpikeLevel, ...] = ()
    n_scans: int | None = None
    heard_utc_ns: tuple[int, int] | None = None
    run_index: IntArray | None = None
    shares: tuple[RunShare, ...] = ()
    without: Mapping[int, "CellResult"] = field(default_factory=dict)
    error: str | None = None

    @property
    def place(self) -> Place | None:
        """The posterior in degrees; None without one."""
        if self.posterior is None or self.obs is None:
            return None
        return place_of(self.posterior)

    def answer(self, runs: Sequence[Run], word: Word | None = None) -> Answer:
        """The answer from the `runs` of the result, with the word of suspicion if it was asked."""
        heard = [runs[share.run] for share in self.shares] or [
            run for run in runs if np.any(run.named_readings["cell"] == self.cell.encode())
        ]
        paths = None if self.obs is None else self._paths(self.obs.utm)
        names = tuple(dict.fromkeys(run.path.name for run in heard))
        first_utc_ns, last_utc_ns = self.heard_utc_ns or (None, None)
        made_from = Provenance(self.n, first_utc_ns, last_utc_ns, self.n_scans, names, self.error)
        return answer_of(
            self.cell, self.verdict, self.warnings, made_from, self.posterior, word, paths
        )

    def _paths(self, utm: Utm) -> Paths:
        ends = {}
        for estimator in ESTIMATORS:
            path: FilterPath | BatchFit | None = getattr(self, estimator.key)
            if isinstance(path, BatchFit):
                ends[estimator.key] = _end(path.state, path.covariance, utm, path.n, path.bounded)
            elif path is not None:
                n = path.consistency.n if path.consistency else len(path)
                ends[estimator.key] = _end(path.x[-1, :4], path.p[-1, :4, :4], utm, n)
        return Paths(ends, self.failed)

    def after(self, why: Failure) -> "CellResult":
        """The row of the cell where work on its result failed."""
        warnings = (why.reason, *self.warnings)
        return CellResult(
            self.cell, self.n, None, "cannot tell", warnings, n_scans=self.n_scans,
            heard_utc_ns=self.heard_utc_ns, error=why.error,
        )  # fmt: skip


def region_of(cell: CellResult, level: float) -> Region:
    """The region that holds so much of the probability, where its squares are known."""
    posterior, obs = cell.posterior, cell.obs
    if posterior is None or obs is None:
        return Region()
    if level != LEVEL and not posterior.is_strongest_inside:
        return Region()
    return Region(
        area_m2=area_m2(posterior.squares, level),
        geojson=geojson(posterior.squares, obs.utm, level),
    )


def _end(x: FloatArray, p: FloatArray, utm: Utm, n: int, is_bounded: bool = True) -> PathEnd:
    """The end at the state `x` (4,) with the covariance `p` (4, 4)."""
    lat, lon = Places.of(x[0], x[1], utm=utm).first_deg
    return PathEnd(
        lat=lat,
        lon=lon,
        drms_m=ekf.drms_m(ekf.upper_triangle(p)),
        p0_dbm=float(x[2]),
        p0_sigma_db=float(np.sqrt(max(p[2, 2], 0.0))),
        eta=float(x[3]),
        eta_sigma=float(np.sqrt(max(p[3, 3], 0.0))),
        ellipse95=ellipse95(p[0, 0], p[0, 1], p[1, 1]),
        n=n,
        is_bounded=is_bounded,
    )


def program_version() -> str:
    """Version of this program."""
    from importlib.metadata import version  # noqa: PLC0415 (50 ms)

    return version("cellwalk")


@dataclass(frozen=True, slots=True)
class Result:
    """All cells of one or several runs, the cell with most readings first.

    `warnings` are about the runs together; those about one run are in `runs`. `version` is that of
    the program that estimated. `words` are those of the cells where suspicion was asked.
    """

    runs: tuple[ObservedRun, ...]
    cells: tuple[CellResult, ...]
    warnings: tuple[str, ...] = ()
    options: Options = Options()
    version: str = field(default_factory=program_version)
    words: Mapping[str, Word] = field(default_factory=dict)

    def answer(self, cell: CellResult) -> Answer:
        """The answer about one of the cells, with its word where suspicion was asked."""
        return cell.answer([observed.run for observed in self.runs], self.words.get(cell.cell))


def joint_warnings(n_runs: int, cells: Sequence[CellResult]) -> tuple[str, ...]:
    """Warnings about the runs of these cells together."""
    if not cells:
        return ("no cell with an identity was observed",)
    if n_runs > 1 and all(len(cell.shares) < 2 for cell in cells):
        return ("no cell was observed in two of the runs: each answer is that of one run",)
    return ()
