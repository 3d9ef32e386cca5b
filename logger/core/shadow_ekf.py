"""EKF of a station's place, power and exponent that carries the shadowing at the walker's place
with them.

State [x, y, P0, eta, s]: s (dB) is the shadowing where the last reading was taken, the rest stands
still. For a reading taken at the receiver's place p, D metres from the one before:

    s = rho s_before + w,    rho = exp(-D / d_c),    var w = shadow^2 (1 - rho^2)
    z = P0 - eta 5 log10(d^2) + s + v,    d^2 = |(x, y) - p|^2 + height^2 + 2 sigma_g^2, at least 1 m^2
    var v = white^2 + 1/12 + (C eta sigma_g / d)^2,    C = 10 / ln 10

(Gudmundson, Electron. Lett. 27(23), 1991; 1/12 since levels are whole dB; sigma_g is the receiver's
error per axis.)

The covariance is kept as U D U' in the order s, x, y, P0, eta, with U unit upper triangular, and
corrected by Bierman's algorithm (Factorization Methods for Discrete Sequential Estimation, 1977,
ch. V): a correction multiplies each entry of D by a positive number, so no rounding makes the
covariance indefinite. With s first, D_s is the variance of s given the rest, w adds to D_s alone,
and row s of U says how s leans on the rest.

A reading at the modem's limit only says that the level is beyond it. The level expected then is
that of a normal cut off at the limit; mean and variance of the state are corrected to what follows
from its mean and variance (moment matching; Tobit, Econometrica 26(1), 1958), which is the usual
correction with another innovation and another r.
"""

from collections.abc import Sequence
from math import erfc, exp, hypot, isnan, log, log10, nan, pi, sqrt
from typing import NamedTuple

import numpy as np

from logger.core import ekf
from logger.core.arrays import FloatArray
from logger.core.errors import EstimationError

_C = 10.0 / log(10.0)
_RANGE_CLAMP_M2 = 1.0
_ROUNDING_DB2 = 1.0 / 12.0
_ROOT_2, _ROOT_2PI = sqrt(2.0), sqrt(2.0 * pi)
_EXPECTED, _IMPOSSIBLE = 8.0, -30.0

Factors = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
"""D of s, x, y, P0, eta; then U above its diagonal: sx, sy, s0, se, xy, x0, xe, y0, ye, 0e."""


class ShadowNoise(NamedTuple):
    """Shadowing and the distance that forgets it, white noise, height of the antenna above the
    receiver.

    `decorrelation_m` 0 stands for shadowing that is new at every reading.
    """

    shadow_db: float
    decorrelation_m: float
    white_db: float
    height_m: float


class ShadowState(NamedTuple):
    """State, the receiver's place to which the shadowing belongs, and the covariance's factors."""

    x_m: float
    y_m: float
    p0_dbm: float
    eta: float
    shadow_db: float
    at_x_m: float
    at_y_m: float
    factors: Factors


class ShadowStep(NamedTuple):
    """A corrected state with the innovation (dB) and its variance (dB^2).

    Both are NaN for a reading at a limit or without a level.
    """

    state: ShadowState
    innovation_db: float
    innovation_var_db2: float


def split_noise(
    sigma_db: float, decorrelation_m: float, white_share: float, height_m: float
) -> ShadowNoise:
    """Noise of a filter from what the locator says of the residuals; all of it white where nothing
    is correlated.
    """
    white = white_share if decorrelation_m > 0.0 else 1.0
    return ShadowNoise(
        sigma_db * sqrt(1.0 - white), decorrelation_m, sigma_db * sqrt(white), height_m
    )


def hold(
    mean: Sequence[float] | FloatArray, noise: ShadowNoise, at_x_m: float, at_y_m: float
) -> ShadowState:
    """State with [x, y, P0, eta] taken as certain: steps from here on estimate the shadowing given
    these four.
    """
    x_m, y_m, p0_dbm, eta = (float(value) for value in mean)
    none = (0.0,) * 7
    return ShadowState(
        x_m, y_m, p0_dbm, eta, 0.0, at_x_m, at_y_m, (float(noise.shadow_db) ** 2, *none, *none)
    )


def release(state: ShadowState, covariance: FloatArray) -> ShadowState:
    """A held state with the covariance (4, 4) that [x, y, P0, eta] really have: the start of the
    filter.

    The readings stepped over while holding count for the shadowing only, so they may be those the
    covariance comes from. Raises `EstimationError` for a covariance that is not positive definite.
    """
    try:
        root = np.linalg.cholesky(np.asarray(covariance, float)[::-1, ::-1])[::-1, ::-1]
    except np.linalg.LinAlgError:
        raise EstimationError("the covariance to start from is not positive definite") from None
    scale = np.diagonal(root)
    upper = root / scale
    lean = np.array(state.factors[5:9]) @ upper
    return state._replace(factors=(state.factors[0], *scale**2, *lean, *upper[_ABOVE4]))


def step(
    state: ShadowState,
    noise: ShadowNoise,
    receiver_x_m: float,
    receiver_y_m: float,
    position_sigma_m: float,
    level_dbm: float,
    limit: int = 0,
) -> ShadowStep:
    """Go to the place of the next reading and correct with its level; with a level of NaN, only go
    there.

    `limit` is -1 where the level is the modem's lowest and the true one may be below, 1 where it is
    the highest.
    """
    x, y, p0, eta, s, at_x, at_y, (ds, dx, dy, d0, de, sx, sy, s0, se, xy, x0, xe, y0, ye, oe) = (
        state
    )
    rho = recall(noise, hypot(receiver_x_m - at_x, receiver_y_m - at_y))
    s *= rho
    ds = rho * rho * ds + noise.shadow_db * noise.shadow_db * (1.0 - rho * rho)
    sx, sy, s0, se = rho * sx, rho * sy, rho * s0, rho * se
    if isnan(level_dbm):
        moved = ShadowState(
            x,
            y,
            p0,
            eta,
            s,
            receiver_x_m,
            receiver_y_m,
            (ds, dx, dy, d0, de, sx, sy, s0, se, xy, x0, xe, y0, ye, oe),
        )
        return ShadowStep(moved, nan, nan)

    east = x - receiver_x_m
    north = y - receiver_y_m
    spread = 2.0 * position_sigma_m * position_sigma_m
    d2 = max(
        east * east + north * north + noise.height_m * noise.height_m + spread, _RANGE_CLAMP_M2
    )
    slope = -_C * eta / d2
    hx, hy, he = slope * east, slope * north, -5.0 * log10(d2)
    r = noise.white_db * noise.white_db + _ROUNDING_DB2 + 0.5 * slope * slope * d2 * spread
    innovation = level_dbm - (p0 + eta * he + s)

    # f = U' h, g = D f
    fx, fy = sx + hx, sy + xy * hx + hy
    f0, fe = s0 + x0 * hx + y0 * hy + 1.0, se + xe * hx + ye * hy + oe + he
    gx, gy, g0, ge = dx * fx, dy * fy, d0 * f0, de * fe
    if limit:
        known = ds + fx * gx + fy * gy + f0 * g0 + fe * ge
        innovation, r = beyond_limit(innovation, known, r, limit)
    # r and h' P h added up state by state, and with each sum the columns of U and of the gain
    rs = r + ds
    rx = rs + fx * gx
    ry = rx + fy * gy
    r0 = ry + f0 * g0
    re = r0 + fe * ge
    kx, ky, k0 = gx, gy, g0
    w = -fx / rs
    sx, ks = sx + ds * w, ds + sx * gx
    w = -fy / rx
    sy, ks = sy + ks * w, ks + sy * gy
    xy, kx = xy + kx * w, kx + xy * gy
    w = -f0 / ry
    s0, ks = s0 + ks * w, ks + s0 * g0
    x0, kx = x0 + kx * w, kx + x0 * g0
    y0, ky = y0 + ky * w, ky + y0 * g0
    w = -fe / r0
    se, ks = se + ks * w, ks + se * ge
    xe, kx = xe + kx * w, kx + xe * ge
    ye, ky = ye + ky * w, ky + ye * ge
    oe, k0 = oe + k0 * w, k0 + oe * ge
    factors = (
        ds * r / rs, dx * rs / rx, dy * rx / ry, d0 * ry / r0, de * r0 / re,
        sx, sy, s0, se, xy, x0, xe, y0, ye, oe,
    )  # fmt: skip
    e = innovation / re
    corrected = ShadowState(
        x + kx * e,
        y + ky * e,
        p0 + k0 * e,
        eta + ge * e,
        s + ks * e,
        receiver_x_m,
        receiver_y_m,
        factors,
    )
    if limit:
        return ShadowStep(corrected, nan, nan)
    return ShadowStep(corrected, innovation, re)


def recall(noise: ShadowNoise, moved_m: float) -> float:
    """Correlation rho of the shadowing at two places."""
    return exp(-moved_m / noise.decorrelation_m) if noise.decorrelation_m > 0.0 else 0.0


def beyond_limit(
    to_limit_db: float, known_db2: float, r_db2: float, limit: int
) -> tuple[float, float]:
    """Innovation and r that stand for a level beyond a limit.

    The level is expected `to_limit_db` short of the limit with variance S = known + r. Cut off at a
    = (inside of the limit) / sqrt(S), its mean moves by l sqrt(S) and its variance shrinks by l (l
    + a) S, with l = phi(a) / Phi(a).
    """
    s = known_db2 + r_db2
    root = sqrt(s)
    a = min(max(-limit * to_limit_db / root, _IMPOSSIBLE), _EXPECTED)
    hazard = 2.0 * exp(-0.5 * a * a) / (_ROOT_2PI * erfc(-a / _ROOT_2))
    return limit * root / (hazard + a), s / (hazard * (hazard + a)) - known_db2


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
    """Upper triangle of the covariance of [x, y, P0, eta], as the reference filter keeps it."""
    _, dx, dy, d0, de, _, _, _, _, xy, x0, xe, y0, ye, oe = factors
    cx, cy, c0 = xe * de, ye * de, oe * de
    bx, by = x0 * d0 + cx * oe, y0 * d0 + cy * oe
    return (
        dx + xy * xy * dy + x0 * x0 * d0 + xe * cx, xy * dy + x0 * y0 * d0 + xe * cy, bx, cx,
        dy + y0 * y0 * d0 + ye * cy, by, cy,
        d0 + oe * c0, c0,
        de,
    )  # fmt: skip
