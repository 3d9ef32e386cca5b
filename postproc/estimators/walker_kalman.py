"""Kalman filter and adjoint smoother of a walker's track, compiled; the model and its symbols are
in `walker`.

The smoother inverts nothing and yields leave-one-out residuals (Bryson & Frazier 1963; de Jong, J.
Amer. Statist. Assoc. 84(408), 1989). Symmetric matrices are their upper triangles 00 01 02 11 12
22. A fix has two measurements, the place with h = [1, 0, s] and the velocity with h = [0, 1, 0];
one with infinite variance is left out.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from postproc.estimators.kernels import jit

STUDENT_DOF = 4.0
_ANYWHERE_M2 = 1e8
_START_MPS2 = 25.0

_Vector = tuple[float, float, float]
_Symmetric = tuple[float, float, float, float, float, float]


class Model(NamedTuple):
    """Fixes and what is believed of them; `step_s` since the fix before, and q and a for that step,
    have shape (n,).

    `z` (n, 2, 2) is by fix, kind (place, velocity) and axis, `wander_m` (n,) is s, `variance` (n,
    2) that of the white noise, `slack` (n, 2) the variance within which nothing is an outlier.
    """

    step_s: FloatArray
    q: FloatArray
    a: FloatArray
    z: FloatArray
    wander_m: FloatArray
    variance: FloatArray
    slack: FloatArray


class Series(NamedTuple):
    """States `x` (n, 3, 2) and covariances `p` (n, 6) of the filter after each fix.

    Adjoint vectors `r` (n, 3, 2) and matrices `n` (n, 6): what a fix and all later ones say of the
    state before it.
    """

    x: FloatArray
    p: FloatArray
    r: FloatArray
    n: FloatArray


def score(model: Model, excess: FloatArray) -> float:
    """Log-likelihood of the fixes, each innovation Student distributed; sets `excess` (n, 2) by the
    innovations.
    """
    return float(_filter(*model, excess, True)[0])


def excess_variance(apart2: FloatArray, expected: FloatArray) -> FloatArray:
    """Variance to be added to that of a measurement whose error is too large for it, shape as
    given.

    Of a Student error with nu degrees of freedom and squared size e^2 on two axes where E was
    expected on one, the variance is E (nu + e^2 / E) / (nu + 2) at least.
    """
    return np.maximum(apart2 - 2.0 * expected, 0.0) / (STUDENT_DOF + 2.0)


def smooth(model: Model, excess: FloatArray) -> tuple[Series, FloatArray, FloatArray]:
    """Smooth with `excess` (n, 2) added to the variances; also how far each measurement is from
    what all others say.

    That is a distance squared (n, 2) and its expected variance on each axis (n, 2), with the slack,
    without the excess.
    """
    _, x, p, gain, innovation, spread = _filter(*model, excess, False)
    r, n, u, d = _adjoint(
        model.step_s, model.a, model.wander_m, model.variance, gain, innovation, spread
    )
    expected = 1.0 / d - excess + np.where(np.isfinite(model.variance), model.slack, 0.0)
    return Series(x, p, r, n), (u[:, :, 0] ** 2 + u[:, :, 1] ** 2) / d**2, expected


@jit
def _dot(a: _Vector, b: _Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def _times(p: _Symmetric, h: _Vector) -> _Vector:
    return (
        p[0] * h[0] + p[1] * h[1] + p[2] * h[2],
        p[1] * h[0] + p[3] * h[1] + p[4] * h[2],
        p[2] * h[0] + p[4] * h[1] + p[5] * h[2],
    )


@jit
def _plus(a: _Vector, factor: float, b: _Vector) -> _Vector:
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


@jit
def _plus_outer(p: _Symmetric, factor: float, a: _Vector, b: _Vector) -> _Symmetric:
    """P + factor (a b' + b a') / 2."""
    return (
        p[0] + factor * a[0] * b[0],
        p[1] + 0.5 * factor * (a[0] * b[1] + a[1] * b[0]),
        p[2] + 0.5 * factor * (a[0] * b[2] + a[2] * b[0]),
        p[3] + factor * a[1] * b[1],
        p[4] + 0.5 * factor * (a[1] * b[2] + a[2] * b[1]),
        p[5] + factor * a[2] * b[2],
    )


@jit
def _ahead(p: _Symmetric, dt: float, a: float, q: float) -> _Symmetric:
    """F P F' + Q."""
    return (
        p[0] + dt * (2.0 * p[1] + dt * p[3]) + q * dt**3 / 3.0,
        p[1] + dt * p[3] + q * dt**2 / 2.0,
        a * (p[2] + dt * p[4]),
        p[3] + q * dt,
        a * p[4],
        a * a * p[5] + 1.0 - a * a,
    )


@jit
def _behind(m: _Symmetric, dt: float, a: float) -> _Symmetric:
    """F' N F."""
    return (
        m[0],
        m[1] + dt * m[0],
        a * m[2],
        m[3] + dt * (2.0 * m[1] + dt * m[0]),
        a * (m[4] + dt * m[2]),
        a * a * m[5],
    )


@jit
def _filter(
    step_s: FloatArray,
    q: FloatArray,
    a: FloatArray,
    z: FloatArray,
    wander_m: FloatArray,
    variance: FloatArray,
    slack: FloatArray,
    excess: FloatArray,
    judge: bool,
) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Score, states and covariances after each fix; for each measurement P h, innovation and its
    variance.
    """
    n, total = len(step_s), 0.0
    xs, ps = np.empty((n, 3, 2)), np.empty((n, 6))
    gains, innovations, spreads = np.zeros((n, 2, 3)), np.zeros((n, 2, 2)), np.ones((n, 2))
    x, y = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    p = (_ANYWHERE_M2, 0.0, 0.0, _START_MPS2, 0.0, 1.0)
    for k in range(n):
        if k > 0:
            dt = step_s[k]
            p = _ahead(p, dt, a[k], q[k])
            x, y = (x[0] + dt * x[1], x[1], a[k] * x[2]), (y[0] + dt * y[1], y[1], a[k] * y[2])
        for j, h in enumerate(((1.0, 0.0, wander_m[k]), (0.0, 1.0, 0.0))):
            if variance[k, j] == np.inf:
                continue
            gain = _times(p, h)
            dx, dy = z[k, j, 0] - _dot(h, x), z[k, j, 1] - _dot(h, y)
            s = _dot(h, gain) + variance[k, j]
            if judge:
                apart2 = dx * dx + dy * dy
                if k > 0:
                    total -= np.log(s) + 0.5 * (STUDENT_DOF + 2.0) * np.log1p(
                        apart2 / s / STUDENT_DOF
                    )
                excess[k, j] = (
                    max(apart2 - 2.0 * (s + slack[k, j]), 0.0) / (STUDENT_DOF + 2.0)
                    if k > 0
                    else 0.0
                )
            s += excess[k, j]
            x, y, p = (
                _plus(x, dx / s, gain),
                _plus(y, dy / s, gain),
                _plus_outer(p, -1.0 / s, gain, gain),
            )
            gains[k, j] = gain
            innovations[k, j] = dx, dy
            spreads[k, j] = s
        xs[k, :, 0], xs[k, :, 1], ps[k] = x, y, p
    return total, xs, ps, gains, innovations, spreads


@jit
def _adjoint(
    step_s: FloatArray,
    a: FloatArray,
    wander_m: FloatArray,
    variance: FloatArray,
    gains: FloatArray,
    innovations: FloatArray,
    spreads: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Adjoint series r and N; for each measurement u (n, 2, 2) and D (n, 2): residual u / D, of
    variance 1 / D.
    """
    n = len(step_s)
    rs, ns, us, ds = np.empty((n, 3, 2)), np.empty((n, 6)), np.zeros((n, 2, 2)), np.ones((n, 2))
    rx, ry, m = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(n - 1, -1, -1):
        for j, h in ((1, (0.0, 1.0, 0.0)), (0, (1.0, 0.0, wander_m[k]))):
            if variance[k, j] == np.inf:
                continue
            s = spreads[k, j]
            gain = (gains[k, j, 0] / s, gains[k, j, 1] / s, gains[k, j, 2] / s)
            seen = _times(m, gain)
            ux, uy = (
                innovations[k, j, 0] / s - _dot(gain, rx),
                innovations[k, j, 1] / s - _dot(gain, ry),
            )
            d = 1.0 / s + _dot(gain, seen)
            rx, ry = _plus(rx, ux, h), _plus(ry, uy, h)
            m = _plus_outer(_plus_outer(m, -2.0, h, seen), d, h, h)
            us[k, j] = ux, uy
            ds[k, j] = d
        rs[k, :, 0], rs[k, :, 1], ns[k] = rx, ry, m
        dt = step_s[k]
        m = _behind(m, dt, a[k])
        rx, ry = (
            (rx[0], rx[1] + dt * rx[0], a[k] * rx[2]),
            (ry[0], ry[1] + dt * ry[0], a[k] * ry[2]),
        )
    return rs, ns, us, ds
