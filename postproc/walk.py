"""The readings of one run, or of several as one walk, at the smoothed positions of the walker."""

import tomllib
from collections import Counter
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.errors import ConfigError, EstimationError
from logger.core.locator.posterior import Posterior
from logger.core.locator.preparation import MOST_MODEMS, of_most_heard_modems
from logger.core.places import (
    TIMING_S,
    UNKNOWN_SIGMA_M,
    Places,
    Utm,
    index_of,
    join_places,
    smeared_sigma_m,
)
from logger.core.readings import NEAR_M, Observations, Readings, observe, scan_times_ns
from logger.core.readings import modems_of as modems_of_readings
from logger.core.rows import Rows, numbered_texts
from logger.core.runfile import Run
from logger.core.runfile.meta import has_times, is_import
from logger.core.source_tables import MODEM, source_tables
from logger.core.types import UNKNOWN_TIME
from postproc.estimators import track_plausibility, walker
from postproc.estimators.walker import SmoothedTrack
from postproc.ground import check_one_place
from postproc.result import ObservedRun, RunShare

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
    modem = modems_of_readings(readings)
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
    numbers = {name.decode("utf-8", "replace"): k for k, name in enumerate(names.tolist())}

    def with_share(obs: Readings) -> Readings:
        scan = number[np.searchsorted(seq, obs.scan_seq)]
        row = first[np.searchsorted(key, numbers[obs.cell] * len(seq) + scan)]
        return replace(obs, named_share=share[row])

    return replace(observations, cells=tuple(map(with_share, observations.cells)))


def named_shares(places: Places, naming: Naming) -> FloatArray:
    """Share of the scans near that of each row which name its cell, (r,).

    `places` (s,) are those of the scans in the order of the walk. A scan that does not name
    a cell says that it is weak if it lists cells of that technology; a scan that names the serving
    cell alone says so only where no other scans are.
    """
    along_m = np.append(0.0, np.cumsum(np.hypot(*np.diff(places.xy_m, axis=1))))
    first = np.searchsorted(along_m, along_m - NEAR_M, side="left")
    end = np.searchsorted(along_m, along_m + NEAR_M, side="right")
    lists = {rat: _lists(naming, rat, len(places)) for rat in np.unique(naming.rat).tolist()}
    share = np.zeros(len(naming.cell))
    order = np.argsort(naming.cell, kind="stable")
    change = 1 + np.flatnonzero(np.diff(naming.cell[order]))
    for rows in np.split(order, change) if len(order) else ():
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
        return ObservedRun(run, observations, (warning,))
    written = observations.track
    if is_import(run.meta.origin):
        is_dated = bool(np.any(run.tables["fixes"]["utc_ns"] != UNKNOWN_TIME))
        why = track_plausibility.why_no_clock(written, is_dated=is_dated)
        if why := why or track_plausibility.too_fast(written):
            warning = f"the times cannot be right: {why}; so no position is smoothed"
            return ObservedRun(run, observations, (warning,))
    track = _smooth_track(run.tables, observations)
    if is_import(run.meta.origin) and (why := track_plausibility.too_many_apart(track)):
        warning = f"{why}: no position is smoothed, and each counts as less certain"
        return ObservedRun(run, _as_written(observations), (warning,))
    placed = with_named_shares(_place_readings(run.tables, observations, track), run.named_readings)
    return ObservedRun(run, placed, tuple(_describe_moved_fixes(track)))


def _as_written(observations: Observations) -> Observations:
    track = observations.track
    more_m = track_plausibility.written_sigma_m(track)

    def widen(obs: Readings) -> Readings:
        fix = np.maximum(np.searchsorted(track.t_ns, obs.t_ns, side="right") - 1, 0)
        sigma_m = np.hypot(np.maximum(obs.places.sigma_m, UNKNOWN_SIGMA_M), more_m[fix])
        return replace(obs, places=replace(obs.places, sigma_m=sigma_m))

    return replace(observations, cells=tuple(widen(obs) for obs in observations.cells))


def _smooth_track(tables: Mapping[str, Rows], observations: Observations) -> SmoothedTrack:
    track = track_plausibility.without_stale(observations.track)
    return walker.smooth_track(track, walker.velocities(tables["fixes"], track))


def _place_readings(
    tables: Mapping[str, Rows], observations: Observations, track: SmoothedTrack
) -> Observations:
    """A level is an average over seconds or a scan: its place is unsure by the way walked then."""
    scans = tables["scans"]
    begin_ns, end_ns = scans["t_start_ns"], scans["t_ns"]
    of_scan = _place(track, (begin_ns + end_ns) // 2, begin_ns, end_ns)

    def place_cell(obs: Readings) -> Readings:
        index, is_there = (
            index_of(scans["seq"], obs.scan_seq) if len(scans) else (obs.scan_seq, False)
        )
        if np.all(is_there):  # all cells of a scan are at one place
            places = replace(of_scan.part(index), t_ns=obs.t_ns)
        else:
            places = _place(track, obs.t_ns, *scan_times_ns(scans, obs))
        return replace(obs, places=places)

    return replace(observations, cells=tuple(place_cell(obs) for obs in observations.cells))


def _place(track: SmoothedTrack, t_ns: IntArray, begin_ns: IntArray, end_ns: IntArray) -> Places:
    placed = track.at(t_ns)
    before, after = (track.at(t_ns + shift) for shift in (-(10**9) // 2, 10**9 // 2))
    late_m = TIMING_S * np.hypot(after.x_m - before.x_m, after.y_m - before.y_m)
    begun, ended = track.at(begin_ns), track.at(end_ns)
    smear_m = smeared_sigma_m(np.hypot(ended.x_m - begun.x_m, ended.y_m - begun.y_m))
    return replace(placed, sigma_m=np.sqrt(placed.sigma_m**2 + late_m**2 + smear_m**2))


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


# --- several runs ---

# Each track is smoothed alone and put into the UTM zone of the first. The difference between the
# levels of two modems is unknown (`logger.core.locator.offsets`), unless two runs name the same
# modem. A run may have several modems.

Parts = Mapping[int, Readings]
"""Readings of one cell by index of the run."""


def named_apart(runs: Sequence[Run]) -> list[Run]:
    """The runs; files of one name are named with their folders.

    Raises `ConfigError` where two of the files are one run.
    """
    check_different(runs)
    parts = [run.path.absolute().parts for run in runs]
    depth = [1] * len(runs)
    while True:
        names = ["/".join(own[-n:]) for own, n in zip(parts, depth, strict=True)]
        counts = Counter(names)
        longer = [
            n + (counts[name] > 1 and n < len(own))
            for name, own, n in zip(names, parts, depth, strict=True)
        ]
        if longer == depth:
            apart = zip(runs, names, depth, strict=True)
            return [replace(run, shown_as=name) if n > 1 else run for run, name, n in apart]
        depth = longer


def check_different(runs: Sequence[Run]) -> None:
    """Raise `ConfigError` where two of the files are one run."""
    by_id: dict[str, Run] = {}
    for run in runs:
        if run.meta.run_id in by_id:
            raise ConfigError(
                f"{by_id[run.meta.run_id].path} and {run.path} are the same run: each counts once"
            )
        by_id[run.meta.run_id] = run


def in_one_zone(runs: Sequence[ObservedRun]) -> tuple[ObservedRun, ...]:
    """The runs in the UTM zone of the first that has a position.

    Raises `GeoError` for runs of several places.
    """
    check_one_place([run.run for run in runs])
    placed = [run.observations for run in runs if run.observations]
    if not placed:
        return tuple(runs)
    utm = placed[0].track.utm
    return tuple(
        replace(run, observations=run.observations and _observations_in(run.observations, utm))
        for run in runs
    )


def parts_by_cell(runs: Sequence[ObservedRun], cells: Collection[str]) -> dict[str, Parts]:
    """Readings of each of the `cells` that has any with a position, by index of the run."""
    parts: dict[str, dict[int, Readings]] = {}
    for i, run in enumerate(runs):
        for obs in run.observations.cells if run.observations else ():
            if obs.cell in cells:
                parts.setdefault(obs.cell, {})[i] = obs
    return {cell: scale_first(of_runs) for cell, of_runs in parts.items()}


Key = TypeVar("Key")


def scale_first(parts: Mapping[Key, Readings]) -> dict[Key, Readings]:
    """The parts of a cell, that with most levels first, in whatever order the runs are.

    Its modem gives the scale, and readings at the limits of the others are as vague as their
    offsets.
    """

    def rank(part: tuple[Key, Readings]) -> tuple[int, float]:
        obs = part[1]
        return -int(np.count_nonzero(obs.limit == 0)), -float(np.sum(obs.level_dbm))

    return dict(sorted(parts.items(), key=rank))


def modems_of(runs: Sequence[Run]) -> list[int]:
    """Number of each run's modem; two runs have the same only if both certainly name the same."""
    known: dict[Hashable, int] = {}
    return [known.setdefault(modem_identity(run) or i, len(known)) for i, run in enumerate(runs)]


def parts_of_most_heard_modems(parts: Parts, modems: Sequence[int]) -> Parts:
    """The readings of the modems that the locator takes."""
    numbers = _modem_numbers(parts, modems)
    if len(np.unique(np.concatenate(numbers))) <= MOST_MODEMS:
        return parts
    most_heard = of_most_heard_modems(merge(parts, modems)).modem
    assert most_heard is not None  # of many modems
    chosen = zip(parts.items(), numbers, strict=True)
    return {i: part for (i, part), number in chosen if np.any(np.isin(number, most_heard))}


def merge(parts: Parts, modems: Sequence[int]) -> Readings:
    """Readings of a cell, run after run, those of each in time order.

    `modems` has the number of the modem of each run, or of all its modems.
    """
    series = list(parts.values())
    numbers = np.concatenate(_modem_numbers(parts, modems))
    modem = numbers if np.any(numbers) else None
    rat = next((obs.rat for obs in series if obs.rat), None)
    advances = [np.full(len(obs), -1) if obs.ta is None else obs.ta for obs in series]
    ta = None if all(obs.ta is None for obs in series) else np.concatenate(advances)
    shares = [np.ones(len(o)) if o.named_share is None else o.named_share for o in series]
    is_unknown = all(obs.named_share is None for obs in series)
    named_share = None if is_unknown else np.concatenate(shares)
    return replace(
        series[0],
        rat=rat,
        places=join_places([obs.places for obs in series]),
        level_dbm=np.concatenate([obs.level_dbm for obs in series]),
        scan_seq=np.concatenate([obs.scan_seq for obs in series]),
        modem=modem,
        ta=ta,
        named_share=named_share,
    )


def shares_of(
    parts: Parts, modems: Sequence[int], posterior: Posterior | None
) -> tuple[RunShare, ...]:
    """What each modem of each run contributes to a cell, in the order of `parts`."""
    offsets = posterior.offsets if posterior else None

    def share(run: int, n: int, modem: int) -> RunShare:
        if modem == 0:
            return RunShare(run, n, 0.0, 0.0)
        if offsets is None or modem >= len(offsets.mean_db):
            return RunShare(run, n, None, None)
        return RunShare(run, n, float(offsets.mean_db[modem]), float(offsets.sigma_db[modem]))

    shares = []
    for run, of_readings in zip(parts, _modem_numbers(parts, modems), strict=True):
        numbers, counts = np.unique(of_readings, return_counts=True)
        pairs = zip(numbers.tolist(), counts.tolist(), strict=True)
        shares += [share(run, n, modem) for modem, n in pairs]
    return tuple(shares)


def _modem_numbers(parts: Parts, modems: Sequence[int]) -> list[IntArray]:
    """Number of the modem of each reading, from 0 in the order of appearance, for each part."""
    known: dict[tuple[int, int], int] = {}
    numbers = []
    for i, obs in parts.items():
        own = np.zeros(len(obs), np.int64) if obs.modem is None else obs.modem
        different, first, which = np.unique(own, return_index=True, return_inverse=True)
        for k in np.argsort(first).tolist():
            known.setdefault((modems[i], int(different[k])), len(known))
        of_different = [known[modems[i], int(one)] for one in different]
        numbers.append(np.array(of_different, np.int64)[which])
    return numbers


def of_one_modem(obs: Readings) -> Readings:
    """The readings of the modem of a run that read most of a cell."""
    if obs.modem is None:
        return obs
    return replace(obs.part(obs.modem == np.argmax(np.bincount(obs.modem))), modem=None)


def with_one_modem(run: Run) -> Run:
    """A run without the scans of other modems than the one with most readings."""
    sources, numbers = np.unique(run.tables["readings"]["source"], return_inverse=True)
    if len(sources) < 2:
        return run
    modem = sources[np.argmax(np.bincount(numbers))]
    kept = {
        name: rows[rows["source"] == modem]
        for name, rows in run.tables.items()
        if name in {"scans", "readings", "broadcasts"} and len(rows)
    }
    return replace(run, tables=run.tables | kept)


def modem_identity(run: Run) -> Hashable | None:
    """Identity of a run's modem: its port, with the boot where the port has no serial number.

    Several modems have all of theirs with their names. None where the run names none.
    """
    try:
        tables = source_tables(tomllib.loads(run.meta.config_text))
    except tomllib.TOMLDecodeError:
        return None
    modems = [one for one in tables if isinstance(one, dict) and one.get("kind") == MODEM]
    if not modems or not all("port" in one for one in modems):
        return None
    ports, drivers = [str(one["port"]) for one in modems], [one.get("driver") for one in modems]
    names = [str(one["name"]) for one in modems] if len(modems) > 1 else []
    identity = (*ports, *drivers, *names)
    if all("/by-id/" in port for port in ports):
        return identity
    return (*identity, run.meta.boot_id) if run.meta.boot_id else None


def _observations_in(observations: Observations, utm: Utm) -> Observations:
    cells = tuple(replace(obs, places=obs.places.in_zone(utm)) for obs in observations.cells)
    return replace(observations, track=observations.track.in_zone(utm), cells=cells)
