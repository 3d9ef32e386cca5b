"""The walker's track: fixes with a position, how accurate they are, and where the walker was."""

from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.errors import EstimationError
from logger.core.geo import Utm
from logger.core.rows import Rows
from logger.core.types import DEAD_RECKONING

MAX_GAP_S = 10.0
"""Positions between two fixes farther apart in time than this are not interpolated."""
MAX_BEYOND_S = 2.0
"""A reading may be this much older than the first fix or younger than the last one."""
UERE_M = 4.0
"""User equivalent range error of a single-frequency receiver, per axis: sigma = HDOP x this."""
SIGMA_OF_RADIUS68 = 1.0 / 1.5096
"""Sigma per axis of a round Gaussian from the radius that holds 68 % of it."""
UNKNOWN_SIGMA_M = 7.0
"""Sigma per axis of a fix without an accuracy: a receiver among houses."""
DEAD_RECKONING_SIGMA_M = 28.0
"""Additional sigma per axis of dead reckoning: a walker who has turned is off by 1.4 m/s x 20 s.

A receiver without satellites goes on along its last course for some 20 s; its own accuracy does not
include a turn.
"""
TIMING_S = 2.0
"""A level is an average over seconds, reported late (3GPP TS 45.008, 6.6.1: 5 s or more if idle).

The position of a reading is unsure by what the walker covers in this time.
"""


@dataclass(frozen=True, slots=True)
class Track:
    """Fixes with a position, in time order, in the zone of the first; arrays of shape (n,)."""

    utm: Utm
    t_ns: IntArray
    seq: IntArray
    x_m: FloatArray
    y_m: FloatArray
    sigma_m: FloatArray


class Positions(NamedTuple):
    """The walker at some times, shape (n,) each: position, sigma per axis, whether it is known."""

    x_m: FloatArray
    y_m: FloatArray
    sigma_m: FloatArray
    known: BoolArray


def track_of(fixes: Rows) -> Track:
    """Track from the table `fixes`.

    Raises `EstimationError` without a fix and `GeoError` beyond the map.
    """
    has_position = np.isfinite(fixes["lat_deg"]) & np.isfinite(fixes["lon_deg"])
    rows = fixes[(fixes["valid"] == 1) & has_position]
    if not len(rows):
        raise EstimationError("the run has no position fix, so nothing can be located")
    utm = Utm.at(float(rows["lat_deg"][0]), float(rows["lon_deg"][0]))
    rows = rows[np.argsort(rows["t_ns"], kind="stable")]
    x_m, y_m = utm.to_xy_arrays(rows["lat_deg"], rows["lon_deg"])
    return Track(utm, rows["t_ns"], rows["seq"], x_m, y_m, _sigma_m(rows))


def fix_sigma_m(acc_m: float | None, hdop: float | None, quality: int | None = None) -> float:
    """Standard deviation per axis of one fix."""
    sigma_m = UNKNOWN_SIGMA_M if hdop is None else hdop * UERE_M
    if acc_m is not None:
        sigma_m = acc_m * SIGMA_OF_RADIUS68
    return hypot(sigma_m, DEAD_RECKONING_SIGMA_M) if quality == DEAD_RECKONING else sigma_m


def _sigma_m(rows: Rows) -> FloatArray:
    """As `fix_sigma_m` for rows of the table `fixes`."""
    sigma_m = np.where(np.isfinite(rows["hdop"]), rows["hdop"] * UERE_M, UNKNOWN_SIGMA_M)
    sigma_m = np.where(np.isfinite(rows["acc_m"]), rows["acc_m"] * SIGMA_OF_RADIUS68, sigma_m)
    is_reckoned = rows["quality"] == DEAD_RECKONING
    return np.where(is_reckoned, np.hypot(sigma_m, DEAD_RECKONING_SIGMA_M), sigma_m)


def positions_at(track: Track, t_ns: IntArray, fix_seq: IntArray) -> Positions:
    """The walker at times (n,), interpolated between the fixes around each.

    `fix_seq` (n,) are the fixes that were current. One at exactly that time is used as it is, since
    an imported file may have several fixes within one tick of its clock.
    """
    fix_s, t_s = _seconds(track, track.t_ns), _seconds(track, t_ns)
    following = np.searchsorted(fix_s, t_s)
    since_s = t_s - fix_s[np.maximum(following - 1, 0)]
    until_s = fix_s[np.minimum(following, len(fix_s) - 1)] - t_s
    is_between = (since_s >= 0) & (until_s >= 0) & (since_s + until_s <= MAX_GAP_S)
    is_beside = np.minimum(np.abs(since_s), np.abs(until_s)) <= MAX_BEYOND_S
    current, has_fix = index_of(track.seq, fix_seq)
    exact = has_fix & (track.t_ns[current] == t_ns)

    def at_times(values: FloatArray) -> FloatArray:
        return np.where(exact, values[current], np.interp(t_s, fix_s, values))

    x_m, y_m, sigma_m = map(at_times, (track.x_m, track.y_m, track.sigma_m))
    return Positions(x_m, y_m, sigma_m, is_between | is_beside)


def smeared_sigma_m(length_m: npt.ArrayLike) -> FloatArray:
    """Standard deviation per axis of a position somewhere along a way of this length."""
    return np.asarray(np.asarray(length_m, float) / np.sqrt(12.0), float)


def way_sigma_m(track: Track, start_ns: IntArray, end_ns: IntArray) -> FloatArray:
    """Sigma that the way walked between two times adds, shape (n,)."""
    fix_s, start_s, end_s = (_seconds(track, t_ns) for t_ns in (track.t_ns, start_ns, end_ns))
    moved_m = [
        np.interp(end_s, fix_s, values) - np.interp(start_s, fix_s, values)
        for values in (track.x_m, track.y_m)
    ]
    return smeared_sigma_m(np.hypot(*moved_m))


def index_of(seqs: IntArray, wanted: IntArray) -> tuple[IntArray, BoolArray]:
    """Index of each wanted number in `seqs`, and whether it is there; shape (n,) each."""
    order = np.argsort(seqs)
    after = np.searchsorted(seqs, wanted, sorter=order)
    index = order[np.minimum(after, len(seqs) - 1)]
    return index, seqs[index] == wanted


def _seconds(track: Track, t_ns: IntArray) -> FloatArray:
    """Seconds since the first fix."""
    return np.asarray(t_ns - track.t_ns[0], float) / 1e9
