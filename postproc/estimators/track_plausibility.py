"""Whether the times of a track can be those of a walk.

A file whose "seconds" only count its rows says nothing of speed. Smoothing in time then moves the
fixes by kilometres: it takes what is far away for an error of the receiver.
"""

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.observations import Track
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
"""Steps, or fixes set aside: one or two errors of a receiver say nothing of the times."""


def too_fast(track: Track) -> str | None:
    """Why the steps from fix to fix are too fast to be true; None where they are not."""
    speed_mps = _speeds_mps(track)
    if len(speed_mps) < _FEWEST or float(np.median(speed_mps)) <= FASTEST_MPS:
        return None
    # as many are slower as faster; several fixes of one time have no finite speed
    middle = float(np.median(np.minimum(speed_mps, 1e6)))
    how_fast = f"faster than {3.6 * middle:.0f} km/h" if middle < 1e6 else "made in no time"
    return f"every second step from fix to fix would be {how_fast}"


def too_many_apart(walked: SmoothedTrack) -> str | None:
    """Why the fixes contradict their times; None where they do not."""
    n, of = int(np.count_nonzero(walked.outlier | moved_too_far(walked))), len(walked.outlier)
    if n < _FEWEST or n <= MOST_APART * of:
        return None
    return f"{n} of {of} fixes cannot belong to one way in these times"


def _speeds_mps(track: Track) -> FloatArray:
    """Speed of each step from place to place; a step no longer than the errors of the fixes may be
    none.
    """
    step_m, step_s = steps(track)
    real = step_m > 2.0 * float(np.median(track.sigma_m))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(real, step_m / step_s, 0.0), float)


def moved_m(walked: SmoothedTrack) -> FloatArray:
    """How far each fix lies from where the walker is taken to have been at its time, shape (n,)."""
    at = walked.at(walked.track.t_ns)
    return np.asarray(np.hypot(at.x_m - walked.track.x_m, at.y_m - walked.track.y_m), float)


def moved_too_far(walked: SmoothedTrack) -> BoolArray:
    """Which fixes are used and yet farther from the walker's smoothed place than three times their
    sigma.
    """
    return np.asarray((moved_m(walked) > 3.0 * walked.track.sigma_m) & ~walked.outlier, np.bool_)
