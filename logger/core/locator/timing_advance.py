"""What the timing advance (TA) adds: a ring around each location where it was read.

In GSM the network sets the TA so that a burst arrives in time: the way to the base station and back
in symbols of 48/13 us, 553.5 m of distance each, 0 to 63 (3GPP TS 45.010). With d the distance, b a
bias of the complete walk and e an error of the location:

    TA = n    if    n <= (d + b + e) / 553.5 < n + 1

Everything nearer is 0, everything farther is 63. e is logistic: its distribution function is a
tanh, its tails are heavier than a Gaussian's. b is normal and summed over even nodes: TA that
change along a walk make the integrand narrow, and the few nodes of Gauss-Hermite would turn it into
false rings. A location may have any TA with a small probability, and a walk any bias (a repeater,
an outdated value, a wrong network), so that neither excludes a position.

TA alone locate a base station to about a step (Raitoharju, Ali-Loytty & Wirola, Estimation of base
station position using timing advance measurements, 2010). Wrong steps are frequent (Yost &
Panchapakesan, VTC 1998).

LTE answers a random access with steps of 16 Ts, 78.07 m, 0 to 1282 (TS 36.213 4.2.3). Repeaters and
fibre lengthen them on the whole walk, in one city by 15 km, and nothing shortens them: b is
one-sided, of density 1 / (1 + b / 200 m)**1.5, and its median over the locations counts.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.locator.mixture import log_sum
from logger.core.locator.region import Squares
from logger.core.model.blocks import FINEST_BLOCK_M, squares
from logger.core.places import Places
from logger.core.readings import LAST_LTE_TA, LAST_TA, Readings

STEP_M, LTE_STEP_M = 553.5, 78.07
SIGMA_M = 160.0
"""Errors within half a symbol: what TS 45.010 allows for the measurement of the base station."""
BIAS_M = 350.0
"""Rounding to the nearest symbol adds half a step to "from n on"; detours some 100 m."""
BIAS_SIGMA_M = 350.0
"""The phone may be off by a symbol, which is 320 m if uniform, and detours differ."""
LOCATION_M = 50.0
"""Side of a location: detours are the same for 30 to 50 m in cities (3GPP TR 38.901, 7.5-6).

Repeated TA within it add nothing.
"""

_OUTLIERS = 0.05
"""Probability of a TA that has nothing to do with the distance."""
_ANY_BIAS = 0.05
"""Probability that all TA of a walk have one arbitrary bias."""
_NEVER_SET = 0.5
"""A modem without a TA prints 0: a walk with only zeros is as likely that as a near cell."""
_MOST_LOCATIONS = 100
"""Of a walk: the time grows with them."""
_NODES = np.linspace(-3.0, 3.0, 21)
"""Biases in standard deviations: 105 m apart, closer than sigma."""
_DENSITY = np.exp(-0.5 * _NODES**2)
_DISAGREES = 0.05
"""A location disagrees if less of the posterior than this is where its TA fit."""
_LEAST_P = 1e-6
"""Squares with less probability do not change that share."""
_END_OF_REACH = 0.7
"""As `summary.END_OF_REACH`: rings stay within this part of the reach."""


class Timing(NamedTuple):
    """Timing advances by location, (k,) each; weights of the steps at one location add to 1.

    The antenna is `height_m` above the receiver; a bias of scale `longer_m` is one-sided.
    """

    places: Places
    step: FloatArray
    weight: FloatArray
    height_m: float
    step_m: float = STEP_M
    last: int = LAST_TA
    sigma_m: float = SIGMA_M
    bias_m: float = BIAS_M
    bias_sigma_m: float = BIAS_SIGMA_M
    longer_m: float = 0.0

    @property
    def reach_m(self) -> float:
        """How far beyond the walk a search has to reach so that all rings are inside."""
        if self.longer_m:
            return 0.0
        return float(np.max(self.step) + 1.0) * self.step_m / _END_OF_REACH

    def log_p(self, positions: Places) -> FloatArray:
        """Log probability of all TA for a base station at positions (h,)."""
        distance_m = self._distance_m(positions)
        middle_m = (self.step[:, None] + 0.5) * self.step_m
        if self.longer_m:
            bias_m = self._median(middle_m - distance_m)
            any_p = _ANY_BIAS * self.longer_m / (self.last * self.step_m)
            log_p = np.log((1.0 - _ANY_BIAS) * self._p_of_excess(bias_m) + any_p)
            return np.asarray(log_p + self._log_p_of_delay(distance_m + bias_m), float)
        p_near = (1.0 - _NEVER_SET) * (1.0 - _ANY_BIAS) * _DENSITY / np.sum(_DENSITY)
        terms = [
            log_of_node + self._log_p_of_delay(distance_m + BIAS_M + BIAS_SIGMA_M * node)
            for node, log_of_node in zip(_NODES, np.log(p_near), strict=True)
        ]
        # of biases that can be anything, -35 to 35 km, about one step fits
        bias_m = self.weight @ (middle_m - distance_m) / np.sum(self.weight)
        p = (1.0 - _NEVER_SET) * _ANY_BIAS / (2.0 * (LAST_TA + 1))
        if not np.any(self.step):
            p += _NEVER_SET
        terms.append(np.log(p) + self._log_p_of_delay(distance_m + bias_m))
        return log_sum(np.stack(terms, axis=-1))

    def near(self, square: FloatArray) -> BoolArray:
        """Which squares (3, h), rows x, y, side, may contain a part of a ring."""
        middle_m = (self.step[:, None] + 0.5) * self.step_m - self.bias_m
        off_m = np.abs(self._distance_m(Places.of(*square[:2])) - middle_m)
        reach_m = 0.5 * self.step_m + 2.0 * self.bias_sigma_m + np.sqrt(0.5) * square[2]
        return np.asarray(np.any(off_m < reach_m, axis=0), bool)

    def check(self, squares: Squares) -> "TimingCheck":
        """At how many locations the TA disagree with a posterior, beyond 2 sigma."""
        slack_m = 2.0 * float(np.hypot(self.sigma_m, self.bias_sigma_m))
        likely = squares.probability > _LEAST_P
        positions = Places.of(squares.x_m[likely], squares.y_m[likely])
        delay_m = self._distance_m(positions) + self.bias_m
        step = self.step[:, None]
        fits = (delay_m > step * self.step_m - slack_m) | (step == 0) | bool(self.longer_m)
        fits &= (delay_m < (step + 1.0) * self.step_m + slack_m) | (step == self.last)
        disagrees = fits @ squares.probability[likely] < _DISAGREES
        locations = round(float(np.sum(self.weight)))
        return TimingCheck(locations, round(float(np.sum(self.weight[disagrees]))))

    def _distance_m(self, positions: Places) -> FloatArray:
        """Distance to the antenna over positions (h,); shape (k, h)."""
        return np.asarray(np.hypot(self.places.distances_m(positions), self.height_m), float)

    def _log_p_of_delay(self, delay_m: FloatArray) -> FloatArray:
        """Log probability (h,) of all TA given the delays (k, h), with the bias included."""
        p = (1.0 - _OUTLIERS) * probability(
            self.step[:, None], delay_m, self.step_m, self.last, self.sigma_m
        )
        return np.asarray(self.weight @ np.log(p + _OUTLIERS / (self.last + 1)), float)

    def _median(self, excess_m: FloatArray) -> FloatArray:
        """Weighted median over the locations, (h,) of (k, h)."""
        order = np.argsort(excess_m, axis=0)
        below = np.cumsum(self.weight[order], axis=0)
        half = np.argmax(below >= 0.5 * below[-1], axis=0)
        return np.asarray(excess_m[order[half, np.arange(len(half))], np.arange(len(half))], float)

    def _p_of_excess(self, bias_m: FloatArray) -> FloatArray:
        """Of a one-sided bias, relative to none; an error of the phone lessens it."""
        is_longer = 0.5 + 0.5 * np.tanh(np.pi / (2.0 * np.sqrt(3.0)) * bias_m / self.bias_sigma_m)
        longer = np.maximum(bias_m, 0.0) / self.longer_m
        return np.asarray(is_longer * (1.0 + longer) ** -1.5, float)


_lte = partial(
    Timing,
    step_m=LTE_STEP_M,
    last=LAST_LTE_TA,
    # a base station finds a preamble to 1.04 us, 156 m (TS 36.104 8.4.2), and detours differ
    sigma_m=120.0,
    bias_m=0.0,
    bias_sigma_m=60.0,  # a phone's timing may be off by 12 Ts, 59 m (TS 36.133 7.1.2)
    longer_m=200.0,
)


class TimingCheck(NamedTuple):
    """At how many locations a TA was read, and at how many it disagrees with the result."""

    places: int
    disagree: int

    @property
    def warning(self) -> str | None:
        """One line if most disagree."""
        if 2 * self.disagree <= self.places:
            return None
        where = f"at {self.disagree} of {self.places} points"
        return f"the timing advance disagrees with the result {where}"


def probability(
    step: FloatArray,
    delay_m: FloatArray,
    step_m: float = STEP_M,
    last: int = LAST_TA,
    sigma_m: float = SIGMA_M,
) -> FloatArray:
    """Of TA = `step` given the delay as a distance, without outliers; sums to 1 over all steps."""
    rate = np.pi / (2.0 * np.sqrt(3.0) * sigma_m)
    below_end = np.tanh(rate * ((step + 1.0) * step_m - delay_m))
    below_begin = np.tanh(rate * (step * step_m - delay_m))
    below_end = np.where(step == last, 1.0, below_end)
    below_begin = np.where(step == 0, -1.0, below_begin)
    return np.asarray(0.5 * (below_end - below_begin), float)


def timing_of(obs: Readings, height_m: float = 0.0) -> Timing | None:
    """The timing advances of a walk gathered by location; None without any."""
    if obs.ta is None or not np.any(obs.ta >= 0):
        return None
    is_lte = obs.rat == "LTE"
    last = LAST_LTE_TA if is_lte else LAST_TA
    has_ta = obs.ta >= 0
    places, step = obs.places.part(has_ta), obs.ta[has_ta]
    scale = FINEST_BLOCK_M / LOCATION_M  # `squares` begins with the finest block
    modem = np.zeros(len(step), np.int64)
    scaled = Places.of(scale * places.x_m, scale * places.y_m)
    square, _ = squares(scaled, _MOST_LOCATIONS, modem)
    key = (last + 1) * square + step
    keys, index, count = np.unique(key, return_inverse=True, return_counts=True)
    means_m = (np.bincount(index, values) / count for values in (places.x_m, places.y_m))
    square_of_key, step_of_key = np.divmod(keys, last + 1)
    weight = count / np.bincount(square)[square_of_key]
    at = Places.of(*means_m, utm=places.utm)
    kind = _lte if is_lte else Timing
    return kind(at, step_of_key.astype(float), weight, height_m)
