"""Every estimator over every cell of a run, side by side."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import hypot
from typing import Any, Protocol, TypeVar

import numpy as np

from logger.core.errors import ConfigError
from logger.core.locator.pipeline import decide, locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.timing_advance import TimingCheck, timing_of
from logger.core.locator.verdict import Verdict
from logger.core.model.prior import ENVIRONMENTS, Prior
from logger.core.observations import (
    CellObservations,
    Observations,
    SpikeLevel,
)
from logger.core.runfile import Run
from postproc.estimators import ekf_initialisation, least_squares, residuals
from postproc.estimators.convergence import ended_well
from postproc.estimators.direction_check import Comparison, compare
from postproc.estimators.filters import FilterPath, reference_ekf
from postproc.estimators.least_squares import BatchFit
from postproc.estimators.residual_findings import findings
from postproc.estimators.residuals import Residuals
from postproc.estimators.robust_losses import Loss
from postproc.processes import each
from postproc.scan_counts import scans_of, too_rarely
from postproc.walk import walk_of

FEWEST_READINGS = 5
"""Four unknowns and no check: with fewer readings there is nothing to be said at all."""

NO_CELL = "no cell with an identity was heard"

Item = TypeVar("Item")


class Progress(Protocol):
    """Passes `total` items on as they come, and shows how many have and the name of the next."""

    def __call__(
        self, items: Iterable[Item], what: str, total: int, names: Sequence[str] = ()
    ) -> Iterable[Item]: ...


@dataclass(frozen=True, slots=True)
class CellResult:
    """What each estimator says of one cell; None where it has nothing honest to say, and a warning
    says why.

    `n` counts the readings that could be used, `n_scans` the scans in which the cell was named
    surely. The answer is the posterior's; the EKF forward and backward, their comparison, the
    smoother and the least-squares fit stand beside it. `residuals` are those of the posterior's
    place. `timing` says whether the timing advances agree with the posterior; None where none was
    read. `failed` names the estimators that were asked and did not converge: what they ended with
    is not kept. `set_aside` are levels that the readings around them do not share; only the
    reference filter and `residuals` have them.
    """

    cell: str
    n: int
    obs: CellObservations | None
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


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the user may choose: the prior, and the loss of the least-squares fit."""

    prior: Prior = ENVIRONMENTS["any"]
    loss: Loss = "linear"


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Results of a run, the cell with most readings first; `warnings` are about the run as a
    whole.
    """

    run: Run
    observations: Observations | None
    cells: tuple[CellResult, ...]
    warnings: tuple[str, ...]


def smooth_run(
    run: Run,
    only: Sequence[str] | None = None,
    *,
    wishes: Wishes = Wishes(),
    progress: Progress | None = None,
    processes: int = 1,
) -> Smoothed:
    """Estimate every cell of a run, or those named; raises `ConfigError` for a name that was not
    heard.

    Cells are shared out over at most `processes`; with more than one the calling script needs a
    main guard. A run without fixes, or with cells heard too rarely, is no error: the verdict is
    then "cannot tell".
    """
    heard, scans = heard_cells([run], only), scans_of([run])
    observations, warnings = walk_of(run)
    spoken_of = {name for name in heard if not too_rarely(scans[name])}
    usable = (
        tuple(obs for obs in observations.cells if obs.cell in spoken_of) if observations else ()
    )
    if not heard:
        warnings.append(NO_CELL)
    results = each(partial(smooth_cell, wishes=wishes), usable, processes)
    names = [obs.cell for obs in usable]
    found = list(progress(results, "locating", len(names), names) if progress else results)
    located = {result.cell for result in found}
    found += [
        without_place(name, n, scans[name]) for name, n in heard.items() if name not in located
    ]
    counted = (replace(result, n_scans=scans[result.cell]) for result in found)
    return Smoothed(run, observations, tuple(counted), tuple(warnings))


def smooth_cell(obs: CellObservations, wishes: Wishes = Wishes()) -> CellResult:
    """Every estimator over the readings of one cell."""
    found = answer(obs, wishes.prior)
    posterior = found.posterior
    reference = reference_ekf(obs) if len(obs) and obs.n_modems == 1 else None
    if posterior is None:
        return _converged_only(replace(found, reference=reference))
    starts = [(mode.x_m, mode.y_m) for mode in posterior.modes]
    usable = obs.usable()
    level, shared = (
        some if posterior.offsets is None else some.on_one_scale(posterior.offsets.mean_db)
        for some in (obs, usable)
    )
    fitted = least_squares.fit(shared, starts, loss=wishes.loss, height_m=wishes.prior.height_m)
    forward, backward = _passes(usable, posterior)
    there = forward if isinstance(forward, ekf_initialisation.EkfRun) else None
    back = backward if isinstance(backward, ekf_initialisation.EkfRun) else None
    every = replace(
        found,
        reference=reference,
        ekf=there.filtered if there else None,
        rts=there.smoothed if there else None,
        batch=fitted,
        backward=back.filtered if back else None,
    )
    whole = _converged_only(every)
    compared = compare(whole.ekf, whole.backward) if whole.ekf and whole.backward else None
    left = residuals.diagnose(
        posterior.modes[0].state, level, whole.ekf, height_m=wishes.prior.height_m
    )
    warnings = [*whole.warnings, *_batch_warnings(whole.batch, posterior), *findings(left)]
    if isinstance(forward, ekf_initialisation.NoRun):
        warnings.append(f"no EKF and no RTS: {forward.reason}")
    if compared and compared.warning:
        warnings.append(compared.warning)
    return replace(whole, warnings=tuple(warnings), comparison=compared, residuals=left)


_NAMES = {
    "batch": "least squares",
    "ekf": "the EKF",
    "backward": "the EKF backward",
    "rts": "the RTS smoother",
    "reference": "the reference EKF",
}


def _converged_only(result: CellResult) -> CellResult:
    """The result without the estimators that did not converge, each named in `failed` and in a
    warning.
    """
    failed = tuple(
        name for name in _NAMES if not _converged(name, getattr(result, name), result.obs)
    )
    told = [f"{_NAMES[name]} did not converge" for name in failed]
    kept: dict[str, Any] = dict.fromkeys(failed)
    return replace(result, **kept, failed=failed, warnings=(*result.warnings, *told))


def _converged(
    name: str, ended: BatchFit | FilterPath | None, obs: CellObservations | None
) -> bool:
    if ended is None or obs is None:
        return True
    if isinstance(ended, BatchFit):
        return ended.converged
    return ended_well(ended.x[-1], ended.p[-1], obs, any_slope=name == "reference")


def too_few(obs: CellObservations) -> str | None:
    """Why the readings of a cell are too few for a posterior; None where they are not."""
    n, within = len(obs), int(np.count_nonzero(obs.limit == 0))
    if within >= FEWEST_READINGS:
        return None
    which = "with a position" if within == n else f"within the modem's scale ({n} with a position)"
    return (
        f"only {within} reading{'s' * (within != 1)} {which}: at least {FEWEST_READINGS} are needed"
    )


def answer(obs: CellObservations, prior: Prior) -> CellResult:
    """The posterior and its verdict, and no other estimator."""
    if why := too_few(obs):
        return CellResult(obs.cell, len(obs), obs, "cannot tell", (why,))
    kept, aside = obs.usable(), tuple(obs.spikes())
    posterior = locate(kept, prior)
    told, reasons, _ = decide(posterior, kept)
    timing = timing_of(kept)
    checked = None if timing is None else timing.check(posterior.squares)
    if checked and checked.warning:
        reasons.append(checked.warning)
    reasons += _set_aside(aside)
    return CellResult(
        obs.cell,
        len(obs),
        obs,
        told,
        tuple(reasons),
        posterior=posterior,
        timing=checked,
        set_aside=aside,
    )


def _set_aside(spikes: Sequence[SpikeLevel]) -> list[str]:
    """The largest of them in plain words."""
    if not spikes:
        return []
    worst = max(spikes, key=lambda spike: abs(spike.above_db))
    how = "above" if worst.above_db > 0.0 else "below"
    which = "1 level was" if len(spikes) == 1 else f"{len(spikes)} levels were"
    text = (
        f"{which} set aside, since the readings around do not share them: the worst, {worst.level_dbm:.0f} dBm in scan "
        f"{worst.scan_seq}, is {abs(worst.above_db):.0f} dB {how} those"
    )
    return [text]


def _passes(
    obs: CellObservations, posterior: Posterior
) -> Iterator[ekf_initialisation.EkfRun | ekf_initialisation.NoRun]:
    """Forward and backward."""
    if obs.n_modems > 1:
        why = "several modems, and the offset between them is no unknown of the filter"
        return iter((ekf_initialisation.NoRun(why), ekf_initialisation.NoRun(why)))
    noise = ekf_initialisation.noise_of(obs, posterior)
    return (ekf_initialisation.run(obs, posterior, noise, backward=way) for way in (False, True))


def heard_cells(runs: Sequence[Run], only: Sequence[str] | None) -> dict[str, int]:
    """Readings of each cell, or of those named; raises `ConfigError` for a name that was not
    heard.
    """
    names, counts = np.unique(
        np.concatenate([run.tables["readings"]["cell"] for run in runs]), return_counts=True
    )
    every = {name.decode(): int(n) for name, n in zip(names, counts, strict=True) if name}
    if unknown := set(only or ()) - set(every):
        raise ConfigError(
            f"cell {', '.join(sorted(unknown))} was not heard; `postproc info` lists those that were"
        )
    return {name: n for name, n in every.items() if not only or name in only}


def without_place(cell: str, n: int, n_scans: int) -> CellResult:
    """Result of a cell that was heard too rarely, or where nobody knew the place."""
    why = (
        too_rarely(n_scans)
        or f"none of its {n} reading{'s' * (n != 1)} has both a level and a position"
    )
    return CellResult(cell, 0, None, "cannot tell", (why,), n_scans=n_scans)


def _batch_warnings(fitted: BatchFit | None, posterior: Posterior) -> list[str]:
    if fitted is None:
        return []
    warnings = []
    if fitted.rivals:
        warnings.append(
            f"least squares fits {len(fitted.rivals)} other place(s) as well as its best one"
        )
    apart_m = hypot(fitted.state[0] - posterior.x_m, fitted.state[1] - posterior.y_m)
    if apart_m > posterior.r95_m:
        warnings.append(
            f"least squares lies {apart_m:.0f} m from the posterior's best place, outside its 95 % radius"
        )
    return warnings
