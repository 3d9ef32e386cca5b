"""Every estimator over every cell of a run, side by side."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import hypot

import numpy as np
from threadpoolctl import threadpool_limits

from logger.core.errors import ConfigError, EstimationError
from logger.core.observations import CellObservations, Observations, observe
from logger.core.runfile import Run
from postproc.estimators import batch, handover
from postproc.estimators.batch import BatchFit
from postproc.estimators.filtered import Filtered, reference_ekf
from postproc.estimators.posterior import Posterior, locate
from postproc.estimators.verdict import Verdict, verdict

FEWEST_READINGS = 5
"""Four unknowns and no check: with fewer readings there is nothing to be said at all."""

Progress = Callable[[Sequence[CellObservations], str, int], Iterable[CellObservations]]


@dataclass(frozen=True, slots=True)
class CellResult:
    """What each estimator says of one cell; None where it has nothing honest to say, and a warning says why.

    `n` counts the readings that could be used. The answer is the posterior's; the filters and the least-squares fit
    stand beside it.
    """

    cell: str
    n: int
    obs: CellObservations | None
    verdict: Verdict
    warnings: tuple[str, ...]
    posterior: Posterior | None = None
    reference: Filtered | None = None
    ekf: Filtered | None = None
    rts: Filtered | None = None
    batch: BatchFit | None = None


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Results of a run, the cell with most readings first; `warnings` are about the run as a whole."""

    run: Run
    observations: Observations | None
    cells: tuple[CellResult, ...]
    warnings: tuple[str, ...]


def smooth_run(run: Run, only: Sequence[str] | None = None, *, progress: Progress | None = None) -> Smoothed:
    """Estimate every cell of a run, or those named; raises `ConfigError` for a name that was not heard.

    A run without fixes, or with cells heard too rarely, is no error: the verdict is then "cannot tell".
    """
    tables = run.tables
    heard = {str(name): int(n) for name, n in _heard(run).items() if not only or name in only}
    if unknown := set(only or ()) - set(heard):
        raise ConfigError(f"cell {', '.join(sorted(unknown))} was not heard; `postproc info` lists those that were")
    warnings = []
    observations, usable = None, tuple[CellObservations, ...]()
    try:
        observations = observe(tables["fixes"], tables["scans"], tables["readings"])
        usable = tuple(obs for obs in observations.cells if obs.cell in heard)
    except EstimationError as error:
        warnings.append(str(error))
    if not heard:
        warnings.append("no cell with an identity was heard")
    # the matrices are small: threads of BLAS would only wait for each other
    with threadpool_limits(1):
        found = [smooth_cell(obs) for obs in (progress(usable, "locating", len(usable)) if progress else usable)]
    located = {result.cell for result in found}
    found += [_without_place(name, n) for name, n in heard.items() if name not in located]
    return Smoothed(run, observations, tuple(found), tuple(warnings))


def smooth_cell(obs: CellObservations) -> CellResult:
    """Every estimator over the readings of one cell."""
    n = len(obs)
    if n < FEWEST_READINGS:
        why = f"only {n} reading{'s' * (n != 1)} with a position: at least {FEWEST_READINGS} are needed"
        return CellResult(obs.cell, n, obs, "cannot tell", (why,), reference=reference_ekf(obs))
    posterior = locate(obs)
    answer, reasons = verdict(posterior, obs)
    fitted = batch.fit(obs, [(mode.x_m, mode.y_m) for mode in posterior.modes])
    handed = handover.run(obs, posterior)
    warnings = [*reasons, *_batch_warnings(fitted, posterior)]
    started = handed if isinstance(handed, handover.EkfRun) else None
    if isinstance(handed, handover.NoRun):
        warnings.append(f"no EKF and no RTS: {handed.reason}")
    return CellResult(
        obs.cell,
        n,
        obs,
        answer,
        tuple(warnings),
        posterior=posterior,
        reference=reference_ekf(obs),
        ekf=started.filtered if started else None,
        rts=started.smoothed if started else None,
        batch=fitted,
    )


def _heard(run: Run) -> dict[str, int]:
    names, counts = np.unique(run.tables["readings"]["cell"], return_counts=True)
    return {name.decode(): int(n) for name, n in zip(names, counts, strict=True) if name}


def _without_place(cell: str, n: int) -> CellResult:
    why = f"none of its {n} reading{'s' * (n != 1)} has both a level and a position"
    return CellResult(cell, 0, None, "cannot tell", (why,))


def _batch_warnings(fitted: BatchFit, posterior: Posterior) -> list[str]:
    warnings = []
    if not fitted.converged:
        warnings.append("least squares did not converge")
    if fitted.rivals:
        warnings.append(f"least squares fits {len(fitted.rivals)} other place(s) as well as its best one")
    apart_m = hypot(fitted.state[0] - posterior.x_m, fitted.state[1] - posterior.y_m)
    if apart_m > posterior.r95_m:
        warnings.append(f"least squares lies {apart_m:.0f} m from the posterior's best place, outside its 95 % radius")
    return warnings
