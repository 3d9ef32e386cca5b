"""Every estimator over the readings of one cell."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot
from typing import Any

import numpy as np

from logger.core.locator.pipeline import decide, locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.timing_advance import timing_of
from logger.core.locator.verdict import DESK_M
from logger.core.model.prior import Prior
from logger.core.readings import Readings, SpikeLevel
from logger.core.regular_naming import LEAST_SHARE
from postproc.estimators import ekf_initialisation, least_squares, residuals
from postproc.estimators.convergence import MOST_ETA, ended_well
from postproc.estimators.direction_check import compare
from postproc.estimators.filters import FilterPath, reference_ekf
from postproc.estimators.least_squares import BatchFit
from postproc.estimators.residuals import findings
from postproc.result import ESTIMATORS, REFERENCE, CellResult, Estimator, Options

FEWEST_READINGS = 5
"""Four unknowns and no redundancy: fewer readings determine nothing."""


def estimate_cell(obs: Readings, options: Options = Options()) -> CellResult:
    """Every estimator over the readings of one cell."""
    located = locate_cell(obs, options.prior, options.within_m)
    posterior = located.posterior
    reference = reference_ekf(obs) if len(obs) and obs.n_modems == 1 else None
    if posterior is None:
        return _converged_only(replace(located, reference=reference))
    starts = [(float(mode.state[0]), float(mode.state[1])) for mode in posterior.modes]
    usable = obs.usable(located.set_aside)
    all_aligned, usable_aligned = (
        readings if posterior.offsets is None else readings.on_one_scale(posterior.offsets.mean_db)
        for readings in (obs, usable)
    )
    fit = least_squares.fit(
        usable_aligned, starts, loss=options.loss, height_m=options.prior.height_m
    )
    forward, backward = _passes(usable, posterior)
    forward_run = forward if isinstance(forward, ekf_initialisation.EkfRun) else None
    backward_run = backward if isinstance(backward, ekf_initialisation.EkfRun) else None
    all_estimates = replace(
        _without_impossible_slope(located, fit),
        reference=reference,
        ekf=forward_run.filtered if forward_run else None,
        rts=forward_run.smoothed if forward_run else None,
        batch=fit,
        backward=backward_run.filtered if backward_run else None,
    )
    result = _converged_only(all_estimates)
    comparison = compare(result.ekf, result.backward) if result.ekf and result.backward else None
    diagnosis = residuals.diagnose(
        posterior.modes[0].state,
        all_aligned,
        result.ekf,
        height_m=options.prior.height_m,
        spikes=located.set_aside,
    )
    warnings = [*result.warnings, *_batch_warnings(result.batch, posterior), *findings(diagnosis)]
    if isinstance(forward, ekf_initialisation.NoRun):
        warnings.append(f"no EKF and no RTS: {forward.reason}")
    if comparison and comparison.warning:
        warnings.append(comparison.warning)
    return replace(result, warnings=tuple(warnings), comparison=comparison, residuals=diagnosis)


def _without_impossible_slope(located: CellResult, fit: BatchFit) -> CellResult:
    """The result, or cannot tell where without a prior the levels have an impossible exponent."""
    eta = float(fit.state[3])
    if located.verdict == "cannot tell" or fit.converged or 0.0 < eta <= MOST_ETA:
        return located
    why = (
        "the levels alone do not show a distance: least squares does not converge, "
        f"at a path loss exponent of {eta:.1f}"
    )
    reasons = (why, *located.warnings)
    return replace(located, verdict="cannot tell", warnings=reasons, needed_m=None)


def _converged_only(result: CellResult) -> CellResult:
    """The result without the estimators that did not converge; `failed` and a warning name them."""
    failed = [
        estimator
        for estimator in ESTIMATORS
        if not _is_converged(estimator, getattr(result, estimator.key), result.obs)
    ]
    keys = tuple(estimator.key for estimator in failed)
    without: dict[str, Any] = dict.fromkeys(keys)
    warnings = [f"{estimator.name} did not converge" for estimator in failed]
    return replace(result, **without, failed=keys, warnings=(*result.warnings, *warnings))


def _is_converged(
    estimator: Estimator, estimate: BatchFit | FilterPath | None, obs: Readings | None
) -> bool:
    if estimate is None or obs is None:
        return True
    if isinstance(estimate, BatchFit):
        return estimate.converged
    return ended_well(estimate.x[-1], estimate.p[-1], obs, any_slope=estimator == REFERENCE)


def too_few(obs: Readings, usable: Readings) -> str | None:
    """Why the readings of a cell are too few for a posterior; None where they are not.

    `usable` are those that count.
    """
    n, within = len(obs), int(np.count_nonzero(obs.limit == 0))
    n_used = int(np.count_nonzero(usable.limit == 0))
    if n_used >= FEWEST_READINGS:
        return None
    which = "with a position" if within == n else f"within the modem's range ({n} with a position)"
    if n_used < within:
        which = f"of {within} count"
    return (
        f"only {n_used} reading{'s' * (n_used != 1)} {which}: at least {FEWEST_READINGS} are needed"
    )


def locate_cell(obs: Readings, prior: Prior, within_m: float = DESK_M) -> CellResult:
    """The posterior and its verdict, and no other estimator."""
    spikes = tuple(obs.spikes())
    everywhere = obs.everywhere(spikes)
    usable = everywhere.usable()
    remarks = _repeat_warnings(len(obs), len(obs.repeats())) + _spike_warnings(spikes)
    remarks += _regularity_warnings(len(obs), len(everywhere) - len(usable))
    if why := too_few(obs, usable):
        return CellResult(obs.cell, len(obs), obs, "cannot tell", (why, *remarks), set_aside=spikes)
    posterior = locate(usable, prior)
    verdict, reasons, _, needed_m = decide(posterior, usable, within_m=within_m)
    timing = timing_of(usable, prior.height_m)
    timing_check = None if timing is None else timing.check(posterior.squares)
    if timing_check and timing_check.warning:
        reasons.append(timing_check.warning)
    return CellResult(
        obs.cell,
        len(obs),
        obs,
        verdict,
        (*reasons, *remarks),
        posterior=posterior,
        timing=timing_check,
        set_aside=spikes,
        needed_m=needed_m,
    )


def _repeat_warnings(n: int, n_repeats: int) -> list[str]:
    """How many of `n` readings are reports that were made again while the receiver moved."""
    if not n_repeats:
        return []
    one = f"{n_repeats} of {n} readings repeat the one before while the receiver moves"
    return [f"{one}: each report counts once"]


def _spike_warnings(spikes: Sequence[SpikeLevel]) -> list[str]:
    """How many levels were set aside, and the largest of them."""
    if not spikes:
        return []
    worst = max(spikes, key=lambda spike: abs(spike.above_db))
    how = "above" if worst.above_db > 0.0 else "below"
    which = "1 level was" if len(spikes) == 1 else f"{len(spikes)} levels were"
    warning = (
        f"{which} set aside because the readings before and after contradict them: the largest "
        f"deviation, {worst.level_dbm:.0f} dBm in scan {worst.scan_seq}, is "
        f"{abs(worst.above_db):.0f} dB {how} those"
    )
    return [warning]


def _regularity_warnings(n: int, n_left_out: int) -> list[str]:
    """How many of `n` readings do not count because scans nearby do not name the cell."""
    if not n_left_out:
        return []
    warning = (
        f"{n_left_out} of {n} readings do not count: fewer than {LEAST_SHARE:.0%} of the "
        "scans near them name the cell, so they are too high for their places"
    )
    return [warning]


def _passes(
    obs: Readings, posterior: Posterior
) -> Iterator[ekf_initialisation.EkfRun | ekf_initialisation.NoRun]:
    """Forward and backward."""
    if obs.n_modems > 1:
        why = "several modems, and the filter does not estimate the offset between them"
        return iter((ekf_initialisation.NoRun(why), ekf_initialisation.NoRun(why)))
    if why_not := ekf_initialisation.why_not_located(obs, posterior):
        return iter((why_not, why_not))
    noise = ekf_initialisation.noise_of(obs, posterior)
    return (
        ekf_initialisation.run(obs, posterior, noise, backward=backward)
        for backward in (False, True)
    )


def _batch_warnings(fit: BatchFit | None, posterior: Posterior) -> list[str]:
    if fit is None:
        return []
    warnings = []
    if fit.rivals:
        warnings.append(
            f"least squares fits {len(fit.rivals)} other position(s) as well as its best one"
        )
    apart_m = hypot(fit.state[0] - posterior.x_m, fit.state[1] - posterior.y_m)
    if apart_m > posterior.r95_m:
        warnings.append(
            f"least squares lies {apart_m:.0f} m from the posterior's best position, outside its "
            "95 % radius"
        )
    return warnings
