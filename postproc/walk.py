"""The readings of a run at the smoothed positions of the walker, and warnings about these."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.errors import EstimationError
from logger.core.places import UNKNOWN_SIGMA_M, Places, index_of, join_places
from logger.core.readings import NEAR_M, Observations, Readings, modems_of, observe, scan_times_ns
from logger.core.rows import Rows, numbered_texts, rows_of_each
from logger.core.runfile import Run
from logger.core.runfile.meta import has_times, is_dated, is_import
from logger.core.types import UNKNOWN_TIME
from logger.core.walker import SmoothedTrack, places_during, smooth_track, velocities
from postproc.estimators import track_plausibility
from postproc.result import ObservedRun

_LEAST_LISTS = 0.05
"""Share of the scans of a technology: with fewer lists of cells a modem names its own cell only."""


class Naming(NamedTuple):
    """Rows (r,) that name a cell in a scan: numbers of the cell, the scan and the technology."""

    cell: IntArray
    scan: IntArray
    rat: IntArray


def with_named_shares(observations: Observations, readings: Rows) -> Observations:
    """The observations, each reading with the share of the scans near it that name its cell.

    The scans are those of its modem.
    """
    modem = modems_of(readings)
    if modem is None:
        return _of_one_modem(observations, readings)
    cells = {obs.cell: np.zeros(len(obs)) for obs in observations.cells}
    for number in np.unique(modem).tolist():
        rows = {obs.cell: obs.modem == number for obs in observations.cells}
        own = tuple(obs.part(rows[obs.cell]) for obs in observations.cells if rows[obs.cell].any())
        shared = _of_one_modem(replace(observations, cells=own), readings[modem == number])
        for obs in shared.cells:
            cells[obs.cell][rows[obs.cell]] = obs.named_share
    every = tuple(replace(obs, named_share=cells[obs.cell]) for obs in observations.cells)
    return replace(observations, cells=every)


def _of_one_modem(observations: Observations, readings: Rows) -> Observations:
    if not observations.cells:
        return observations
    scan_seq = np.concatenate([obs.scan_seq for obs in observations.cells])
    places = join_places([obs.places for obs in observations.cells])
    seq, at = np.unique(scan_seq, return_index=True)
    at = at[np.argsort(places.t_ns[at], kind="stable")]
    number = np.argsort(scan_seq[at])  # of each scan in the order of the walk
    names, cell = numbered_texts(readings["cell"])
    rat = numbered_texts(readings["rat"])[1]
    place, is_known = index_of(seq, readings["seq"])
    counts = is_known & (readings["cell"] != b"")
    naming = Naming(cell[counts], number[place[counts]], rat[counts])
    share = named_shares(places.part(at), naming)
    key, first = np.unique(naming.cell * len(seq) + naming.scan, return_index=True)
    numbers = {name.decode(): k for k, name in enumerate(names.tolist())}

    def with_share(obs: Readings) -> Readings:
        scan = number[np.searchsorted(seq, obs.scan_seq)]
        row = first[np.searchsorted(key, numbers[obs.cell] * len(seq) + scan)]
        return replace(obs, named_share=share[row])

    return observations.each(with_share)


def named_shares(places: Places, naming: Naming) -> FloatArray:
    """Share of the scans near that of each row which name its cell, (r,).

    `places` (s,) are those of the scans in the order of the walk. A scan that does not name
    a cell says that it is weak if it lists cells of that technology; a scan that names the serving
    cell alone says so only where no other scans are.
    """
    along_m = np.append(0.0, np.cumsum(places.steps_m))
    first = np.searchsorted(along_m, along_m - NEAR_M, side="left")
    end = np.searchsorted(along_m, along_m + NEAR_M, side="right")
    lists = {rat: _lists(naming, rat, len(places)) for rat in np.unique(naming.rat).tolist()}
    share = np.zeros(len(naming.cell))
    for _, rows in rows_of_each(naming.cell):
        at, is_list = naming.scan[rows], lists[int(naming.rat[rows[0]])]
        named_in = np.unique(at)
        beside = named_in[~is_list[named_in]]
        named, alone = (
            np.searchsorted(some, end[at]) - np.searchsorted(some, first[at])
            for some in (named_in, beside)
        )
        n_lists = np.append(0, np.cumsum(is_list))
        share[rows] = named / (n_lists[end[at]] - n_lists[first[at]] + alone)
    return share


def _lists(naming: Naming, rat: int, n_scans: int) -> BoolArray:
    """Which scans (s,) would name a cell of a technology if it was strong."""
    has_rat = np.zeros(n_scans, np.bool_)
    has_rat[naming.scan[naming.rat == rat]] = True
    is_list = has_rat & (np.bincount(naming.scan, minlength=n_scans) > 1)
    has_lists = np.count_nonzero(is_list) >= _LEAST_LISTS * np.count_nonzero(has_rat)
    return is_list if has_lists else has_rat


def observe_run(run: Run) -> ObservedRun:
    """A run's readings at the walker's smoothed positions, and warnings about the run.

    Where an imported file has no true times, or fixes too few or too late to fit on a path, each
    position is as it was written. Without a fix there are no observations.
    """
    try:
        observations = observe(run.tables["fixes"], run.tables["scans"], run.named_readings)
    except EstimationError as error:
        return ObservedRun(run, None, (str(error),))
    if not has_times(run.meta.origin):
        warning = "the readings were imported without times: no position is smoothed"
        return ObservedRun(run, _in_order_of_rows(observations), (warning,))
    written = observations.track
    if is_import(run.meta.origin):
        has_utc = bool(np.any(run.tables["fixes"]["utc_ns"] != UNKNOWN_TIME))
        has_dates = has_utc or is_dated(run.meta.origin)
        why = track_plausibility.why_no_clock(written, is_dated=has_dates)
        if why := why or track_plausibility.too_fast(written):
            warning = f"the times cannot be right: {why}; so no position is smoothed"
            return ObservedRun(run, _in_order_of_rows(observations), (warning,))
    track = _smooth_track(run.tables, observations)
    if is_import(run.meta.origin) and (why := track_plausibility.too_many_apart(track)):
        warning = f"{why}: no position is smoothed, and each counts as less certain"
        return ObservedRun(run, _as_written(observations), (warning,))
    placed = with_named_shares(_place_readings(run.tables, observations, track), run.named_readings)
    return ObservedRun(run, placed, tuple(_describe_moved_fixes(track)))


def _in_order_of_rows(observations: Observations) -> Observations:
    return observations.each(lambda obs: replace(obs, is_timed=False))


def _as_written(observations: Observations) -> Observations:
    track = observations.track
    more_m = track_plausibility.written_sigma_m(track)

    def widen(obs: Readings) -> Readings:
        fix = np.maximum(np.searchsorted(track.t_ns, obs.t_ns, side="right") - 1, 0)
        sigma_m = np.hypot(np.maximum(obs.places.sigma_m, UNKNOWN_SIGMA_M), more_m[fix])
        return replace(obs, places=replace(obs.places, sigma_m=sigma_m))

    return observations.each(widen)


def _smooth_track(tables: Mapping[str, Rows], observations: Observations) -> SmoothedTrack:
    track = track_plausibility.without_stale(observations.track)
    return smooth_track(track, velocities(tables["fixes"], track))


def _place_readings(
    tables: Mapping[str, Rows], observations: Observations, track: SmoothedTrack
) -> Observations:
    scans = tables["scans"]
    begin_ns, end_ns = scans["t_start_ns"], scans["t_ns"]
    of_scan = places_during(track.at, (begin_ns + end_ns) // 2, begin_ns, end_ns)

    def place_cell(obs: Readings) -> Readings:
        index, is_there = (
            index_of(scans["seq"], obs.scan_seq) if len(scans) else (obs.scan_seq, False)
        )
        if np.all(is_there):  # all cells of a scan are at one place
            places = replace(of_scan.part(index), t_ns=obs.t_ns)
        else:
            places = places_during(track.at, obs.t_ns, *scan_times_ns(scans, obs))
        return replace(obs, places=places)

    return observations.each(place_cell)


def _describe_moved_fixes(track: SmoothedTrack) -> list[str]:
    moved_m, far = track_plausibility.moved_m(track), track_plausibility.moved_too_far(track)
    warnings = []
    if n := track.n_outliers:
        away_m = float(np.max(moved_m[track.outlier]))
        which = "fix lies" if n == 1 else "fixes lie"
        was = "was" if n == 1 else "were"
        warnings.append(
            f"{n} {which} apart from all others, up to {away_m:.0f} m from the track, and {was} "
            "set aside"
        )
    if n := int(np.count_nonzero(far)):
        away_m = float(np.max(moved_m[far]))
        which = "fix lies" if n == 1 else "fixes lie"
        warnings.append(
            f"{n} {which} farther from the smoothed track than three times their accuracy, up to "
            f"{away_m:.0f} m"
        )
    return warnings
