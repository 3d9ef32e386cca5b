"""Whether the times of a track can be those of a walk.

A file whose "seconds" only count its rows has no speed. Smoothing in time then moves the fixes by
kilometres: it takes distant fixes for errors of the receiver.
"""

from collections.abc import Iterable

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.track import Track
from postproc.estimators.stale_fixes import steps
from postproc.estimators.walker import SmoothedTrack

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


def too_fast(track: Track) -> str | None:
    """Why the steps from fix to fix are too fast to be true; None where they are not."""
    speed_mps = _speeds_mps(track)
    if len(speed_mps) < _FEWEST:
        return None
    median_mps = float(np.median(np.minimum(speed_mps, _NO_TIME_MPS)))
    if median_mps <= FASTEST_MPS:
        return None
    how_fast = f"faster than {3.6 * median_mps:.0f} km/h"
    if median_mps >= _NO_TIME_MPS:
        how_fast = "made in no time"
    return f"every second step from fix to fix would be {how_fast}"


def too_many_apart(walks: Iterable[SmoothedTrack]) -> str | None:
    """Why the fixes of the parts of a walk contradict their times; None where they do not."""
    count = n = 0
    for walk in walks:
        count += int(np.count_nonzero(walk.outlier | moved_too_far(walk)))
        n += len(walk.outlier)
    if count < _FEWEST or count <= MOST_APART * n:
        return None
    return f"{count} of {n} fixes cannot belong to one path in these times"


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
