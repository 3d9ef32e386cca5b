"""Places that were told again: a log that repeats the last place it had says nothing new of where
the walker is.

Telephones tell a program the last place they know, and a new one only after so many metres.
Repeated to the last digit and then left with a jump, a place was old before the jump: in 30 of 42
drive tests by 100 m, which a smoother takes for speeds and stops that never were.
"""

from dataclasses import replace

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.observations import Track

SLOW_MPS = 0.5
"""Who covers the way of a jump has set out no earlier than it takes at this speed."""


def begins(track: Track) -> IntArray:
    """Numbers of the fixes that tell another place than the one before, the first included."""
    moved = (np.diff(track.x_m) != 0.0) | (np.diff(track.y_m) != 0.0)
    return np.flatnonzero(np.append(True, moved))


def steps(track: Track) -> tuple[FloatArray, FloatArray]:
    """Length in metres and time in seconds of each step from a place told first to the next, shape
    (m,).
    """
    first = begins(track)
    step_m = np.hypot(np.diff(track.x_m[first]), np.diff(track.y_m[first]))
    return np.asarray(step_m, float), np.asarray(np.diff(track.t_ns[first]) / 1e9, float)


def fresh(track: Track) -> Track:
    """The track without the repeated places that a walker may have left by then: those shortly
    before a jump.
    """
    first = begins(track)
    place = np.searchsorted(first, np.arange(len(track.t_ns)), side="right") - 1
    step_m, _ = steps(track)
    step_m = np.append(
        np.where(step_m > track.sigma_m[first[1:]] + track.sigma_m[first[:-1]], step_m, 0.0), 0.0
    )
    next_ns = track.t_ns[np.append(first[1:], len(track.t_ns) - 1)]
    left = (next_ns[place] - track.t_ns) / 1e9 < step_m[place] / SLOW_MPS
    kept = ~left
    kept[first] = True
    columns = ("t_ns", "seq", "x_m", "y_m", "sigma_m")
    return replace(track, **{name: getattr(track, name)[kept] for name in columns})
