"""What the GSM timing advance (TA) says about places: a ring of some hundred metres around each
place it was read at.

The network sets the TA so that a burst arrives in time: the way to the base station and back in
symbols of 48/13 us,
553.5 m of distance each, 0 to 63 (3GPP TS 45.010). With d the distance, b a bias common to the walk and e an error of
the place:

    TA = n    where    n <= (d + b + e) / 553.5 < n + 1,    and everything nearer at 0, everything farther at 63

e is logistic, so that its distribution function is a tanh and its tails are heavier than a
Gaussian's. b is normal and summed over even nodes: TA that change along a walk make the integrand
narrow, which the few nodes of Gauss-Hermite would turn into rings that are not there. A place may
have any TA at all with a small probability, and so may the whole walk have any bias (a repeater, an
old value, a network that lies): neither excludes a place.

TA alone locate a base station to about a step (Raitoharju, Ali-Loytty & Wirola, Estimation of base
station position using timing advance measurements, 2010); that the wrong step is often told: Yost &
Panchapakesan, VTC 1998.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.locator.mixture import log_sum
from logger.core.locator.region import Squares
from logger.core.model.blocks import FINEST_BLOCK_M, squares
from logger.core.observations import LAST_TA, CellObservations

STEP_M = 553.5
SIGMA_M = 160.0
"""Standard deviation of an error within half a symbol: what TS 45.010 allows the base station's
measure.
"""
BIAS_M = 350.0
BIAS_SIGMA_M = 350.0
"""The standard rounds to the nearest symbol, which is half a step more than "from n on", and
detours add some 100 m; the phone's own timing may be off by a symbol, which evenly is 320 m, and
detours differ.
"""
PLACE_M = 50.0
"""Side of a place: detours are the same for about as long (38.901, table 7.5-6: 30 to 50 m in
cities), so that repeats within it tell nothing new.
"""

_OUTLIERS = 0.05
_ANY_BIAS = 0.05
_NEVER_TOLD = 0.5
"""A modem that was never given a TA prints 0: a walk of nothing else is as likely that."""
_MOST_PLACES = 100
_NODES = np.linspace(-3.0, 3.0, 21)
_DISAGREES = 0.05
_END = 0.7


class Timing(NamedTuple):
    """Timing advances by place, shape (k,) each; the weights of the `step`s told at one place add
    up to 1.
    """

    x_m: FloatArray
    y_m: FloatArray
    step: FloatArray
    weight: FloatArray

    @property
    def reach_m(self) -> float:
        """How far a search has to reach beyond the walk so that no ring is near its end."""
        return float(np.max(self.step) + 1.0) * STEP_M / _END

    def log_p(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Log probability of all TA for a base station at places (h,)."""
        away_m = self._away_m(x_m, y_m)
        prior = np.log(
            (1.0 - _NEVER_TOLD)
            * (1.0 - _ANY_BIAS)
            * np.exp(-0.5 * _NODES**2)
            / np.sum(np.exp(-0.5 * _NODES**2))
        )
        near = [
            w + self._given(away_m + BIAS_M + BIAS_SIGMA_M * u)
            for u, w in zip(_NODES, prior, strict=True)
        ]
        # of biases that can be anything, -35 to 35 km, about one step fits
        any_bias = (
            self.weight @ ((self.step[:, None] + 0.5) * STEP_M - away_m) / np.sum(self.weight)
        )
        share = (1.0 - _NEVER_TOLD) * _ANY_BIAS / (2.0 * (LAST_TA + 1)) + _NEVER_TOLD * (
            not np.any(self.step)
        )
        return log_sum(np.stack([*near, np.log(share) + self._given(away_m + any_bias)], axis=-1))

    def near(self, square: FloatArray) -> BoolArray:
        """Which squares (3, h), rows x, y, side, may hold a part of a ring."""
        middle_m = (self.step[:, None] + 0.5) * STEP_M - BIAS_M
        off_m = np.abs(self._away_m(square[0], square[1]) - middle_m)
        reaches = off_m < 0.5 * STEP_M + 2.0 * BIAS_SIGMA_M + np.sqrt(0.5) * square[2]
        return np.asarray(np.any(reaches, axis=0), bool)

    def check(self, cells: Squares) -> "TimingCheck":
        """How many places' TA disagree with a posterior: less than 5 % of it is where they fit,
        within 2 sigma.
        """
        slack_m = 2.0 * float(np.hypot(SIGMA_M, BIAS_SIGMA_M))
        held = cells.probability > 1e-6
        away_m = self._away_m(cells.x_m[held], cells.y_m[held]) + BIAS_M
        step = self.step[:, None]
        fits = (away_m > step * STEP_M - slack_m) | (step == 0)
        fits &= (away_m < (step + 1.0) * STEP_M + slack_m) | (step == LAST_TA)
        disagrees = fits @ cells.probability[held] < _DISAGREES
        return TimingCheck(
            round(float(np.sum(self.weight))), round(float(np.sum(self.weight[disagrees])))
        )

    def _away_m(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Distance of each place of the walk from others, shape (k, h)."""
        return np.asarray(np.hypot(x_m - self.x_m[:, None], y_m - self.y_m[:, None]), float)

    def _given(self, delay_m: FloatArray) -> FloatArray:
        """Log probability of all TA given the delays (k, h), the bias included, shape (h,)."""
        told = probability(self.step[:, None], delay_m)
        return np.asarray(
            self.weight @ np.log((1.0 - _OUTLIERS) * told + _OUTLIERS / (LAST_TA + 1)), float
        )


class TimingCheck(NamedTuple):
    """At how many places a TA was read, and at how many of them it disagrees with the answer."""

    places: int
    disagree: int

    @property
    def warning(self) -> str | None:
        """One line where most disagree."""
        if 2 * self.disagree <= self.places:
            return None
        return f"the timing advance disagrees with the answer at {self.disagree} of {self.places} places"


def probability(step: FloatArray, delay_m: FloatArray) -> FloatArray:
    """Of TA = `step` given the delay as a distance, outliers aside; sums to 1 over the steps 0 to
    63.
    """
    rate = np.pi / (2.0 * np.sqrt(3.0) * SIGMA_M)
    below_end = np.where(step == LAST_TA, 1.0, np.tanh(rate * ((step + 1.0) * STEP_M - delay_m)))
    below_begin = np.where(step == 0, -1.0, np.tanh(rate * (step * STEP_M - delay_m)))
    return np.asarray(0.5 * (below_end - below_begin), float)


def timing_of(obs: CellObservations) -> Timing | None:
    """The timing advances of a walk gathered by place; None where there is none."""
    if obs.ta is None or not np.any(obs.ta >= 0):
        return None
    told = obs.ta >= 0
    x_m, y_m, step = obs.x_m[told], obs.y_m[told], obs.ta[told]
    shrunk = FINEST_BLOCK_M / PLACE_M  # `squares` begins with the finest block
    square, _ = squares(shrunk * x_m, shrunk * y_m, _MOST_PLACES, np.zeros(len(step), np.int64))
    found, index, count = np.unique(
        (LAST_TA + 1) * square + step, return_inverse=True, return_counts=True
    )
    x, y = (np.bincount(index, v) / count for v in (x_m, y_m))
    weight = count / np.bincount(square)[found // (LAST_TA + 1)]
    return Timing(x, y, (found % (LAST_TA + 1)).astype(float), weight)
