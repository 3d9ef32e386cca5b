"""Whether the times and the positions of a track can be those of a walk.

Telephones repeat their last position until they have moved some metres. A position that is repeated
to the last digit and then left with a jump was stale before the jump: in 30 of 42 drive tests by
100 m, which a smoother turns into speeds and stops that never were.

Some files have no clock: their "seconds" count the rows, or were computed from the way at one
speed. Smoothing in such a time moves the fixes by kilometres: it takes distant fixes for errors of
the receiver. Times with an impossible speed only the user can mend.
"""

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.places import TIMING_S, Track, smeared_sigma_m
from logger.core.types import Fix
from logger.core.walker import SmoothedTrack

FASTEST_MPS = 60.0
"""Half of the steps faster than 216 km/h: no walk, no bus and hardly a train."""
MOST_APART = 0.1
"""Of 62 drive tests with real times at most 0.05 of the fixes are set aside or moved beyond their
accuracy. With the number of the row for seconds it is 0.4 to 0.6 of those that were measured from a
car every few seconds.
"""
_FEWEST = 3
"""Steps, or fixes set aside: one or two errors of a receiver do not discredit the times."""
_NO_TIME_MPS = 1e6  # several fixes of one time have no finite speed
_FEWEST_STEPS = 10
"""In time, from which a pattern of theirs can be told."""
FIRST_DATED_NS = 10**8 * 10**9
"""1973: times before count from the start of something."""
_EVEN_SHARE = 0.95
"""Of the steps of a count are equal: rows may have been left out."""
_EVEN_NS = 1000  # rounding of decimal fractions
_LEAP_FACTOR = 5.0
"""A leap is more than so many times as fast as the steps beside it."""
_START_MPS2 = 4.0
"""A car that starts between two fixes does not accelerate more."""
_SURE_LEAP_M = 50.0
"""One that exceeds all this by so much is enough: a receiver that finds its position seldom moves
by more."""
_ONE_SPEED = 0.005
"""Measured speeds differ by more than this share, if only by the errors of the fixes."""
_LONG_STEP_M = 7.0
"""Shorter ones have too few digits in a file to show a speed that exactly."""
_UNEVEN = 0.2
"""Relative spread of time steps: equal ones, at one speed, may be those of a vehicle."""
# latitudes and longitudes of all countries of a zone, the first digit of their codes (ITU-T E.212);
# the longitudes of zone 5 are no latitudes
_ZONES_DEG = {
    "2": (27.0, 84.0, -75.0, 180.0),
    "3": (7.0, 84.0, -180.0, -50.0),
    "4": (-1.0, 56.0, 34.0, 155.0),
    "6": (-47.0, 38.0, -26.0, 64.0),
    "7": (-57.0, 19.0, -93.0, -26.0),
}
SLOW_MPS = 0.5
"""Slow walk: a jump is assumed to have taken no longer than its length at this speed."""


def is_swapped(mcc: str | None, fix: Fix) -> bool:
    """Whether only latitude and longitude exchanged lie in the zone of a country code."""
    zone_deg = _ZONES_DEG.get((mcc or "")[:1])
    if zone_deg is None or fix.lat_deg is None or fix.lon_deg is None:
        return False
    at_deg = fix.lat_deg, fix.lon_deg
    return not _is_within(zone_deg, at_deg) and _is_within(zone_deg, at_deg[::-1])


def _is_within(zone_deg: tuple[float, ...], at_deg: tuple[float, ...]) -> bool:
    south, north, west, east = zone_deg
    return south <= at_deg[0] <= north and west <= at_deg[1] <= east


def why_no_clock(track: Track, *, is_dated: bool = False) -> str | None:
    """Why the times of a track were not taken from a clock; None where they may have been.

    Dated ones count no rows.
    """
    if not is_dated and _counts_rows(track):
        return "they count the rows"
    if _has_one_speed(track):
        return "they were computed from the way, at one speed"
    return None


def _counts_rows(track: Track) -> bool:
    """Whether times go on in equal steps over a way that does not."""
    step_ns = np.diff(track.t_ns)
    moving_ns = step_ns[step_ns > 0]
    if len(moving_ns) < _FEWEST_STEPS:
        return False
    pace_ns = int(np.median(moving_ns))
    if np.mean(np.abs(moving_ns - pace_ns) <= _EVEN_NS) < _EVEN_SHARE:
        return False
    if too_fast(track):
        return True
    step_m, step_s = steps(track)
    if not len(step_m):
        return False
    speed_mps = step_m / np.maximum(step_s, pace_ns / 1e9)
    padded_mps = np.pad(speed_mps, 1, mode="edge")  # nothing is known beyond the ends
    before_mps, after_mps = padded_mps[:-2], padded_mps[2:]
    errors_m = 2.0 * np.sqrt(2.0) * float(np.median(track.sigma_m))
    # from the slower neighbour's speed, or from that of both and back again in the same time
    start_m = 0.5 * _START_MPS2 * step_s**2
    one_m = _LEAP_FACTOR * np.minimum(before_mps, after_mps) * step_s + start_m
    both_m = _LEAP_FACTOR * np.maximum(before_mps, after_mps) * step_s + 0.5 * start_m
    over_m = step_m - errors_m - np.minimum(one_m, both_m)
    return bool(np.count_nonzero(over_m > 0.0) >= _FEWEST or np.any(over_m > _SURE_LEAP_M))


def _has_one_speed(track: Track) -> bool:
    """Whether each second step has the same speed, while time goes on unevenly."""
    step_m, step_s = steps(track)
    is_long = (step_m > _LONG_STEP_M) & (step_s > 0.0)
    if np.count_nonzero(is_long) < _FEWEST_STEPS:
        return False
    step_s = step_s[is_long]
    speed_mps = step_m[is_long] / step_s
    is_usual = np.abs(speed_mps / np.median(speed_mps) - 1.0) < _ONE_SPEED
    usual_s = step_s[is_usual]
    return bool(np.mean(is_usual) > 0.5 and np.std(usual_s) > _UNEVEN * np.mean(usual_s))


def too_fast(track: Track) -> str | None:
    """Why the steps from fix to fix, or all together, are too fast to be true; None if not."""
    speed_mps = _speeds_mps(track)
    if len(speed_mps) < _FEWEST:
        return None
    what, mps = "every second step from fix to fix", float(np.median(speed_mps))
    if mps <= FASTEST_MPS:  # short steps are no more than errors of the fixes
        what, mps = "the way as a whole", _whole_mps(track)
    if mps <= FASTEST_MPS:
        return None
    how_fast = "made in no time"
    if mps < _NO_TIME_MPS:
        how_fast = f"faster than {3.6 * mps:.0f} km/h"
    return f"{what} would be {how_fast}"


def _whole_mps(track: Track) -> float:
    # of half of the fixes, in all of the time: a few far off are no way
    sides_m = np.ptp(np.quantile(np.stack([track.x_m, track.y_m]), (0.25, 0.75), axis=1), axis=0)
    way_m = float(np.hypot(*sides_m)) - 4.0 * float(np.median(track.sigma_m))
    return max(way_m, 0.0) * 1e9 / max(int(np.ptp(track.t_ns)), 1)


def too_many_apart(walk: SmoothedTrack) -> str | None:
    """Why the fixes of a walk contradict their times; None where they do not."""
    count, n = int(np.count_nonzero(walk.outlier | moved_too_far(walk))), len(walk.outlier)
    if count < _FEWEST or count <= MOST_APART * n:
        return None
    return f"{count} of {n} fixes do not fit on one path in their times"


def _speeds_mps(track: Track) -> FloatArray:
    """Speed of each step between positions; 0 for one no longer than the errors of the fixes."""
    step_m, step_s = steps(track)
    is_step = step_m > 2.0 * float(np.median(track.sigma_m))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(is_step, step_m / step_s, 0.0), float)


def moved_m(walk: SmoothedTrack) -> FloatArray:
    """Distance of each fix from the walker's smoothed position at its time, shape (n,)."""
    smooth, track = walk.at(walk.track.t_ns), walk.track
    return np.asarray(np.hypot(smooth.x_m - track.x_m, smooth.y_m - track.y_m), float)


def moved_too_far(walk: SmoothedTrack) -> BoolArray:
    """Which fixes are used and yet farther than 3 sigma from the walker's smoothed position."""
    return np.asarray((moved_m(walk) > 3.0 * walk.track.sigma_m) & ~walk.outlier, np.bool_)


def _changes(track: Track) -> IntArray:
    """Numbers of the fixes with another position than the one before, the first included."""
    moved = (np.diff(track.x_m) != 0.0) | (np.diff(track.y_m) != 0.0)
    return np.flatnonzero(np.append(True, moved))


def steps(track: Track) -> tuple[FloatArray, FloatArray]:
    """Length in metres and time in seconds of each step between new positions, shape (m,)."""
    changed = track.part(_changes(track))
    return changed.steps_m, np.asarray(np.diff(changed.t_ns) / 1e9, float)


def without_stale(track: Track) -> Track:
    """The track without repeated positions that the walker may have left, just before a jump."""
    return track.part(_is_current(track))


def written_sigma_m(track: Track) -> FloatArray:
    """Sigma per axis that positions as written have beside those of their fixes, shape (n,).

    The walker may be anywhere between a stale position and the next, and levels may be late.
    """
    position = _position(track)
    step_m, step_s = steps(track)
    stale_m = np.where(_is_current(track), 0.0, np.append(step_m, 0.0)[position])
    speed_mps = np.divide(step_m, step_s, out=np.zeros_like(step_m), where=step_s > 0.0)
    fastest_mps = np.maximum(np.append(0.0, speed_mps), np.append(speed_mps, 0.0))[position]
    return np.asarray(np.hypot(smeared_sigma_m(stale_m), TIMING_S * fastest_mps), float)


def _position(track: Track) -> IntArray:
    first = _changes(track)
    return np.searchsorted(first, np.arange(len(track.t_ns)), side="right") - 1


def _is_current(track: Track) -> BoolArray:
    """Which fixes are no repeated positions that the walker may have left."""
    first = _changes(track)
    step_m, _ = steps(track)
    step_m[step_m <= track.sigma_m[first[1:]] + track.sigma_m[first[:-1]]] = 0.0  # may be no step
    step_m = np.append(step_m, 0.0)
    position = _position(track)
    next_ns = track.t_ns[np.append(first[1:], len(track.t_ns) - 1)]
    before_jump_s = (next_ns[position] - track.t_ns) / 1e9
    is_current = np.asarray(before_jump_s >= step_m[position] / SLOW_MPS, np.bool_)
    is_current[first] = True
    return is_current
