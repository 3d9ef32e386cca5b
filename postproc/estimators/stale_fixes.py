"""Repeated fixes: a log that repeats its last position contains no new one.

Telephones report the last position they have, and a new one only after so many metres. A position
that is repeated to the last digit and then left with a jump was stale before the jump: in 30 of 42
drive tests by 100 m, which a smoother turns into speeds and stops that never were.
"""

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.places import TIMING_S, Track, smeared_sigma_m

SLOW_MPS = 0.5
"""Slow walk: a jump is assumed to have taken no longer than its length at this speed."""


def _changes(track: Track) -> IntArray:
    """Numbers of the fixes with another position than the one before, the first included."""
    moved = (np.diff(track.x_m) != 0.0) | (np.diff(track.y_m) != 0.0)
    return np.flatnonzero(np.append(True, moved))


def steps(track: Track) -> tuple[FloatArray, FloatArray]:
    """Length in metres and time in seconds of each step between new positions, shape (m,)."""
    first = _changes(track)
    step_m = np.hypot(np.diff(track.x_m[first]), np.diff(track.y_m[first]))
    return np.asarray(step_m, float), np.asarray(np.diff(track.t_ns[first]) / 1e9, float)


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
    """Number of the position of each fix, where repeated ones are one."""
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
