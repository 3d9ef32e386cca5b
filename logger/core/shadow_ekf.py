"""EKF of a transmitter with the shadowing at the receiver, and the monitor that discards it.

State [x, y, P0, eta, s] (power and exponent): s (dB) is the shadowing where the last reading was
taken; the rest stands still. For a reading taken D metres from the one before:

    s = rho s_before + w,    rho = exp(-D / d_c),    var w = shadow^2 (1 - rho^2)
    z = P0 - eta L + s + v   with L of `model.path_loss`
    var v = white^2 + 1/12 + (C eta sigma / d)^2,    C = 10 / ln 10

(Gudmundson, Electron. Lett. 27(23), 1991; 1/12 since levels are integers in dB; sigma is the error
of the receiver's position per axis.)

The covariance is stored as U D U' in the order s, x, y, P0, eta, with U unit upper triangular, and
corrected by Bierman's algorithm (Factorization Methods for Discrete Sequential Estimation, 1977,
ch. V): a correction multiplies each entry of D by a positive number, so no rounding makes the
covariance indefinite. With s first, D_s is the variance of s given the rest, w adds to D_s alone,
and row s of U is the dependence of s on the rest.

A reading at the modem's limit shows only that the level is beyond it. The expected level is then
that of a normal law truncated at the limit; mean and variance of the state follow from its mean and
variance (moment matching; Tobin, Econometrica 26(1), 1958): the usual correction with another
innovation and another r.
"""

from collections.abc import Sequence
from math import erfc, exp, hypot, isnan, log, nan, pi, sqrt
from typing import NamedTuple

import numpy as np

from logger.core import ekf
from logger.core.arrays import FloatArray
from logger.core.certainty import CHI2_95_2DOF
from logger.core.ekf import EkfStep
from logger.core.errors import EstimationError
from logger.core.model.path_loss import level_gradient
from logger.core.places import Places
from logger.core.readings import Readings

_ROUNDING_DB2 = 1.0 / 12.0
_ROOT_2, _ROOT_2PI = sqrt(2.0), sqrt(2.0 * pi)
_CERTAIN_SIGMAS, _IMPOSSIBLE_SIGMAS = 8.0, -30.0  # beyond these, erfc leaves no digits

Factors = tuple[
    float, float, float, float, float,
    float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
"""D of s, x, y, P0, eta; then U above its diagonal: sx, sy, s0, se, xy, x0, xe, y0, ye, 0e."""
_WHITE_SHARES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
_NEARLY_WHITE = 0.95  # the decorrelation distance of so little correlated noise is arbitrary
_FEWEST = 50  # readings, with which a share is known to a factor of 2


class ShadowNoise(NamedTuple):
    """Shadowing, its decorrelation distance, white noise, height of the antenna above the receiver.

    `decorrelation_m` 0 stands for shadowing that is new at every reading.
    """

    shadow_db: float
    decorrelation_m: float
    white_db: float
    height_m: float


class ShadowState(NamedTuple):
    """State, the receiver's position to which the shadowing belongs, factors of the covariance."""

    x_m: float
    y_m: float
    p0_dbm: float
    eta: float
    shadow_db: float
    receiver_x_m: float
    receiver_y_m: float
    factors: Factors


def split_noise(
    sigma_db: float, decorrelation_m: float, white_share: float, height_m: float
) -> ShadowNoise:
    """Noise of a filter from the locator's residual noise; all white where none is correlated."""
    white = white_share if decorrelation_m > 0.0 else 1.0
    return ShadowNoise(
        sigma_db * sqrt(1.0 - white), decorrelation_m, sigma_db * sqrt(white), height_m
    )


def hold(mean: Sequence[float] | FloatArray, noise: ShadowNoise, receiver: Places) -> ShadowState:
    """State with certain [x, y, P0, eta]: steps from here on estimate the shadowing."""
    x_m, y_m, p0_dbm, eta = (float(value) for value in mean)
    none = (0.0,) * 7
    factors = (float(noise.shadow_db) ** 2, *none, *none)
    return ShadowState(
        x_m, y_m, p0_dbm, eta, 0.0, float(receiver.x_m[0]), float(receiver.y_m[0]), factors
    )


def release(state: ShadowState, covariance: FloatArray) -> ShadowState:
    """A held state with the covariance (4, 4) of [x, y, P0, eta]: the start of the filter.

    Readings stepped over while holding count for the shadowing only, so the covariance may come
    from them. Raises `EstimationError` for a covariance that is not positive definite.
    """
    try:
        root = np.linalg.cholesky(np.asarray(covariance, float)[::-1, ::-1])[::-1, ::-1]
    except np.linalg.LinAlgError:
        raise EstimationError("the covariance to start from is not positive definite") from None
    scale = np.diagonal(root)
    upper = root / scale
    row_s = np.array(state.factors[5:9]) @ upper
    return state._replace(factors=(state.factors[0], *scale**2, *row_s, *upper[_ABOVE4]))


def correct(state: ShadowState, noise: ShadowNoise, reading: Readings) -> ekf.EkfStep[ShadowState]:
    """`step` to a single reading."""
    place = reading.places
    at = place.x_m.item(), place.y_m.item(), place.sigma_m.item()
    return step(state, noise, *at, reading.level_dbm.item(), reading.limit.item())


def step(
    state: ShadowState,
    noise: ShadowNoise,
    receiver_x_m: float,
    receiver_y_m: float,
    position_sigma_m: float,
    level_dbm: float,
    limit: int = 0,
) -> ekf.EkfStep[ShadowState]:
    """Move the receiver to the next reading and correct with its level, if it is not NaN.

    `limit` is -1 where the level is the modem's lowest and the true one may be below, 1 where it is
    the highest.
    """
    state = _move(state, noise, receiver_x_m, receiver_y_m)
    if isnan(level_dbm):
        return ekf.EkfStep(state, nan, nan)
    variance_m2 = position_sigma_m * position_sigma_m
    east, north = state.x_m - receiver_x_m, state.y_m - receiver_y_m
    beyond_m2 = noise.height_m * noise.height_m + 2.0 * variance_m2
    hx, hy, he, db2_per_m2 = level_gradient(east, north, state.eta, beyond_m2)
    r = noise.white_db * noise.white_db + _ROUNDING_DB2 + db2_per_m2 * variance_m2
    innovation = level_dbm - (state.p0_dbm + state.eta * he + state.shadow_db)
    factors, gain, variance = _bierman(state.factors, hx, hy, he, r)
    if not limit:
        return ekf.EkfStep(
            _shift(state, gain, innovation / variance, factors), innovation, variance
        )
    innovation, r = _beyond_limit(innovation, variance - r, r, limit)
    factors, gain, variance = _bierman(state.factors, hx, hy, he, r)
    return ekf.EkfStep(_shift(state, gain, innovation / variance, factors), nan, nan)


def _move(
    state: ShadowState, noise: ShadowNoise, receiver_x_m: float, receiver_y_m: float
) -> ShadowState:
    """Part of the shadowing is forgotten."""
    x, y, p0, eta, s, last_x, last_y, factors = state
    ds, dx, dy, d0, de, sx, sy, s0, se, xy, x0, xe, y0, ye, oe = factors
    moved_m = hypot(receiver_x_m - last_x, receiver_y_m - last_y)
    rho = exp(-moved_m / noise.decorrelation_m) if noise.decorrelation_m > 0.0 else 0.0
    fresh_db2 = noise.shadow_db * noise.shadow_db * (1.0 - rho * rho)
    ds = rho * rho * ds + fresh_db2
    sx, sy, s0, se = rho * sx, rho * sy, rho * s0, rho * se
    factors = ds, dx, dy, d0, de, sx, sy, s0, se, xy, x0, xe, y0, ye, oe
    return ShadowState(x, y, p0, eta, rho * s, receiver_x_m, receiver_y_m, factors)


def _bierman(
    factors: Factors, hx: float, hy: float, he: float, r_db2: float
) -> tuple[Factors, tuple[float, float, float, float, float], float]:
    """Corrected factors, P h of [s, x, y, P0, eta] and variance S = h' P h + r of a level.

    With f = U' h and g = D f, the sum of r and f g grows state by state to S, and with each state
    one column of U is done. The derivatives by s and P0 are 1. The columns are written out: a loop
    takes 1.5 to 2 times as long in plain Python (benchmarks/ekf_step.py).
    """
    ds, dx, dy, d0, de, sx, sy, s0, se, xy, x0, xe, y0, ye, oe = factors
    total = r_db2 + ds
    ks = ds
    ds *= r_db2 / total

    f = sx + hx
    kx = dx * f
    w, before, total = -f / total, total, total + f * kx
    dx *= before / total
    sx, ks = sx + ks * w, ks + sx * kx

    f = sy + xy * hx + hy
    ky = dy * f
    w, before, total = -f / total, total, total + f * ky
    dy *= before / total
    sy, ks = sy + ks * w, ks + sy * ky
    xy, kx = xy + kx * w, kx + xy * ky

    f = s0 + x0 * hx + y0 * hy + 1.0
    k0 = d0 * f
    w, before, total = -f / total, total, total + f * k0
    d0 *= before / total
    s0, ks = s0 + ks * w, ks + s0 * k0
    x0, kx = x0 + kx * w, kx + x0 * k0
    y0, ky = y0 + ky * w, ky + y0 * k0

    f = se + xe * hx + ye * hy + oe + he
    ke = de * f
    w, before, total = -f / total, total, total + f * ke
    de *= before / total
    se, ks = se + ks * w, ks + se * ke
    xe, kx = xe + kx * w, kx + xe * ke
    ye, ky = ye + ky * w, ky + ye * ke
    oe, k0 = oe + k0 * w, k0 + oe * ke

    corrected = ds, dx, dy, d0, de, sx, sy, s0, se, xy, x0, xe, y0, ye, oe
    return corrected, (ks, kx, ky, k0, ke), total


def _shift(
    state: ShadowState,
    gain: tuple[float, float, float, float, float],
    e: float,
    factors: Factors,
) -> ShadowState:
    """The state moved by e P h, where e is the innovation divided by its variance."""
    x, y, p0, eta, s, receiver_x_m, receiver_y_m, _ = state
    ks, kx, ky, k0, ke = gain
    return ShadowState(
        x + kx * e, y + ky * e, p0 + k0 * e, eta + ke * e, s + ks * e,
        receiver_x_m, receiver_y_m, factors,
    )  # fmt: skip


def _beyond_limit(
    to_limit_db: float, variance_db2: float, r_db2: float, limit: int
) -> tuple[float, float]:
    """Innovation and r that stand for a level beyond a limit.

    The level is expected `to_limit_db` short of the limit with variance S = variance + r. Truncated
    at a = (inside of the limit) / sqrt(S), its mean moves by l sqrt(S) and its variance shrinks by
    l (l + a) S, with l = phi(a) / Phi(a).
    """
    s = variance_db2 + r_db2
    root = sqrt(s)
    a = min(max(-limit * to_limit_db / root, _IMPOSSIBLE_SIGMAS), _CERTAIN_SIGMAS)
    hazard = 2.0 * exp(-0.5 * a * a) / (_ROOT_2PI * erfc(-a / _ROOT_2))
    return limit * root / (hazard + a), s / (hazard * (hazard + a)) - variance_db2


_ABOVE4 = np.triu_indices(4, 1)
_ABOVE5 = np.triu_indices(5, 1)


def covariance_matrix(factors: Factors | FloatArray) -> FloatArray:
    """Covariances of [x, y, P0, eta, s], shape (..., 5, 5), from factors of shape (..., 15)."""
    packed = np.asarray(factors, float)
    upper = np.zeros((*packed.shape[:-1], 5, 5))
    upper[..., _ABOVE5[0], _ABOVE5[1]] = packed[..., 5:]
    upper[..., range(5), range(5)] = 1.0
    matrix = (upper * packed[..., None, :5]) @ np.swapaxes(upper, -1, -2)
    return np.roll(matrix, -1, (-2, -1))


def static_covariance(factors: Factors) -> ekf.Covariance:
    """Upper triangle of the covariance of [x, y, P0, eta], as `ekf.EkfState` holds it."""
    _, dx, dy, d0, de, _, _, _, _, xy, x0, xe, y0, ye, oe = factors
    cx, cy, c0 = xe * de, ye * de, oe * de
    bx, by = x0 * d0 + cx * oe, y0 * d0 + cy * oe
    return (
        dx + xy * xy * dy + x0 * x0 * d0 + xe * cx, xy * dy + x0 * y0 * d0 + xe * cy, bx, cx,
        dy + y0 * y0 * d0 + ye * cy, by, cy,
        d0 + oe * c0, c0,
        de,
    )  # fmt: skip


def candidates(
    sigma_db: float, decorrelation_m: float, white_share: float, height_m: float
) -> list[ShadowNoise]:
    """The locator's noise, then the same with other white shares.

    The locator averages readings in blocks and considers a few shares only, so its mean share is
    rough, and a wrong one makes innovations too large or too small. All is taken for white where
    nearly all is.
    """
    if white_share >= _NEARLY_WHITE:
        return [split_noise(sigma_db, 0.0, 1.0, height_m)]
    shares = white_share, *_WHITE_SHARES
    return [split_noise(sigma_db, decorrelation_m, share, height_m) for share in shares]


def likeliest(noises: Sequence[ShadowNoise], mean: FloatArray, readings: Readings) -> ShadowNoise:
    """The noise under which the readings are likeliest, given [x, y, P0, eta].

    By the innovations (Schweppe, IEEE Trans. Inf. Theory 11(1), 1965); the first for fewer than 50
    readings. Takes a step of the filter for each pair of noise and
    reading.
    """
    if len(readings) < _FEWEST:
        return noises[0]
    return max(noises, key=lambda noise: _log_likelihood(noise, mean, readings))


def _log_likelihood(noise: ShadowNoise, mean: FloatArray, readings: Readings) -> float:
    """Up to a constant; levels at a limit do not count."""
    state = hold(mean, noise, readings.places)
    total, places = 0.0, readings.places
    columns = places.x_m, places.y_m, places.sigma_m, readings.level_dbm, readings.limit
    for reading in zip(*(column.tolist() for column in columns), strict=True):
        state, innovation_db, variance_db2 = step(state, noise, *reading)
        if not isnan(innovation_db):
            total -= 0.5 * (log(variance_db2) + innovation_db * innovation_db / variance_db2)
    return total


# --- the monitor ---

# Three values are followed, each over several readings, so that one outlier discards nothing.
#
# - Normalised innovations squared (NIS), 1 on average for a consistent filter: their exponentially
#   weighted mean against the upper bound of a chi-square mean with as many degrees of freedom as
#   the weights amount to (Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking
#   and Navigation, sec. 5.4; the quantile by Wilson & Hilferty, PNAS 17(12), 1931).
# - Distance from the locator's best position, by both covariances.
# - Uncertainty of the position relative to the walker's distance: near the transmitter a linearised
#   filter needs a smaller one.
#
# The NIS reveals wrong noise. It reveals a wrong position only with little shadowing: otherwise
# P0, eta and shadowing absorb the error, and only the locator reveals it.

CLOSE = 0.15
"""Largest sigma of the position, along its widest axis and by the walker's distance, at a start.

Started there in simulated walks, the last 95 % ellipse held the truth in 93 to 95 %; at 0.3 in 89
to 94 %.
"""
NEAR = 0.25
"""As `CLOSE`, to discard a running filter."""

_MEMORY = 30.0
"""Readings over which the mean NIS forgets."""
_MOST_NIS = 9.0
"""A larger one (3 sigma) counts as this: one gross error does not fill the mean."""
_NIS_SIGMAS = 4.0
"""The bound of the mean is tested at every reading, so chance must seldom exceed it."""
_NIS_READINGS, _APART_READINGS, _NEAR_READINGS = 5, 3, 3
"""Net readings beyond a bound that raise its alarm."""


class Alarm(NamedTuple):
    """Active from `most` net exceedances on, until as many readings are within the bound."""

    exceedances: int = 0
    active: bool = False

    def update(self, *, exceeded: bool, most: int) -> "Alarm":
        """The alarm after one more reading."""
        change = 1 if exceeded else -1
        exceedances = min(max(self.exceedances + change, 0), most)
        return Alarm(exceedances, exceedances >= most or (self.active and exceedances > 0))


class FilterMonitor(NamedTuple):
    """What has been observed of a filter since it started; a new monitor lets it run.

    `mean_nis` is the weighted mean NIS, with the sums of its weights and of their squares. `apart2`
    is the squared distance from the locator's position by both covariances, `nearness` the sigma of
    the filter's position divided by the walker's distance.
    """

    mean_nis: float = 1.0
    weight: float = 0.0
    weight2: float = 0.0
    apart2: float = 0.0
    nearness: float = 0.0
    nis_alarm: Alarm = Alarm()
    apart_alarm: Alarm = Alarm()
    near_alarm: Alarm = Alarm()

    @property
    def nis_bound(self) -> float:
        """Largest mean NIS of a consistent filter after so many readings."""
        return mean_bound(self.weight**2 / self.weight2) if self.weight2 else float("inf")

    @property
    def disagrees(self) -> str | None:
        """Why the filter is to be discarded; None while it may run."""
        if self.nis_alarm.active:
            return (
                "the innovations are larger than the filter's variance allows: "
                f"mean NIS {self.mean_nis:.1f}, at most {self.nis_bound:.1f} by chance"
            )
        if self.apart_alarm.active:
            apart = sqrt(self.apart2)
            return f"the filter and the locator are {apart:.1f} standard deviations apart"
        if self.near_alarm.active:
            return (
                "the walker is too near for the uncertainty of the position: "
                f"its standard deviation is {100.0 * self.nearness:.0f} % of the distance"
            )
        return None

    def after_step(self, step: EkfStep[ShadowState], noise: ShadowNoise) -> "FilterMonitor":
        """The monitor after one more step of the filter."""
        nearness = _nearness(step.state, noise.height_m)
        near_alarm = self.near_alarm.update(exceeded=nearness > NEAR, most=_NEAR_READINGS)
        monitor = self._replace(nearness=nearness, near_alarm=near_alarm)
        if isnan(step.innovation_db):
            return monitor
        return _after_nis(monitor, step.innovation_db**2 / step.innovation_var_db2)

    def after_search(
        self, state: ShadowState, mean: FloatArray, covariance: FloatArray
    ) -> "FilterMonitor":
        """The monitor beside the locator's mode: [x, y, P0, eta] and its covariance (4, 4)."""
        (mode_xx, mode_xy), (_, mode_yy) = covariance[:2, :2].tolist()
        x_m, y_m, _, _ = mean.tolist()
        xx, xy, _, _, yy, *_ = static_covariance(state.factors)
        xx, xy, yy = xx + mode_xx, xy + mode_xy, yy + mode_yy
        east, north = state.x_m - x_m, state.y_m - y_m
        squares = yy * east * east - 2.0 * xy * east * north + xx * north * north
        apart2 = squares / (xx * yy - xy * xy)
        exceeded = apart2 > CHI2_95_2DOF
        apart_alarm = self.apart_alarm.update(exceeded=exceeded, most=_APART_READINGS)
        return self._replace(apart2=apart2, apart_alarm=apart_alarm)


def widest(xx: float, xy: float, yy: float) -> float:
    """Standard deviation along the widest axis of a covariance in the plane."""
    return sqrt(0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy))


def mean_bound(dof: float, sigmas: float = _NIS_SIGMAS) -> float:
    """Bound of the mean of `dof` squared standard normals, as rare as a normal beyond `sigmas`."""
    spread = 2.0 / (9.0 * dof)
    return float((1.0 - spread + sigmas * sqrt(spread)) ** 3)


def _nearness(state: ShadowState, height_m: float) -> float:
    xx, xy, _, _, yy, *_ = static_covariance(state.factors)
    dx_m, dy_m = state.x_m - state.receiver_x_m, state.y_m - state.receiver_y_m
    squared_m2 = dx_m**2 + dy_m**2 + height_m**2
    return widest(xx, xy, yy) / sqrt(max(squared_m2, 1.0))


def _after_nis(monitor: FilterMonitor, nis: float) -> FilterMonitor:
    keep = 1.0 - 1.0 / _MEMORY
    weight = keep * monitor.weight + 1.0
    mean_nis = monitor.mean_nis + (min(nis, _MOST_NIS) - monitor.mean_nis) / weight
    weight2 = keep * keep * monitor.weight2 + 1.0
    monitor = monitor._replace(mean_nis=mean_nis, weight=weight, weight2=weight2)
    exceeded = mean_nis > monitor.nis_bound
    return monitor._replace(
        nis_alarm=monitor.nis_alarm.update(exceeded=exceeded, most=_NIS_READINGS)
    )
