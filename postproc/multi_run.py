"""Several runs, one answer: the readings of a cell from all of them, and the answer without each.

Each run's track is smoothed alone and put into the UTM zone of the first. How much higher one modem
reads than another is unknown (`logger.core.locator.offsets`), unless two runs name the same modem.
"""

import tomllib
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from pyproj import Geod

from logger.core.arrays import IntArray
from logger.core.errors import ConfigError, GeoError
from logger.core.geo import Utm
from logger.core.locator.posterior import Posterior
from logger.core.observations import CellObservations, Observations
from logger.core.runfile import Run
from postproc.processes import each
from postproc.scan_counts import scans_of, too_rarely
from postproc.smoothing import (
    NO_CELL,
    CellResult,
    Progress,
    Wishes,
    answer,
    heard_cells,
    smooth_cell,
    without_place,
)
from postproc.walk import walk_of

FARTHEST_KM = 300.0
"""Walks of one cell are nearer to each other than GSM reaches; a UTM zone is true for that far."""

_GEOD = Geod(ellps="WGS84")

Parts = dict[int, CellObservations]
"""Readings of a cell by number of the run."""


@dataclass(frozen=True, slots=True)
class RunShare:
    """What a run gave to a cell: readings, and how much higher its modem reads than that of the
    first such run.
    """

    run: int
    n: int
    offset_db: float | None
    sigma_db: float | None


@dataclass(frozen=True, slots=True)
class TogetherCell:
    """A cell over all runs; `without` by number of the run left out, empty unless two or more runs
    heard the cell.

    `run` is the number of the run that each reading of `result.obs` is from, shape (n,).
    """

    result: CellResult
    run: IntArray
    shares: tuple[RunShare, ...]
    without: dict[int, CellResult]


@dataclass(frozen=True, slots=True)
class Together:
    """Results of several runs, the cell with most readings first; `run_warnings` are about each
    run.

    `observations` are by number of the run; one without a position has none.
    """

    runs: tuple[Run, ...]
    observations: Mapping[int, Observations]
    cells: tuple[TogetherCell, ...]
    warnings: tuple[str, ...]
    run_warnings: tuple[tuple[str, ...], ...]


def smooth_together(
    runs: Sequence[Run],
    only: Sequence[str] | None = None,
    *,
    wishes: Wishes = Wishes(),  # noqa: B008 (frozen)
    progress: Progress | None = None,
    processes: int = 1,
) -> Together:
    """Estimate every cell from all runs that heard it, or those named; `processes` as in
    `smooth_run`.

    Raises `ConfigError` for a run given twice and a cell that was not heard, `GeoError` for runs
    too far apart.
    """
    _check_different(runs)
    heard, scans = heard_cells(runs, only), scans_of(runs)
    walks = [walk_of(run) for run in runs]
    observations = _in_one_zone(runs, {i: found for i, (found, _) in enumerate(walks) if found})
    parts = _by_cell(
        observations, {name: n for name, n in heard.items() if not too_rarely(scans[name])}
    )
    modems = modems_of(runs)
    merged = sorted(
        ((merge(part, modems), part) for part in parts.values()),
        key=lambda one: len(one[0]),
        reverse=True,
    )
    results = each(partial(_cell, modems=modems, wishes=wishes), merged, processes)
    names = [obs.cell for obs, _ in merged]
    cells = list(progress(results, "locating", len(names), names) if progress else results)
    nothing = np.zeros(0, np.int64)
    cells += [
        TogetherCell(without_place(c, n, scans[c]), nothing, (), {})
        for c, n in heard.items()
        if c not in parts
    ]
    cells = [
        replace(one, result=replace(one.result, n_scans=scans[one.result.cell])) for one in cells
    ]
    warnings = _warnings(heard, parts)
    return Together(
        tuple(runs), observations, tuple(cells), warnings, tuple(tuple(told) for _, told in walks)
    )


def modems_of(runs: Sequence[Run]) -> list[int]:
    """Number of each run's modem: the same for two runs only where both certainly name the same
    one.
    """
    known: dict[Hashable, int] = {}
    return [known.setdefault(_modem(run) or i, len(known)) for i, run in enumerate(runs)]


def merge(parts: Parts, modems: Sequence[int]) -> CellObservations:
    """Readings of a cell, run after run, those of each in time order; `modems` by number of the
    run.
    """
    found = list(parts.values())
    arrays = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(obs, name) for obs in found]) for name in arrays
    }
    of_part = _renumbered([modems[i] for i in parts])
    modem = np.repeat(of_part, [len(obs) for obs in found]) if max(of_part) else None
    rat = next((obs.rat for obs in found if obs.rat), None)
    told = [np.full(len(obs), -1) if obs.ta is None else obs.ta for obs in found]
    ta = None if all(obs.ta is None for obs in found) else np.concatenate(told)
    return replace(found[0], rat=rat, modem=modem, ta=ta, **joined)


def _cell(
    heard: tuple[CellObservations, Parts], modems: Sequence[int], wishes: Wishes
) -> TogetherCell:
    obs, parts = heard
    result = smooth_cell(obs, wishes)
    if result.posterior is not None and result.posterior.offsets is not None:
        told = "levels of several modems: the offset between them is estimated, least squares takes it as known"
        result = replace(result, warnings=(*result.warnings, told))
    run = np.repeat(list(parts), [len(part) for part in parts.values()])
    without = {}
    for left_out in parts if len(parts) > 1 else ():
        rest = {i: part for i, part in parts.items() if i != left_out}
        without[left_out] = answer(merge(rest, modems), wishes.prior)
    return TogetherCell(result, run, _shares(parts, modems, result.posterior), without)


def _shares(
    parts: Parts, modems: Sequence[int], posterior: Posterior | None
) -> tuple[RunShare, ...]:
    of_part = _renumbered([modems[i] for i in parts])
    found = posterior.offsets if posterior else None

    def share(run: int, n: int, modem: int) -> RunShare:
        if modem == 0:
            return RunShare(run, n, 0.0, 0.0)
        if found is None:
            return RunShare(run, n, None, None)
        return RunShare(run, n, float(found.mean_db[modem]), float(found.sigma_db[modem]))

    return tuple(
        share(run, len(part), modem)
        for (run, part), modem in zip(parts.items(), of_part, strict=True)
    )


def _renumbered(numbers: Sequence[int]) -> list[int]:
    """From 0 in the order of appearance."""
    known: dict[int, int] = {}
    return [known.setdefault(number, len(known)) for number in numbers]


def _modem(run: Run) -> Hashable | None:
    """What names the modem of a run: its port, if that carries a serial number, or its port since a
    boot.
    """
    try:
        modem = tomllib.loads(run.meta.config_text).get("modem")
    except tomllib.TOMLDecodeError:
        return None
    if not isinstance(modem, dict) or "port" not in modem:
        return None
    port, driver = str(modem["port"]), modem.get("driver")
    if "/by-id/" in port:
        return port, driver
    return (port, driver, run.meta.boot_id) if run.meta.boot_id else None


def _check_different(runs: Sequence[Run]) -> None:
    known: dict[str, Run] = {}
    for run in runs:
        if run.meta.run_id in known:
            raise ConfigError(
                f"{known[run.meta.run_id].path} and {run.path} are the same run: each counts once"
            )
        known[run.meta.run_id] = run


def _in_one_zone(
    runs: Sequence[Run], placed: Mapping[int, Observations]
) -> dict[int, Observations]:
    """All in the zone of the first that knows its place; raises `GeoError` for runs too far
    apart.
    """
    if not placed:
        return {}
    first = next(iter(placed))
    utm, start_deg = placed[first].track.utm, _start_deg(placed[first])
    for i, observations in placed.items():
        apart_km = _GEOD.inv(*start_deg, *_start_deg(observations))[2] / 1000.0
        if apart_km > FARTHEST_KM:
            raise GeoError(
                f"{runs[i].path} was walked {apart_km:.0f} km from {runs[first].path}: "
                f"beyond {FARTHEST_KM:.0f} km runs share neither a map nor a cell"
            )
    return {
        i: replace(o, cells=tuple(_put(obs, utm) for obs in o.cells)) for i, o in placed.items()
    }


def _start_deg(observations: Observations) -> tuple[float, float]:
    """Longitude and latitude of the first fix."""
    track = observations.track
    lat_deg, lon_deg = track.utm.to_latlon(float(track.x_m[0]), float(track.y_m[0]))
    return lon_deg, lat_deg


def _put(obs: CellObservations, utm: Utm) -> CellObservations:
    """The same readings in another zone."""
    if obs.utm == utm:
        return obs
    x_m, y_m = utm.to_xy_arrays(*obs.utm.to_latlon_arrays(obs.x_m, obs.y_m))
    return replace(obs, utm=utm, x_m=x_m, y_m=y_m)


def _by_cell(placed: Mapping[int, Observations], heard: Mapping[str, int]) -> dict[str, Parts]:
    parts: dict[str, Parts] = {}
    for i, observations in placed.items():
        for obs in observations.cells:
            if obs.cell in heard:
                parts.setdefault(obs.cell, {})[i] = obs
    return parts


def _warnings(heard: Mapping[str, int], parts: Mapping[str, Parts]) -> tuple[str, ...]:
    if not heard:
        return (NO_CELL,)
    if all(len(part) < 2 for part in parts.values()):
        return ("no cell was heard in two of the runs: each answer is that of one run",)
    return ()
