"""Every estimator over every cell of one run or of several, side by side."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from logger.core.cell_names import is_by_channel
from logger.core.locator.preparation import MOST_MODEMS
from logger.core.runfile import Run
from postproc.cell_estimation import estimate_cell, locate_cell
from postproc.cell_work import PROCESS_ENDED, Failure, attempt, failure
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
from postproc.result import CellResult, Options, Result, RunShare, joint_warnings
from postproc.scan_counts import heard_utc_ns, joined_of, observed_cells, scans_of, too_rarely
from postproc.walk import observe_run


def smooth_runs(
    runs: Sequence[Run],
    only: Sequence[str] | None = None,
    *,
    options: Options = Options(),
    progress: Progress | None = None,
    processes: int = 1,
) -> Result:
    """Estimate every cell of the runs from all its readings, or only the cells named in `only`.

    Cells are shared out over at most `processes`; with more than one the calling script needs a
    main guard. A run without fixes, or a cell with too few readings, is no error: the verdict is
    then "cannot tell", as it is for a cell whose estimate fails.

    An identity that is heard farther apart than any cell reaches has a result for each place.
    Raises `ConfigError` for a run that appears twice and for a cell that was not observed,
    `GeoError` for runs of several places, which `postproc.ground.by_place` tells apart.
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
    certain = {cell for cell in n_readings if not too_rarely(n_scans[cell])}
    parts = parts_by_cell(observed, certain)
    places = {cell: places_of(of_cell) for cell, of_cell in parts.items()}
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
    nowhere = [cell for cell in n_readings if cell not in parts]
    heard = [observed_cells([run], None) for run in runs] if nowhere else []
    for cell in nowhere:
        of_runs = [i for i, own in enumerate(heard) if cell in own]
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
    """The result with its scans, and with the finding that other `places` name the cell."""
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


def without_position(cell: str, n: int, n_scans: int, heard: Sequence[int]) -> CellResult:
    """Result of a cell that the runs `heard` too rarely, or without a position."""
    why = (
        too_rarely(n_scans)
        or f"none of its {n} reading{'s' * (n != 1)} has both a level and a position"
    )
    shares = tuple(RunShare(run, 0, None, None) for run in heard)
    return CellResult(cell, 0, None, "cannot tell", (why,), n_scans=n_scans, shares=shares)


_WHAT = "its estimate"


def _estimate(parts: Parts, modems: Sequence[int], options: Options) -> CellResult:
    """As `_estimate_with_parts`, or why there is no estimate."""
    result = attempt(_name(parts), _WHAT, lambda: _estimate_with_parts(parts, modems, options))
    return _without_estimate(parts, result) if isinstance(result, Failure) else result


def _cell_without_result(parts: Parts) -> CellResult:
    """Result of a cell whose estimate ended a process."""
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
    """All estimators over the readings of all runs, and the answer without each run."""
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
        run_index=np.repeat(list(parts), [len(part) for part in parts.values()]),
        shares=shares_of(parts, modems, result.posterior),
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
