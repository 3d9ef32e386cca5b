"""Every estimator over every cell of one run or of several, side by side."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import hypot
from typing import Any

import numpy as np

from logger.core.cell_names import is_by_channel
from logger.core.certainty import share_text
from logger.core.document import number_of
from logger.core.locator.pipeline import decide, locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.preparation import MOST_MODEMS
from logger.core.locator.timing_advance import timing_of
from logger.core.locator.verdict import DESK_M
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import LEAST_SHARE, Readings, SpikeLevel
from logger.core.runfile import Run
from postproc.cell_work import PROCESS_ENDED, Failure, attempt, failure
from postproc.estimators import ekf_initialisation, least_squares, residuals
from postproc.estimators.convergence import MOST_ETA, ended_well
from postproc.estimators.filters import FilterPath, compare, reference_ekf
from postproc.estimators.least_squares import BatchFit
from postproc.estimators.residuals import findings
from postproc.ground import elsewhere_reasons, places_of
from postproc.multi_run import (
    Parts,
    check_different,
    in_one_zone,
    merge,
    modems_of,
    parts_by_cell,
    parts_of_most_heard_modems,
    shares_of,
)
from postproc.processes import each
from postproc.progress import Progress
from postproc.result import (
    ESTIMATORS,
    REFERENCE,
    CellResult,
    Estimator,
    Options,
    Result,
    RunShare,
    heard_at,
    joint_warnings,
)
from postproc.scan_counts import heard_utc_ns, joined_of, observed_cells, scans_of, too_rarely
from postproc.walk import observe_run

FEWEST_READINGS = 5
"""Four unknowns and no redundancy: fewer readings determine nothing."""


def smooth_runs(
    runs: Sequence[Run],
    only: Sequence[str] | None = None,
    *,
    options: Options = Options(),
    progress: Progress | None = None,
    processes: int = 1,
) -> Result:
    """Estimate every cell of the runs from all its readings, or only the cells named in `only`.

    With more than one of `processes` the calling script needs a main guard. A run without fixes, a
    cell with too few readings and a failed estimate give the verdict "cannot tell".

    An identity that is heard farther apart than any cell reaches has a result for each place.
    Raises `ConfigError` for a run that appears twice and for a cell that was not observed,
    `GeoError` for runs of several places.
    """
    check_different(runs)
    asked = options
    n_readings, n_scans = observed_cells(runs, only), scans_of(runs)
    walks = map(observe_run, runs)
    paths = [run.name for run in runs]
    tracks = progress(walks, "smoothing", len(runs), paths) if progress else walks
    observed = in_one_zone(list(tracks))
    walks_on_map = [one.observations.track for one in observed if one.observations]
    if options.prior.area is not None and walks_on_map:
        prior = replace(options.prior, area=options.prior.area.at(walks_on_map))
        options = replace(options, prior=prior)
    parts = parts_by_cell(observed, n_readings)
    certain = {cell for cell in parts if not too_rarely(n_scans[cell])}
    places = {cell: places_of(parts[cell]) for cell in parts if cell in certain}
    near = [part for of_cell in places.values() for part in of_cell]
    near.sort(key=_n_readings, reverse=True)
    estimate = partial(_estimate, modems=modems_of(runs), options=options)
    results = each(estimate, near, processes, _cell_without_result)
    names = list(map(_name, near))
    estimated = progress(results, "locating", len(names), names) if progress else results
    cells = [
        _with_counts(cell, part, places[cell.cell], n_scans[cell.cell], runs)
        for cell, part in zip(estimated, near, strict=True)
    ]
    nowhere = [cell for cell in n_readings if cell not in certain]
    heard = [observed_cells([run], None) for run in runs] if nowhere else []
    for cell in nowhere:
        placed = parts.get(cell, {})
        of_runs = {i: len(placed.get(i, ())) for i, own in enumerate(heard) if cell in own}
        cells.append(without_position(cell, n_readings[cell], n_scans[cell], of_runs))
    utc_ns = heard_utc_ns(runs)
    cells = [
        replace(cell, heard_utc_ns=cell.heard_utc_ns or utc_ns.get(cell.cell))
        for cell in _with_name_remarks(cells, runs)
    ]
    return Result(observed, tuple(cells), joint_warnings(len(runs), cells), asked)


def _with_counts(
    result: CellResult,
    parts: Parts,
    places: Sequence[Parts],
    n_scans: int,
    runs: Sequence[Run],
) -> CellResult:
    utc_ns = None
    if len(places) > 1:
        n_scans = sum(len(np.unique(part.scan_seq)) for part in parts.values())
        utc_ns = heard_utc_ns([runs[i] for i in parts]).get(result.cell)
    there = sum(map(_n_readings, places)) - _n_readings(parts)
    warnings = (*result.warnings, *elsewhere_reasons(result.cell, len(places), there))
    return replace(result, n_scans=n_scans, heard_utc_ns=utc_ns, warnings=warnings)


_BY_CHANNEL = (
    "known by channel and code alone, which another cell may have too; rules of suspicion need an "
    "identity"
)


def _with_name_remarks(cells: Sequence[CellResult], runs: Sequence[Run]) -> Iterator[CellResult]:
    """The results, each with what its name rests on where that is not an identity alone."""
    joined = joined_of(runs)
    for cell in cells:
        remarks = cell.warnings
        if is_by_channel(cell.cell):
            remarks += (_BY_CHANNEL,)
        if n := joined.get(cell.cell):
            remarks += (f"{n} readings without an identity are joined by their channel and code",)
        yield replace(cell, warnings=remarks)


def without_position(cell: str, n: int, n_scans: int, heard: Mapping[int, int]) -> CellResult:
    """Result of a cell `heard` by runs so often: too rarely, or without position."""
    why = (
        too_rarely(n_scans)
        or f"none of its {number_of(n, 'reading')} has both a level and a position"
    )
    shares = tuple(RunShare(run, n_placed, None, None) for run, n_placed in heard.items())
    n_placed = sum(heard.values())
    return CellResult(cell, n_placed, None, "cannot tell", (why,), n_scans=n_scans, shares=shares)


_WHAT = "its estimate"


def _estimate(parts: Parts, modems: Sequence[int], options: Options) -> CellResult:
    result = attempt(_name(parts), _WHAT, lambda: _estimate_with_parts(parts, modems, options))
    return _without_estimate(parts, result) if isinstance(result, Failure) else result


def _cell_without_result(parts: Parts) -> CellResult:
    return _without_estimate(parts, failure(_name(parts), _WHAT, PROCESS_ENDED))


def _without_estimate(parts: Parts, why: Failure) -> CellResult:
    shares = tuple(RunShare(run, len(part), None, None) for run, part in parts.items())
    n = _n_readings(parts)
    return CellResult(why.cell, n, None, "cannot tell", (), shares=shares).after(why)


def _n_readings(parts: Parts) -> int:
    return sum(map(len, parts.values()))


def _name(parts: Parts) -> str:
    return next(iter(parts.values())).cell


def _estimate_with_parts(parts: Parts, modems: Sequence[int], options: Options) -> CellResult:
    every, parts = parts, parts_of_most_heard_modems(parts, modems)
    result = estimate_cell(merge(parts, modems), options)
    warnings = (*result.warnings, *_modem_warnings(result, len(parts), len(every)))
    result = replace(result, warnings=warnings)
    without = {}
    for left_out in parts if len(parts) > 1 else ():
        rest = {i: part for i, part in parts.items() if i != left_out}
        without[left_out] = locate_cell(merge(rest, modems), options.prior, options.within_m)
    return replace(
        result,
        shares=tuple(sorted(shares_of(parts, modems, result.posterior), key=lambda one: one.run)),
        without=without,
    )


def _modem_warnings(result: CellResult, n_runs: int, n_every: int) -> list[str]:
    """What several modems mean for the answer, by `n_runs` of `n_every` runs of the cell."""
    warnings = []
    if result.posterior is not None and result.posterior.offsets is not None:
        warnings.append(
            "levels of several modems: the offset between them is estimated, least squares "
            "assumes that estimate"
        )
    if n_runs < n_every:
        warnings.append(
            f"{n_every - n_runs} of {n_every} runs are left out: of more than {MOST_MODEMS} modems "
            "those count that received most"
        )
    return warnings


def estimate_cell(obs: Readings, options: Options = Options()) -> CellResult:
    """Every estimator over the readings of one cell."""
    located = locate_cell(obs, options.prior, options.within_m)
    posterior = located.posterior
    reference = reference_ekf(obs) if len(obs) and obs.n_modems == 1 else None
    if posterior is None:
        return _converged_only(replace(located, reference=reference))
    starts = Places.of(*np.transpose([mode.state[:2] for mode in posterior.modes]))
    usable = obs.usable()
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
        residuals.state_at_place(posterior, usable_aligned),
        all_aligned,
        result.ekf,
        height_m=options.prior.height_m,
    )
    warnings = [*result.warnings, *_batch_warnings(result.batch, posterior), *findings(diagnosis)]
    if isinstance(forward, str) and result.verdict == "located":
        warnings.append(f"no EKF and no RTS: {forward}")
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
    how_many = f"only {number_of(n_used, 'reading')} {which}"
    where = heard_at(obs)
    heard = f"; heard best at {where}" if where else ""
    return f"{how_many}: at least {FEWEST_READINGS} are needed{heard}"


def locate_cell(obs: Readings, prior: Prior, within_m: float = DESK_M) -> CellResult:
    """The posterior and its verdict, and no other estimator."""
    everywhere = obs.everywhere()
    usable = everywhere.usable()
    remarks = _repeat_warnings(len(obs), len(obs.repeats)) + _spike_warnings(len(obs), obs.spikes)
    remarks += _regularity_warnings(len(obs), len(everywhere) - len(usable))
    if why := too_few(obs, usable):
        return CellResult(
            obs.cell, len(obs), obs, "cannot tell", (why, *remarks), set_aside=obs.spikes
        )
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
        set_aside=obs.spikes,
        needed_m=needed_m,
    )


def _repeat_warnings(n: int, n_repeats: int) -> list[str]:
    """How many of `n` readings were reported again while the receiver moved."""
    if not n_repeats:
        return []
    one = f"{n_repeats} of {n} readings repeat the one before while the receiver moves"
    return [f"{one}: each report counts once"]


def _spike_warnings(n: int, spikes: Sequence[SpikeLevel]) -> list[str]:
    if not spikes:
        return []
    worst = max(spikes, key=lambda spike: abs(spike.above_db))
    how = "above" if worst.above_db > 0.0 else "below"
    which = "1 level was" if len(spikes) == 1 else f"{len(spikes)} levels were"
    warning = (
        f"{which} set aside because the readings before and after contradict them: the largest "
        f"deviation, {worst.level_dbm:.0f} dBm in reading {worst.k + 1} of {n}, is "
        f"{abs(worst.above_db):.0f} dB {how} those"
    )
    return [warning]


def _regularity_warnings(n: int, n_left_out: int) -> list[str]:
    """How many of `n` readings do not count because scans nearby do not name the cell."""
    if not n_left_out:
        return []
    warning = (
        f"{n_left_out} of {n} readings do not count: fewer than {share_text(LEAST_SHARE)} of the "
        "scans near them name the cell, so they are too high for their places"
    )
    return [warning]


def _passes(obs: Readings, posterior: Posterior) -> Iterator[ekf_initialisation.EkfRun | str]:
    if obs.n_modems > 1:
        why = "several modems, and the filter does not estimate the offset between them"
        return iter((why, why))
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
