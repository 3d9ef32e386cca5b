"""Every estimator over the readings of one cell."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot
from typing import Any

import numpy as np

from logger.core.locator.pipeline import decide, locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.timing_advance import timing_of
from logger.core.model.prior import Prior
from logger.core.observations import CellObservations, SpikeLevel
from postproc.estimators import ekf_initialisation, least_squares, residuals
from postproc.estimators.convergence import ended_well
from postproc.estimators.direction_check import compare
from postproc.estimators.filters import FilterPath, reference_ekf
from postproc.estimators.least_squares import BatchFit
from postproc.estimators.residual_findings import findings
from postproc.result import CellResult, Options

FEWEST_READINGS = 5
"""Four unknowns and no redundancy: fewer readings determine nothing."""


def estimate_cell(obs: CellObservations, options: Options = Options()) -> CellResult:
    """Every estimator over the readings of one cell."""
    found = locate_cell(obs, options.prior)
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
    fitted = least_squares.fit(shared, starts, loss=options.loss, height_m=options.prior.height_m)
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
        posterior.modes[0].state, level, whole.ekf, height_m=options.prior.height_m
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
    """The result without the estimators that did not converge; `failed` and a warning name them."""
    failed = tuple(
        name for name in _NAMES if not _is_converged(name, getattr(result, name), result.obs)
    )
    told = [f"{_NAMES[name]} did not converge" for name in failed]
    kept: dict[str, Any] = dict.fromkeys(failed)
    return replace(result, **kept, failed=failed, warnings=(*result.warnings, *told))


def _is_converged(
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


def locate_cell(obs: CellObservations, prior: Prior) -> CellResult:
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
        f"{which} set aside, since the readings around do not share them: the worst, "
        f"{worst.level_dbm:.0f} dBm in scan "
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
            f"least squares lies {apart_m:.0f} m from the posterior's best place, outside its 95 "
            "% radius"
        )
    return warnings
