"""Test of a transmitter that stands against one that moves steadily.

For a transmitter with velocity v the levels depend on the walk as it sees it: on the positions
x - v t. So the evidence of a velocity is that of a standing transmitter for the walk shifted by
-v t, with every other unknown counted as usual. The velocities tried are equally likely beforehand,
and the mean of their evidence is compared with that of v = 0 (Bayes factor; Kass & Raftery, J. Am.
Stat. Assoc. 90(430), 1995). Time is the number of the reading: they come at an even pace.
"""

from dataclasses import replace
from math import log
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.mixture import log_sum
from logger.core.locator.posterior import Posterior
from logger.core.locator.quadtree import Effort
from logger.core.locator.two_source_test import FEWEST_READINGS, LIVE, Division, locate_part
from logger.core.model.blocks import NOTHING_CENSORED, single
from logger.core.model.prior import Prior
from logger.core.places import PLANE, Places
from logger.core.readings import Readings


def _ring(way_m: float, directions: int) -> FloatArray:
    """Ways (m, 2) of one length in evenly spaced directions."""
    angle = 2.0 * np.pi * np.arange(directions) / directions
    return way_m * np.stack([np.sin(angle), np.cos(angle)], axis=1)


MOVES_M = np.concatenate([_ring(250.0, 8), _ring(800.0, 12)])
"""Ways (m, 2) of the transmitter from the first reading to the last that are tried.

A shorter way is hardly more than a location's error. Between two neighbours the evidence of a move
in the middle is still far above that of standing.
"""
_EFFORT = Effort(most_squares=60, split_share=0.1, nodes=1, first_share=1.0, densest=0)
"""150 squares gave the same factors to a tenth, in twice the time."""
_MOST_BLOCKS = 30
_BLOCK_M = 25.0


class _Walk(NamedTuple):
    """Blocks of readings in a row (5, n) as `blocks.single` takes them, and when: -1 to 0."""

    rows: FloatArray
    time: FloatArray


class MotionTest:
    """Tries the moves of `MOVES_M` in turn, some at a time, and keeps what each explains."""

    def __init__(self) -> None:
        self._log_factor = np.full(len(MOVES_M), np.nan)
        self._end_m = np.zeros((len(MOVES_M), 2))
        self._next = 0
        self._utm = PLANE

    def try_moves(self, obs: Readings, posterior: Posterior, count: int) -> None:
        """Compare the next `count` moves with standing."""
        obs = obs.usable()
        obs = obs.part(obs.limit == 0)
        if len(obs) < FEWEST_READINGS:
            return
        self._utm = obs.utm
        prior = posterior.prior.of_station(posterior.station)
        prior = replace(prior, noise=LIVE.noise or prior.noise)
        walk = _in_blocks(obs)
        standing, _ = _evidence(walk, np.zeros(2), prior)
        for k in (self._next + np.arange(count)) % len(MOVES_M):
            moving, self._end_m[k] = _evidence(walk, MOVES_M[k], prior)
            self._log_factor[k] = posterior.trust * (moving - standing)
        self._next = (self._next + count) % len(MOVES_M)

    def division(self) -> Division | None:
        """The likeliest move, with the factor of all; None before every one has been tried."""
        if np.any(np.isnan(self._log_factor)):
            return None
        best = int(np.argmax(self._log_factor))
        log_factor = float(log_sum(self._log_factor)) - log(len(MOVES_M))
        start_m, end_m = self._end_m[best] - MOVES_M[best], self._end_m[best]
        one, other = (Places.of(*at_m, utm=self._utm) for at_m in (start_m, end_m))
        return Division(log_factor, one, other, is_in_time=True)


def _in_blocks(obs: Readings) -> _Walk:
    """Readings in a row: a block of the ground would have readings of different times."""
    number = np.arange(len(obs))
    block = number * min(_MOST_BLOCKS, len(obs)) // len(obs)
    count = np.bincount(block)
    at = obs.places
    columns = (at.x_m, at.y_m, obs.level_dbm, at.sigma_m**2)
    means = [np.bincount(block, column) / count for column in columns]
    time = np.bincount(block, number / (len(obs) - 1.0) - 1.0) / count
    return _Walk(np.stack([*means, count.astype(float)]), time)


def _evidence(walk: _Walk, move_m: FloatArray, prior: Prior) -> tuple[float, FloatArray]:
    """Log evidence of a move, and the place where it ends."""
    rows = walk.rows.copy()
    rows[:2] -= move_m[:, None] * walk.time
    part = locate_part(single(rows, _BLOCK_M, NOTHING_CENSORED), prior, _EFFORT)
    return float(log_sum(part.log_evidence)), part.place.xy_m[:, 0]
