"""Positions of the walker: the fixes of a run smoothed, with a true sigma.

Each axis has the state [p, v, b]: position, velocity, and the wandering part of the receiver's
error in units of its sigma s. Acceleration is white with density q, b is a first-order Gauss-Markov
process:

    p' = p + v dt,    v' = v,    cov(p', v') = q [[dt^3 / 3, dt^2 / 2], [dt^2 / 2, dt]]
    b' = a b,         var b' = 1 - a^2,    a = exp(-dt / WANDER_S)
    z_p = p + s b + white noise,           z_v = v + white noise

The error of a fix has three parts. The white one is smoothed away as far as the motion allows; the
wandering one averages out only while the walker stands for minutes; the lasting one is invisible in
one run and is added to the returned sigma. q and the white share are those of a small set that make
the fixes likeliest. Both axes have the same covariances, so one recursion serves the two.

Defaults: receivers at rest (Telit HE910, Quectel L76K; 2 to 3 minutes) had 0.01 to 0.07 m of white
noise and wandered by 0.15 to 1.2 m, half of it decorrelated after some 20 s, where HDOP claimed 3
to 6 m; one in motion (Quectel EG25-G) had 6 m of white noise. Over 20 days the errors of a Garmin
lost correlation fast within a minute and slowly over an hour (D. L. Wilson, "Correlation of
errors", erols.com/dlwilson).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import sqrt
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.places import (
    MAX_GAP_S,
    PLANE,
    TIMING_S,
    Places,
    Track,
    join_places,
    smeared_sigma_m,
)
from logger.core.readings import Readings
from logger.core.rows import Rows
from logger.core.types import Fix
from logger.core.walker_kalman import Model, Series, excess_variance, score, smooth

VELOCITY_SIGMA_MPS = 0.3
"""Per axis, of velocities a second apart; denser ones carry no more information."""
WANDER_S = 60.0
"""Decorrelation time of the wandering error, between those of the receivers above."""
LASTING_SHARE = 0.5
"""Share of the slow variance that lasts longer than a run."""
GAP_FACTOR = 4.0
"""Factor on q where fixes are more than MAX_GAP_S apart: in half a minute people turn and stop more
than their seconds tell. Of gaps of 10 to 120 s cut into 30 logs, the 95 % circle then held 98 % on
foot, 95 % by bike, 89 % in a car.
"""
ACCELERATIONS_M2S3 = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Candidates of q: the logs of people on foot chose 0.01 to 0.3 mostly, bikes 0.1 to 0.3, cars 1 to
3.
"""
WHITE_SHARES = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
"""Candidates of the sigma of the white part by the claimed sigma."""

_LEAST_SIGMA_M = 0.5  # no receiver without corrections is better
_STILL_MPS = 0.5  # receivers print no course below about this speed
_OUTLIER_SIGMA = 5.0
_DOUBTFUL_RUN = 3  # outliers in a row, from which on the rest may be the wrong part
_REWEIGHTINGS = 5  # after them the weights change by less than 1 %
_STRETCHES, _STRETCH = 5, 1000
"""Of a longer run, so many stretches of so many fixes tell q and the white share, which are means
over the run."""
_LONGEST_STEP_S = 3600.0  # beyond it nothing is known, and floats would lose the rest
_LEAST_STEP_S = 0.1  # for the rate of velocities: no receiver used here is faster
_MOST_FIXES = 2000
"""Fixes of a walk that goes on: half an hour, smoothed in .2 s of a laptop."""
_OVERLAP = 60
"""Fixes that are smoothed once more with those after them: a minute, in which errors wander."""
_FEWEST_FIXES = 10
"""For a likeliest motion."""


class Velocities(NamedTuple):
    """Velocity to grid east and north at each fix, shape (n,); sigma is infinite if unknown."""

    east_mps: FloatArray
    north_mps: FloatArray
    sigma_mps: FloatArray


@dataclass(frozen=True, slots=True)
class SmoothedTrack:
    """The walk between and beyond the fixes of `track`.

    `accel_m2s3` (q) and `white_share` are the likeliest. `outlier` (n,) marks fixes more than five
    sigma from the position by all others: they are hardly used. Where three or more follow each
    other either side may be right, so their distance `doubt_m` (n,) is part of the sigma.
    """

    track: Track
    accel_m2s3: float
    white_share: float
    outlier: BoolArray
    doubt_m: FloatArray
    series: Series

    @property
    def n_outliers(self) -> int:
        """Number of fixes set aside."""
        return int(np.count_nonzero(self.outlier))

    def at(self, t_ns: IntArray) -> Places:
        """Positions at any times, shape (n,); the farther from a fix, the less certain."""
        fix_s, t_s = _clock_s(self.track, self.track.t_ns), _clock_s(self.track, t_ns)
        mean, variance = interpolate(fix_s, self.series, self.accel_m2s3, t_s)
        lasting_m = sqrt(LASTING_SHARE * _slow_share(self.white_share)) * _claimed_m(self.track)
        variance = (
            variance
            + np.interp(t_s, fix_s, lasting_m) ** 2
            + np.interp(t_s, fix_s, self.doubt_m) ** 2
        )
        x_m, y_m = mean.T + np.array([[self.track.x_m[0]], [self.track.y_m[0]]])
        z_m = np.interp(t_s, fix_s, self.track.z_m)
        return Places(x_m, y_m, z_m, np.sqrt(variance), t_ns, self.track.utm)


def velocities(fixes: Rows, track: Track) -> Velocities:
    """Speed and course from the table `fixes`, joined to a track by record number.

    Unknown where the table has none.
    """
    order = np.argsort(fixes["seq"])
    number = np.searchsorted(fixes["seq"], track.seq, sorter=order)
    row = fixes[order[np.minimum(number, len(fixes) - 1)]]
    speed_mps = np.where(row["seq"] == track.seq, row["speed_mps"], np.nan)
    return _velocities(speed_mps, row["course_deg"], track)


def _velocities(speed_mps: FloatArray, course_deg: FloatArray, track: Track) -> Velocities:
    """At rest receivers print no course: below 0.5 m/s the velocity is zero, sigma the speed."""
    still = ~np.isfinite(course_deg) & (speed_mps < _STILL_MPS)
    moving = np.isfinite(speed_mps * course_deg)
    azimuth = np.radians(course_deg) - _convergence(track)
    east, north = (np.where(moving, speed_mps * f(azimuth), 0.0) for f in (np.sin, np.cos))
    sigma = np.hypot(VELOCITY_SIGMA_MPS, np.where(still, speed_mps, 0.0))
    return Velocities(east, north, np.where(still | moving, sigma, np.inf))


def _convergence(track: Track) -> FloatArray:
    """Azimuth of grid north, radians: tan = tan(dlon) sin(lat), dlon from the central meridian."""
    middle_deg = 6.0 * abs(track.utm.zone) - 183.0
    lat_deg, lon_deg = track.lat_lon_deg
    dlon = np.radians((lon_deg - middle_deg + 180.0) % 360.0 - 180.0)
    return np.asarray(np.arctan(np.tan(dlon) * np.sin(np.radians(lat_deg))), float)


def smooth_track(
    track: Track, velocity: Velocities | None = None, *, like: SmoothedTrack | None = None
) -> SmoothedTrack:
    """Smooth the fixes of a run, in time that grows linearly with their number.

    q and the white share are those of `like`, by default the likeliest.
    """
    excess = np.zeros((len(track.t_ns), 2))
    stretches = _stretches(len(track.t_ns))

    def likelihood(q: float, share: float) -> float:
        model = _model(track, velocity, q, share)
        return sum(score(model.part(some), excess[some]) for some in stretches)

    q, share = (like.accel_m2s3, like.white_share) if like else _likeliest(likelihood)
    model = _model(track, velocity, q, share)
    score(model, excess)  # the first weights come from the fixes before each
    series = smooth(model, excess)
    for _ in range(_REWEIGHTINGS):
        before, excess = excess, excess_variance(series.apart2, series.expected)
        if np.array_equal(excess, before):  # as without any outlier
            break
        series = smooth(model, excess)
    apart2 = series.apart2[:, 0]
    outlier = apart2 > _OUTLIER_SIGMA**2 * series.expected[:, 0]
    doubt_m = np.where(_in_a_run(outlier), np.sqrt(apart2), 0.0)
    return SmoothedTrack(track, q, share, outlier, doubt_m, series)


def _stretches(n: int) -> list[slice]:
    if n <= _STRETCHES * _STRETCH:
        return [slice(None)]
    begin = np.linspace(0, n - _STRETCH, _STRETCHES).astype(int).tolist()
    return [slice(first, first + _STRETCH) for first in begin]


def _in_a_run(outlier: BoolArray) -> BoolArray:
    """Which outliers belong to a run so long that the other fixes may be the wrong ones."""
    number = np.cumsum(~outlier)
    length = np.bincount(number[outlier], minlength=len(outlier) + 1)[number]
    return outlier & (length >= _DOUBTFUL_RUN)


def _model(track: Track, velocity: Velocities | None, q: float, share: float) -> Model:
    if velocity is None:
        none = np.zeros(len(track.t_ns))
        velocity = Velocities(none, none, np.full(len(none), np.inf))
    east, north, velocity_sigma = velocity
    claimed_m = _claimed_m(track)
    step_s = _steps_s(_clock_s(track, track.t_ns))
    z = np.stack([[track.x_m - track.x_m[0], east], [track.y_m - track.y_m[0], north]]).T
    rate = np.maximum(1.0 / np.maximum(step_s, _LEAST_STEP_S), 1.0)
    return Model(
        step_s,
        q * np.where(step_s > MAX_GAP_S, GAP_FACTOR, 1.0),
        np.exp(-step_s / WANDER_S),
        np.ascontiguousarray(z),
        claimed_m * sqrt((1.0 - LASTING_SHARE) * _slow_share(share)),
        np.column_stack([(share * claimed_m) ** 2, velocity_sigma**2 * rate]),
        np.column_stack([0.25 * claimed_m**2, 0.25 * velocity_sigma**2]),
    )


def _clock_s(track: Track, t_ns: IntArray) -> FloatArray:
    """Seconds since the first fix; a gap of more than an hour counts as an hour."""
    fix_s, t_s = ((times_ns - track.t_ns[0]) / 1e9 for times_ns in (track.t_ns, t_ns))
    beyond_s = np.clip(t_s - np.clip(t_s, 0.0, fix_s[-1]), -_LONGEST_STEP_S, _LONGEST_STEP_S)
    return np.asarray(np.interp(t_s, fix_s, np.cumsum(_steps_s(fix_s))) + beyond_s, float)


def _steps_s(t_s: FloatArray) -> FloatArray:
    return np.minimum(np.diff(t_s, prepend=t_s[0]), _LONGEST_STEP_S)


def _claimed_m(track: Track) -> FloatArray:
    return np.maximum(track.sigma_m, _LEAST_SIGMA_M)


def _slow_share(white_share: float) -> float:
    """Slow variance by the claimed one: what is not white, but half of the claim at least."""
    return max(1.0 - white_share**2, 0.5)


def _likeliest(likelihood: Callable[[float, float], float]) -> tuple[float, float]:
    """The best pair of candidates, one coordinate at a time: they hardly depend on each other."""
    q, share, cached = 0.1, 0.05, cache(likelihood)
    for _ in range(2):
        q = _climb(ACCELERATIONS_M2S3, q, partial(lambda share, q: cached(q, share), share))
        share = _climb(WHITE_SHARES, share, partial(cached, q))
    return q, share


def _climb(
    candidates: Sequence[float], begun: float, likelihood: Callable[[float], float]
) -> float:
    """The best of candidates, whose likelihood has one top: from `begun` as far as it rises."""
    at = candidates.index(begun)
    for step in (1, -1):
        while 0 <= at + step < len(candidates) and likelihood(candidates[at + step]) > likelihood(
            candidates[at]
        ):
            at += step
    return candidates[at]


def interpolate(
    fix_s: FloatArray, series: Series, q: float, t_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean (n, 2) and variance (n,) of the position at any times.

    Given the fixes up to the one before, p(t) has a mean, a variance and a covariance u with the
    state just before the next fix. With r and N of that fix the mean moves by u' r and the variance
    falls by u' N u. Before the first fix the walk is the same in reversed time.
    """
    last = len(fix_s) - 1
    before = np.clip(np.searchsorted(fix_s, t_s, side="right") - 1, 0, last)
    after = np.minimum(before + 1, last)
    dt, step_s = t_s - fix_s[before], fix_s[after] - fix_s[before]
    ahead = np.maximum(dt, 0.0)
    rest = step_s - ahead
    q_here = q * np.where(np.maximum(step_s, np.abs(dt)) > MAX_GAP_S, GAP_FACTOR, 1.0)
    p00, p01, p02 = series.p[before, 0].T
    _, p11, p12 = series.p[before, 1].T
    mean = series.x[before, 0] + dt[:, None] * series.x[before, 1]
    variance = p00 + 2.0 * dt * p01 + dt**2 * p11 + q_here * np.abs(dt) ** 3 / 3.0
    u0, u1, u2 = p00 + dt * p01, p01 + dt * p11, p02 + dt * p12
    u0, u1 = u0 + ahead * u1 + q_here * ahead**3 / 3.0, u1 + q_here * ahead**2 / 2.0
    u = np.column_stack([u0 + rest * u1, u1, u2 * np.exp(-step_s / WANDER_S)])
    r, n = series.r[after], series.n[after]
    u[before == last] = 0.0  # no fix follows
    mean += np.einsum("ni,nij->nj", u, r)
    return mean, variance - np.einsum("ni,nij,nj->n", u, n, u)


def places_during(
    at: Callable[[IntArray], Places], t_ns: IntArray, begin_ns: IntArray, end_ns: IntArray
) -> Places:
    """Places of scans by the walker's places `at` times; arrays of shape (n,).

    A level is an average over seconds or a scan: its place is unsure by the way walked then.
    """
    placed = at(t_ns)
    before, after = (at(t_ns + shift) for shift in (-(10**9) // 2, 10**9 // 2))
    late_m = TIMING_S * np.hypot(after.x_m - before.x_m, after.y_m - before.y_m)
    begun, ended = at(begin_ns), at(end_ns)
    smear_m = smeared_sigma_m(np.hypot(ended.x_m - begun.x_m, ended.y_m - begun.y_m))
    return replace(placed, sigma_m=np.sqrt(placed.sigma_m**2 + late_m**2 + smear_m**2))


class LiveTrack:
    """The walk so far, to place readings on the device as the desktop does.

    Its latest `_MOST_FIXES` are smoothed when readings are placed; older ones no longer change.
    Where times go back nothing is smoothed.
    """

    def __init__(self) -> None:
        self._utm = PLANE
        self._fixes: list[tuple[float, ...]] = []  # x, y, z, sigma, t_ns, speed, course
        self._settled: Places | None = None
        self._n, self._is_timed = 0, True
        self._scan_ns: dict[int, int] = {}  # lengths of long scans by their middle
        self._smoothed: SmoothedTrack | None = None
        self._like: SmoothedTrack | None = None  # whose motion is the likeliest, of so many fixes
        self._n_like = 0

    def add(self, place: Places, fix: Fix | None = None) -> None:
        """Take the next position, and the velocity of its fix if there is one."""
        since_ns = place.t_ns.item() - self._fixes[-1][4] if self._fixes else 1
        self._is_timed &= since_ns > -(10**9)  # two receivers may come in another order
        if since_ns <= 0:
            return
        speed_mps, course_deg = (fix.speed_mps, fix.course_deg) if fix else (None, None)
        velocity = (np.nan if one is None else one for one in (speed_mps, course_deg))
        columns = place.x_m, place.y_m, place.z_m, place.sigma_m, place.t_ns
        self._fixes.append((*(column.item() for column in columns), *velocity))
        self._utm, self._smoothed, self._n = place.utm, None, self._n + 1
        if len(self._fixes) == _MOST_FIXES:
            self._settle()

    def add_scan(self, begin_ns: int, end_ns: int) -> None:
        """Take a scan so long that the way walked counts."""
        self._scan_ns[(begin_ns + end_ns) // 2] = end_ns - begin_ns

    def place(self, obs: Readings) -> Readings:
        """The readings in order of time, at their smoothed places."""
        if len(self._fixes) < _FEWEST_FIXES or not self._is_timed:
            return obs
        obs = obs.part(np.argsort(obs.t_ns, kind="stable"))
        half_ns = np.array([self._scan_ns.get(t_ns, 0) for t_ns in obs.t_ns.tolist()]) // 2
        places = places_during(self._at, obs.t_ns, obs.t_ns - half_ns, obs.t_ns + half_ns)
        return replace(obs, places=places)

    def _at(self, t_ns: IntArray) -> Places:
        if self._smoothed is None:
            self._smoothed = self._smooth()
        placed = self._smoothed.at(t_ns)
        if self._settled is None:
            return placed
        is_old = t_ns <= self._settled.t_ns[-1]
        return placed.with_others(is_old, self._settled.at(t_ns))

    def _settle(self) -> None:
        half = _MOST_FIXES // 2
        smoothed = self._smooth()
        places = smoothed.at(smoothed.track.t_ns[:half])
        if self._settled is not None:
            is_new = places.t_ns > self._settled.t_ns[-1]
            places = join_places([self._settled, places.part(is_new)])
        self._settled, self._fixes = places, self._fixes[half - _OVERLAP :]

    def _smooth(self) -> SmoothedTrack:
        x_m, y_m, z_m, sigma_m, t_ns, speed_mps, course_deg = np.array(self._fixes).T
        seq = np.arange(len(t_ns))
        track = Track(x_m, y_m, z_m, sigma_m, t_ns.astype(np.int64), self._utm, seq=seq)
        like = self._like if self._n < 2 * self._n_like else None
        smoothed = smooth_track(track, _velocities(speed_mps, course_deg, track), like=like)
        if like is None:
            self._like, self._n_like = smoothed, self._n
        return smoothed
