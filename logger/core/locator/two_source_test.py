"""Test of one transmitter that stands against two that share the identity, or one that moves.

The walk is divided in two by which of two positions is nearer, and each part located alone. Two
transmitters are accepted where the walk passes both, and two posteriors under the same noise
explain the levels far better than one: their evidence counts every unknown of both (Bayes factor;
Kass & Raftery, J. Am. Stat. Assoc. 90(430), 1995).

For a transmitter with velocity v the levels depend on the positions x - v t. So the evidence of a
velocity is that of a standing transmitter for the walk shifted by -v t, with every other unknown
counted as usual. The velocities tried are equally likely beforehand, and the mean of their evidence
is compared with that of v = 0. Time is the number of the reading: they come at an even pace.
"""

from dataclasses import replace
from math import log
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.locator.mixture import log_sum
from logger.core.locator.posterior import Posterior
from logger.core.locator.quadtree import Effort
from logger.core.locator.search import search_once
from logger.core.model.blocks import (
    NOTHING_CENSORED,
    READINGS_BELIEVED,
    Blocks,
    blocks,
    join,
    single,
)
from logger.core.model.columns import varying_columns
from logger.core.model.prior import NOISE, NoiseGroup, Prior, Station
from logger.core.places import PLANE, Places
from logger.core.readings import Readings

LEAST_LOG_FACTOR = 4.0
"""55 to 1: strong to very strong evidence (Kass & Raftery, sec. 3.2).

Of 300 simulated walks past two sources 295 exceed it, of 253 measured ones past one source 3.
"""

_LEAST_LONG_SHARE = 0.5
"""What one transmitter leaves unexplained looks like shadowing over hundreds of metres."""
_FEWEST_BLOCKS = 8  # of a part: twice the unknowns of a transmitter
FEWEST_READINGS = 40
"""A shorter walk is not divided."""
_MOST_MOMENTS = 4  # between runs
_PASSED_M = 200.0  # a walk that comes no closer to a position does not pass it
_APART = 0.12  # of peaks, by the extent of the walk
_PEAK_REACH = 0.7  # by that distance: a peak is the highest level within it
_SMOOTHING = 0.03  # of the level, by the extent of the walk
_HOPELESS = -10.0  # log factor of a first division that no further turn makes plausible
_IMPOSSIBLE = -1e9  # log evidence of a hypothesis that one of the parts rules out


class DivisionEffort(NamedTuple):
    """How thoroughly two transmitters are tried.

    Parts of the walk are located with `search` under the hypotheses `noise` (None: those of the
    prior). `rivals` are the peaks of the level besides the highest one, `turns` those of division
    and location.
    """

    search: Effort
    rivals: int
    turns: int
    noise: tuple[NoiseGroup, ...] | None = None


DESK = DivisionEffort(
    Effort(
        most_squares=800,
        split_share=0.01,
        nodes=1,
        first_share=1.0,
        densest=0,
        most_blocks=80,
    ),
    rivals=3,
    turns=3,
)
"""Ten locations or so."""
LIVE = DivisionEffort(
    Effort(most_squares=250, split_share=0.03, nodes=1, densest=0, most_blocks=50),
    rivals=1,
    turns=2,
    noise=tuple(
        group._replace(hypotheses=group.hypotheses[1::3] or group.hypotheses) for group in NOISE
    ),
)
"""On the device: a twentieth of the time."""


class Division(NamedTuple):
    """Two positions that together explain the levels.

    `log_factor` is the log Bayes factor against one position, raised to the power of the trust in
    the noise as the likelihood of positions is; `is_in_time`: one after the other.
    """

    log_factor: float
    one: Places
    other: Places
    is_in_time: bool = False


class _Task(NamedTuple):
    """`tried` has the divisions so far by the bytes of `in_one`: several peaks lead to the same."""

    walk: Blocks
    prior: Prior
    effort: DivisionEffort
    trust: float
    undivided: float  # log evidence of one transmitter
    tried: dict[bytes, "_Try | None"]


class Part(NamedTuple):
    """Log evidence of each hypothesis, with its prior odds, and the likeliest transmitter."""

    log_evidence: FloatArray
    place: Places
    theta: FloatArray
    station: Station


def divide(obs: Readings, posterior: Posterior, effort: DivisionEffort = DESK) -> Division | None:
    """The division that explains the levels best; None where the levels have one peak only.

    None as well where `posterior`, of one transmitter, leaves no more than shadowing unexplained,
    and for several modems, whose offsets would divide a walk too.
    """
    obs = obs.usable()
    is_divisible = obs.n_modems <= 1 and _is_long(obs)
    if posterior.long_share < _LEAST_LONG_SHARE or not is_divisible:
        return None
    walk = join([blocks(obs, effort.search.most_blocks)])
    first, *others = _peaks(walk, effort.rivals)
    if not others:
        return None
    task = _task(walk, posterior, effort)
    tries = [_try(task, _nearer(walk, first, other)) for other in others]
    improved = (_improve(task, one) for one in tries)
    return max((one for one in improved if one is not None), key=_rank, default=None)


def divide_in_time(
    obs: Readings, posterior: Posterior, effort: DivisionEffort = DESK
) -> Division | None:
    """The readings before and after a moment, each part with a transmitter of its own.

    It reveals a transmitter that jumps, between runs or within one. None for one run of several
    modems, and for a walk too short.
    """
    obs = obs.usable()
    if not _is_long(obs):
        return None
    moments = _moments(obs)
    if posterior.offsets is not None:  # those that suit one transmitter best, which parts need not
        obs = replace(obs.on_one_scale(posterior.offsets.mean_db), modem=None)
    found = [_divided_at(obs, is_early, posterior, effort) for is_early in moments]
    tries = [one for one in found if one is not None]
    if not tries:
        return None
    best = max(tries, key=lambda one: one.log_factor)
    # each moment is as likely beforehand
    log_factor = float(log_sum(np.array([one.log_factor for one in tries]))) - log(len(tries))
    return best._replace(log_factor=log_factor).division(posterior.trust, is_in_time=True)


def _moments(obs: Readings) -> list[BoolArray]:
    """Which readings (n,) are early; offsets of several modems would divide a run too."""
    n = len(obs)
    parts = [] if obs.run is None else [obs.run <= run for run in np.unique(obs.run)[:-1]]
    parts.sort(key=lambda is_early: abs(2 * np.count_nonzero(is_early) - n))
    long_enough = [
        is_early
        for is_early in parts[:_MOST_MOMENTS]
        if FEWEST_READINGS <= 2 * np.count_nonzero(is_early) <= 2 * n - FEWEST_READINGS
    ]
    if long_enough or obs.n_modems > 1:
        return long_enough
    return [np.arange(n) < n // 2]


def _divided_at(
    obs: Readings, is_early: BoolArray, posterior: Posterior, effort: DivisionEffort
) -> "_Try | None":
    halves = [
        blocks(obs.part(chosen), effort.search.most_blocks // 2) for chosen in (is_early, ~is_early)
    ]
    walk = join(halves)
    in_one = np.arange(len(walk)) < len(halves[0])
    return _try(_task(walk, posterior, effort), in_one)


def _is_long(obs: Readings) -> bool:
    # a short one has no parts
    return bool(np.count_nonzero(obs.limit == 0) >= FEWEST_READINGS)


def _task(walk: Blocks, posterior: Posterior, effort: DivisionEffort) -> _Task:
    prior = replace(posterior.prior, stations=_stations(posterior))
    prior = prior if effort.noise is None else replace(prior, noise=effort.noise)
    undivided = float(log_sum(locate_part(walk, prior, effort.search).log_evidence))
    return _Task(walk, prior, effort, posterior.trust, undivided, {})


def _stations(posterior: Posterior) -> tuple[Station, ...]:
    """The walk's station; beside one with a pattern, one without.

    A pattern alone explains much of two transmitters: 11 of 300 were not detected.
    """
    chosen, every = posterior.station, posterior.prior.stations
    plain = [one for one in every if not one.antenna_db]
    if not chosen.antenna_db or not plain:
        return (chosen,)
    probability = sum(one.probability for one in plain)
    return plain[0]._replace(probability=probability), chosen


class _Try(NamedTuple):
    """A division by the blocks `in_one`, and where the first of its transmitters is `stronger`.

    `is_passed`: the walk comes near both transmitters.
    """

    log_factor: float
    is_passed: bool
    one: Part
    two: Part
    in_one: BoolArray
    stronger: BoolArray

    def division(self, trust: float, *, is_in_time: bool = False) -> Division:
        return Division(trust * self.log_factor, self.one.place, self.two.place, is_in_time)


def _try(task: _Task, in_one: BoolArray) -> _Try | None:
    """None where one of the parts is too short."""
    key = in_one.tobytes()
    if key not in task.tried:
        task.tried[key] = _locate_both(task, in_one)
    return task.tried[key]


def _locate_both(task: _Task, in_one: BoolArray) -> _Try | None:
    walk, prior = task.walk, task.prior
    if min(np.count_nonzero(in_one), np.count_nonzero(~in_one)) < _FEWEST_BLOCKS:
        return None
    one, two = (
        locate_part(walk.part(chosen), prior, task.effort.search) for chosen in (in_one, ~in_one)
    )
    both = one.log_evidence + two.log_evidence - prior.noise_table.log_odds
    nearest_m = [np.min(walk.places.distances_m(part.place)) for part in (one, two)]
    stronger = _expected_dbm(one, walk, prior) > _expected_dbm(two, walk, prior)
    log_factor = float(log_sum(both)) - task.undivided
    is_passed = bool(max(nearest_m) <= _PASSED_M)
    return _Try(log_factor, is_passed, one, two, in_one, stronger)


def _improve(task: _Task, best: _Try | None) -> Division | None:
    """Divide again by which of the two located transmitters is the stronger."""
    tries = [best]
    while best and best.log_factor > _HOPELESS and len(tries) < task.effort.turns:
        if np.array_equal(best.stronger, best.in_one):
            break
        best = _try(task, best.stronger)
        tries.append(best)
    divisions = [one.division(task.trust) for one in tries if one and one.is_passed]
    return max(divisions, key=_rank, default=None)


def _rank(division: Division) -> tuple[float, list[float]]:
    # exchanged parts have one factor: their places decide
    return division.log_factor, [*division.one.xy_m.flat, *division.other.xy_m.flat]


def _nearer(walk: Blocks, first: int, other: int) -> BoolArray:
    """Shape (n,)."""
    to_both_m = walk.places.distances_m(walk.places.part(np.array([first, other])))
    return np.asarray(to_both_m[:, 0] < to_both_m[:, 1], np.bool_)


def locate_part(part: Blocks, prior: Prior, effort: Effort) -> Part:
    """One transmitter by some of the blocks."""
    log_evidence = np.full((len(prior.hypotheses), len(prior.stations)), _IMPOSSIBLE)
    peaks = []
    for k, (station, log_odds) in enumerate(
        zip(prior.stations, prior.station_log_odds, strict=True)
    ):
        tree = search_once(part, prior.of_station(station), effort)
        log_mass = tree.log_mass()
        of_noise = (prior.noise_table.log_odds + log_odds)[tree.numbers]
        over_positions = log_sum(tree.evidence.log_p + log_mass - log_sum(log_mass))
        log_evidence[tree.numbers, k] = over_positions + of_noise
        log_p = tree.evidence.log_p + of_noise[:, None]
        c, h = np.unravel_index(np.argmax(log_p), log_p.shape)
        place = Places.of(tree.x_m[h], tree.y_m[h], utm=part.places.utm)
        peaks.append((log_p[c, h], place, tree.evidence.theta[:, c, h], station))
    _, place, theta, station = max(peaks, key=lambda peak: float(peak[0]))
    return Part(log_sum(log_evidence), place, theta, station)


def _expected_dbm(part: Part, walk: Blocks, prior: Prior) -> FloatArray:
    """Shape (n,)."""
    varying = varying_columns(walk, prior.of_station(part.station), part.place)
    return np.asarray(part.theta[0] + np.concatenate(varying, axis=1) @ part.theta[1:], float)


def _peaks(walk: Blocks, rivals: int) -> list[int]:
    """Blocks where the smoothed level is highest and where else it has a peak, strongest first."""
    apart_m = walk.places.distances_m(walk.places)
    extent_m = float(np.max(apart_m))
    if extent_m <= 0.0:
        return [0]
    kernel = np.exp(-0.5 * (apart_m / (_SMOOTHING * extent_m)) ** 2)
    kernel *= np.minimum(walk.readings, READINGS_BELIEVED)
    smooth_dbm = kernel @ walk.level_dbm / np.sum(kernel, axis=1)
    peaks: list[int] = []
    for k in np.argsort(-smooth_dbm).tolist():
        is_apart = all(apart_m[k, peak] > _APART * extent_m for peak in peaks)
        if is_apart and _is_peak(smooth_dbm, apart_m[k] < _PEAK_REACH * _APART * extent_m, k):
            peaks.append(k)
        if len(peaks) > rivals:
            break
    return peaks


def _is_peak(smooth_dbm: FloatArray, near: BoolArray, k: int) -> bool:
    return bool(smooth_dbm[k] >= np.max(smooth_dbm[near]))


def _ring(way_m: float, directions: int) -> FloatArray:
    """Shape (m, 2), in evenly spaced directions."""
    angle = 2.0 * np.pi * np.arange(directions) / directions
    return way_m * np.stack([np.sin(angle), np.cos(angle)], axis=1)


MOVES_M = np.concatenate([_ring(250.0, 8), _ring(800.0, 12)])
"""Ways (m, 2) of the transmitter from the first reading to the last that are tried.

A shorter way is hardly more than a location's error. Between two neighbours the evidence of a move
in the middle is still far above that of standing.
"""
_MOVING_EFFORT = Effort(most_squares=60, split_share=0.1, nodes=1, first_share=1.0, densest=0)
"""150 squares gave the same factors to a tenth, in twice the time."""
_MOVING_BLOCKS = 30
_MOVING_BLOCK_M = 25.0


class MotionTest:
    """Tries the moves of `MOVES_M` in turn and keeps what each explains."""

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
        """The likeliest move, with the factor of all; None before all have been tried."""
        if np.any(np.isnan(self._log_factor)):
            return None
        best = int(np.argmax(self._log_factor))
        log_factor = float(log_sum(self._log_factor)) - log(len(MOVES_M))
        start_m, end_m = self._end_m[best] - MOVES_M[best], self._end_m[best]
        one, other = (Places.of(*at_m, utm=self._utm) for at_m in (start_m, end_m))
        return Division(log_factor, one, other, is_in_time=True)


def _in_blocks(obs: Readings) -> FloatArray:
    """Blocks of readings in a row (6, n): as `blocks.single` takes them, and when, -1 to 0.

    A block of the ground would have readings of different times.
    """
    number = np.arange(len(obs))
    block = number * min(_MOVING_BLOCKS, len(obs)) // len(obs)
    count = np.bincount(block)
    columns = (obs.x_m, obs.y_m, obs.level_dbm, obs.position_sigma_m**2)
    means = [np.bincount(block, column) / count for column in columns]
    time = np.bincount(block, number / (len(obs) - 1.0) - 1.0) / count
    return np.stack([*means, count.astype(float), time])


def _evidence(walk: FloatArray, move_m: FloatArray, prior: Prior) -> tuple[float, FloatArray]:
    """Also returns the place where the move ends."""
    rows = walk[:-1].copy()
    rows[:2] -= move_m[:, None] * walk[-1]
    part = locate_part(single(rows, _MOVING_BLOCK_M, NOTHING_CENSORED), prior, _MOVING_EFFORT)
    return float(log_sum(part.log_evidence)), part.place.xy_m[:, 0]
