"""Readings joined to the walker's track: what every estimator is given."""

from dataclasses import dataclass, replace
from math import hypot
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.censoring import levels_dbm, limits
from logger.core.column import UNKNOWN_TIME
from logger.core.errors import EstimationError
from logger.core.geo import Utm
from logger.core.rows import Rows
from logger.core.spikes import spikes_along
from logger.core.types import DEAD_RECKONING

MAX_GAP_S = 10.0
"""A walker's place between two fixes further apart than this is not known well enough to be
interpolated.
"""
MAX_BEYOND_S = 2.0
"""A reading may be this much older than the first fix or younger than the last one."""

LAST_TA = 63
"""Timing advances end here; a base station farther away is told as this (3GPP TS 45.010)."""

_FARTHEST_M = 1e8

UERE_M = 4.0
"""User equivalent range error of a single-frequency receiver, per axis: sigma = HDOP x this."""
SIGMA_OF_RADIUS68 = 1.0 / 1.5096
"""Sigma per axis of a round Gaussian from the radius that holds 68 % of it."""
UNKNOWN_SIGMA_M = 7.0
"""Sigma per axis of a fix that tells nothing of its accuracy: a receiver among houses."""
DEAD_RECKONING_SIGMA_M = 28.0
"""More of it per axis for a place by dead reckoning: a receiver without satellites goes on along
its last course, for some 20 s before it gives up, and a walker who has turned meanwhile is 1.4 m/s
x 20 s from there. What the receiver says of its accuracy does not know of the turn.
"""
TIMING_S = 2.0
"""A level is an average over seconds and reported late (3GPP TS 45.008, 6.6.1: at least 5 s when
idle): where it was taken is unsure by what the walker covers in this time.
"""


class SpikeLevel(NamedTuple):
    """A level that its neighbours do not share, and by how much; `k` is its number among the
    readings.
    """

    k: int
    scan_seq: int
    t_ns: int
    level_dbm: float
    above_db: float


@dataclass(frozen=True, slots=True)
class CellObservations:
    """Levels of one cell along the walk, in time order; all arrays have shape (n,).

    `x_m, y_m` is the receiver in the run's UTM zone, `position_sigma_m` its standard deviation per
    axis, `scan_seq` the record number of the scan a level came from. `modem` numbers the modems of
    several runs from 0, run after run; None is one modem. `known_limit` is what `limit` says where
    the levels no longer show it. `ta` is the GSM timing advance in steps of 553.5 m, -1 where none
    was told; None is none at all. `without_spikes` tells that levels which their neighbours do not
    share have been taken out, or are to stay.
    """

    cell: str
    rat: str | None
    utm: Utm
    t_ns: IntArray
    x_m: FloatArray
    y_m: FloatArray
    position_sigma_m: FloatArray
    level_dbm: FloatArray
    scan_seq: IntArray
    modem: IntArray | None = None
    known_limit: IntArray | None = None
    ta: IntArray | None = None
    without_spikes: bool = False

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def n_modems(self) -> int:
        """How many modems the readings are from."""
        return 1 if self.modem is None else int(np.max(self.modem, initial=0)) + 1

    @property
    def limit(self) -> IntArray:
        """Which readings are no levels but ends of the modem's scale; see `scale.limits`."""
        if self.known_limit is not None:
            return self.known_limit
        if self.modem is None:
            return limits(self.level_dbm, self.rat)
        found = np.zeros(len(self), np.int64)
        for number in np.unique(self.modem):
            mine = self.modem == number
            found[mine] = limits(self.level_dbm[mine], self.rat)
        return found

    def part(self, chosen: "slice | npt.NDArray[np.bool_]") -> "CellObservations":
        """Some of the readings; which of them are at the modem's limit stays what all of them have
        shown.
        """
        names = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
        some = {name: getattr(self, name)[chosen] for name in names}
        modem, ta = (None if column is None else column[chosen] for column in (self.modem, self.ta))
        return replace(self, **some, modem=modem, known_limit=self.limit[chosen], ta=ta)

    def usable(self) -> "CellObservations":
        """The readings whose level and place are numbers, and on this Earth, and whose neighbours
        share their level.
        """
        known = self._known()
        found = self if np.all(known) else self.part(known)
        if found.without_spikes:
            return found
        kept = np.ones(len(found), np.bool_)
        kept[[spike.k for spike in found.spikes()]] = False
        if np.all(kept):
            return replace(found, without_spikes=True)
        # a spike does not tell where the modem's scale ends
        limit = None if self.known_limit is None else found.limit[kept]
        return replace(found.part(kept), known_limit=limit, without_spikes=True)

    def spikes(self) -> list[SpikeLevel]:
        """Levels that their neighbours do not share, which the device sets aside as well, in their
        order.
        """
        if self.without_spikes:
            return []
        known, limit = self._known(), self.limit
        spikes = []
        for number in range(self.n_modems):
            mine = np.flatnonzero(known if self.modem is None else known & (self.modem == number))
            x_m, y_m, level_dbm = (column[mine] for column in (self.x_m, self.y_m, self.level_dbm))
            spikes += [
                (int(mine[k]), above_db)
                for k, above_db in spikes_along(x_m, y_m, level_dbm, limit[mine])
            ]
        return [
            SpikeLevel(
                k, int(self.scan_seq[k]), int(self.t_ns[k]), float(self.level_dbm[k]), above_db
            )
            for k, above_db in sorted(spikes)
        ]

    def _known(self) -> BoolArray:
        columns = np.stack([self.x_m, self.y_m, self.position_sigma_m, self.level_dbm])
        return np.asarray(np.all(np.abs(columns) < _FARTHEST_M, axis=0))  # NaN compares false

    def on_one_scale(self, offset_db: FloatArray) -> "CellObservations":
        """The readings as the first modem would have heard them, given how much higher each modem
        reads, (modems,).
        """
        if self.modem is None:
            return self
        level_dbm = self.level_dbm - offset_db[self.modem]
        return replace(self, level_dbm=level_dbm, known_limit=self.limit)


@dataclass(frozen=True, slots=True)
class Track:
    """Fixes with a position, in time order, in the zone of the first."""

    utm: Utm
    t_ns: IntArray
    seq: IntArray
    x_m: FloatArray
    y_m: FloatArray
    sigma_m: FloatArray


@dataclass(frozen=True, slots=True)
class Observations:
    """Cells of a run, most readings first, and how many readings could not be used and why."""

    track: Track
    cells: tuple[CellObservations, ...]
    n_readings: int
    n_without_position: int
    n_without_identity: int
    n_without_level: int


def track_of(fixes: Rows) -> Track:
    """Track from the table `fixes`; raises `EstimationError` without a fix and `GeoError` beyond
    the map.
    """
    valid = (fixes["valid"] == 1) & np.isfinite(fixes["lat_deg"]) & np.isfinite(fixes["lon_deg"])
    rows = fixes[valid]
    if not len(rows):
        raise EstimationError("the run has no position fix, so nothing can be located")
    utm = Utm.at(float(rows["lat_deg"][0]), float(rows["lon_deg"][0]))
    order = np.argsort(rows["t_ns"], kind="stable")
    rows = rows[order]
    x_m, y_m = utm.to_xy_arrays(rows["lat_deg"], rows["lon_deg"])
    return Track(utm, rows["t_ns"], rows["seq"], x_m, y_m, _sigma_m(rows))


def fix_sigma_m(acc_m: float | None, hdop: float | None, quality: int | None = None) -> float:
    """Standard deviation per axis of one fix."""
    measured_m = UNKNOWN_SIGMA_M if hdop is None else hdop * UERE_M
    sigma_m = measured_m if acc_m is None else acc_m * SIGMA_OF_RADIUS68
    return hypot(sigma_m, DEAD_RECKONING_SIGMA_M) if quality == DEAD_RECKONING else sigma_m


def _sigma_m(rows: Rows) -> FloatArray:
    sigma = np.where(np.isfinite(rows["hdop"]), rows["hdop"] * UERE_M, UNKNOWN_SIGMA_M)
    sigma = np.where(np.isfinite(rows["acc_m"]), rows["acc_m"] * SIGMA_OF_RADIUS68, sigma)
    return np.where(
        rows["quality"] == DEAD_RECKONING, np.hypot(sigma, DEAD_RECKONING_SIGMA_M), sigma
    )


def observe(fixes: Rows, scans: Rows, readings: Rows) -> Observations:
    """Join the tables of a run; see `track_of` for what is raised.

    A reading belongs to the middle of its scan; the walker's place then is interpolated between the
    fixes around it.
    """
    track = track_of(fixes)
    middle_ns = times_ns(scans, readings)
    x_m, y_m, sigma_m, known = _places(track, middle_ns, readings["fix_seq"])
    sigma_m = np.hypot(sigma_m, _smear_m(track, readings["t_start_ns"], readings["t_ns"]))
    level_dbm = levels_dbm(readings)
    named, heard = readings["cell"] != b"", np.isfinite(level_dbm)
    usable = known & named & heard
    columns = (middle_ns, x_m, y_m, sigma_m, level_dbm, readings["seq"], timing_advances(readings))
    cells = _split(
        track.utm, readings["cell"][usable], readings["rat"][usable], [c[usable] for c in columns]
    )
    return Observations(
        track,
        cells,
        n_readings=len(readings),
        n_without_position=int(np.count_nonzero(named & heard & ~known)),
        n_without_identity=int(np.count_nonzero(~named)),
        n_without_level=int(np.count_nonzero(named & ~heard)),
    )


def timing_advances(readings: Rows) -> IntArray:
    """Steps of 553.5 m, -1 where unknown: only of the serving cell, and the steps of other
    technologies are others.
    """
    ta = readings["ta"]
    told = (
        (readings["role"] == b"serving") & (readings["rat"] == b"GSM") & (ta >= 0) & (ta <= LAST_TA)
    )
    return np.where(told, ta, -1).astype(np.int64)


def times_ns(scans: Rows, readings: Rows) -> IntArray:
    """Middle of the scan that each reading came from; the end of it where damage has taken the
    scan's own row.
    """
    if not len(scans):
        return np.asarray(readings["t_ns"], np.int64)
    at, found = _index_of(scans["seq"], readings["seq"])
    return np.where(found, (scans["t_start_ns"] + scans["t_ns"])[at] // 2, readings["t_ns"])


def scan_times_ns(scans: Rows, obs: CellObservations) -> tuple[IntArray, IntArray]:
    """Begin and end of the scan of each reading; twice the reading's time where damage has taken
    the scan's own row.
    """
    if not len(scans):
        return obs.t_ns, obs.t_ns
    at, found = _index_of(scans["seq"], obs.scan_seq)
    return np.where(found, scans["t_start_ns"][at], obs.t_ns), np.where(
        found, scans["t_ns"][at], obs.t_ns
    )


def _places(
    track: Track, t_ns: IntArray, fix_seq: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Walker's place, its sigma and whether it is known, at each time."""
    origin = track.t_ns[0]
    fix_s, t_s = (track.t_ns - origin) / 1e9, (t_ns - origin) / 1e9
    after = np.searchsorted(fix_s, t_s)
    before_i, after_i = np.maximum(after - 1, 0), np.minimum(after, len(fix_s) - 1)
    since_s, until_s = t_s - fix_s[before_i], fix_s[after_i] - t_s
    inside = (since_s >= 0) & (until_s >= 0) & (since_s + until_s <= MAX_GAP_S)
    known = inside | (np.minimum(np.abs(since_s), np.abs(until_s)) <= MAX_BEYOND_S)
    x_m, y_m, sigma_m = (
        np.interp(t_s, fix_s, values) for values in (track.x_m, track.y_m, track.sigma_m)
    )
    # several places within one tick of an imported file's clock: each reading keeps its own
    own, found = _index_of(track.seq, fix_seq)
    exact = found & (track.t_ns[own] == t_ns)
    for place, values in ((x_m, track.x_m), (y_m, track.y_m), (sigma_m, track.sigma_m)):
        place[exact] = values[own[exact]]
    return x_m, y_m, sigma_m, known


def smeared_sigma_m(length_m: npt.ArrayLike) -> FloatArray:
    """Standard deviation per axis of a place somewhere on a way of this length."""
    return np.asarray(np.asarray(length_m, float) / np.sqrt(12.0), float)


def _smear_m(track: Track, start_ns: IntArray, end_ns: IntArray) -> FloatArray:
    """Sigma that the way walked during each scan adds; none where the run does not tell when it
    began.
    """
    fix_s = (track.t_ns - track.t_ns[0]) / 1e9
    start_s, end_s = (np.asarray(t_ns - track.t_ns[0], float) / 1e9 for t_ns in (start_ns, end_ns))
    moved = [
        np.interp(end_s, fix_s, values) - np.interp(start_s, fix_s, values)
        for values in (track.x_m, track.y_m)
    ]
    return np.asarray(
        np.where(start_ns == UNKNOWN_TIME, 0.0, smeared_sigma_m(np.hypot(*moved))), float
    )


def _index_of(seqs: IntArray, wanted: IntArray) -> tuple[IntArray, npt.NDArray[np.bool_]]:
    """Where each wanted number stands in `seqs`, and whether it is there."""
    order = np.argsort(seqs)
    at = order[np.minimum(np.searchsorted(seqs, wanted, sorter=order), len(seqs) - 1)]
    return at, seqs[at] == wanted


def _split(
    utm: Utm,
    names: npt.NDArray[np.bytes_],
    rats: npt.NDArray[np.bytes_],
    columns: list[npt.NDArray[np.generic]],
) -> tuple[CellObservations, ...]:
    unique, which = np.unique(names, return_inverse=True)
    cells = []
    for i, name in enumerate(unique):
        mine = np.flatnonzero(which == i)
        mine = mine[np.argsort(columns[0][mine], kind="stable")]
        *levels, ta = (column[mine] for column in columns)
        rat = rats[mine[0]].decode() or None
        obs = CellObservations(name.decode(), rat, utm, *levels)  # type: ignore[arg-type]
        told = np.asarray(ta, np.int64)
        cells.append(replace(obs, ta=told) if np.any(told >= 0) else obs)
    return tuple(sorted(cells, key=len, reverse=True))
