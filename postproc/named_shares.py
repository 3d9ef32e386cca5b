"""How regularly the scans along a walk name each cell (`logger.core.regular_naming`)."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.places import Places, index_of, join_places
from logger.core.readings import Observations, Readings, modems_of
from logger.core.regular_naming import NEAR_M
from logger.core.rows import Rows, numbered_texts

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
