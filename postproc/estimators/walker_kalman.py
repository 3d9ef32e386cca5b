"""Kalman filter and adjoint smoother of a walker's track; the model is in `walker`.

The smoother inverts nothing and yields leave-one-out residuals (Bryson & Frazier 1963; de Jong, J.
Amer. Statist. Assoc. 84(408), 1989). Its matrices are reduced by products (Joseph's form): after an
hour without a fix the variance is 1e11 m2, and a difference of two of those is not positive.

A fix has two measurements, the position with h = [1, 0, s] and the velocity with h = [0, 1, 0]; one
with infinite variance is left out. Both axes share their covariances. Symmetric matrices are tuples
(00, 01, 02, 11, 12, 22): plain numbers are quick in Python.
"""

from math import inf, log, log1p
from typing import NamedTuple, TypeVar

import numpy as np

from logger.core.arrays import FloatArray
from postproc.estimators.walker_model import Model, Series

STUDENT_DOF = 4.0  # heavy tails, and still a finite variance
_START_VARIANCE = 1e8, 25.0, 1.0
"""Position within 10 km of the first fix (m^2), a walker's velocity (m^2/s^2), wandering by s."""
_POSITION, _VELOCITY = 0, 1

Variance = TypeVar("Variance", float, FloatArray)
Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]


class _Filtered(NamedTuple):
    """What the filter finds: `x` and `p` of `Series`; by fix and kind P h, innovation, variance."""

    x: FloatArray
    p: FloatArray
    gain: FloatArray
    innovation: FloatArray
    variance: FloatArray

    @classmethod
    def rows(cls, count: int) -> "_Filtered":
        gain, innovation = np.zeros((count, 2, 3)), np.zeros((count, 2, 2))
        x, p = np.empty((count, 3, 2)), np.empty((count, 3, 3))
        return cls(x, p, gain, innovation, np.ones((count, 2)))


def score(model: Model, excess: FloatArray) -> float:
    """Log-likelihood of the fixes, each innovation Student distributed.

    Overwrites `excess` (n, 2) with what the innovations suggest.
    """
    return _filter(model, excess, _Filtered.rows(0), robust=True)


def excess_variance(apart2: Variance, expected: Variance) -> Variance:
    """Variance to be added to that of a measurement whose error is too large for it.

    All three have the same shape. Of a Student error with nu degrees of freedom and squared size
    e^2 on two axes where E was expected on one, the variance is E (nu + e^2 / E) / (nu + 2) at
    least.
    """
    excess: Variance = np.maximum(apart2 - 2.0 * expected, 0.0) / (STUDENT_DOF + 2.0)
    return excess


def smooth(model: Model, excess: FloatArray) -> tuple[Series, FloatArray, FloatArray]:
    """Smooth with `excess` (n, 2) added to the variances; compare each measurement with the others.

    Returns the series, the squared distance (n, 2) of each measurement from the prediction by all
    others, and the variance (n, 2) of it expected on each axis, with the slack, without the excess.
    """
    count = len(model.step_s)
    of_fixes, r, n = _Filtered.rows(count), np.empty((count, 3, 2)), np.empty((count, 3, 3))
    residual, precision = np.zeros((count, 2, 2)), np.ones((count, 2))
    _filter(model, excess, of_fixes, robust=False)
    _adjoint(model, excess, of_fixes, r, n, residual, precision)
    slack = np.where(np.isfinite(model.variance), model.slack, 0.0)
    apart2 = np.sum(residual**2, axis=2) / precision**2
    return Series(of_fixes.x, of_fixes.p, r, n), apart2, 1.0 / precision - excess + slack


def _row(kind: int, wander_m: float) -> Vector:
    """Row h of a measurement."""
    return (1.0, 0.0, wander_m) if kind == _POSITION else (0.0, 1.0, 0.0)


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _times(m: Symmetric, v: Vector) -> Vector:
    m00, m01, m02, m11, m12, m22 = m
    v0, v1, v2 = v
    return (
        m00 * v0 + m01 * v1 + m02 * v2,
        m01 * v0 + m11 * v1 + m12 * v2,
        m02 * v0 + m12 * v1 + m22 * v2,
    )


def _scale(v: Vector, factor: float) -> Vector:
    return factor * v[0], factor * v[1], factor * v[2]


def _plus(x: Vector, factor: float, v: Vector) -> Vector:
    return x[0] + factor * v[0], x[1] + factor * v[1], x[2] + factor * v[2]


def _plus_square(m: Symmetric, factor: float, a: Vector) -> Symmetric:
    """M + factor a a'."""
    m00, m01, m02, m11, m12, m22 = m
    a0, a1, a2 = a
    return (
        m00 + factor * a0 * a0,
        m01 + factor * a0 * a1,
        m02 + factor * a0 * a2,
        m11 + factor * a1 * a1,
        m12 + factor * a1 * a2,
        m22 + factor * a2 * a2,
    )


def _reduce(m: Symmetric, a: Vector, b: Vector, rest: float) -> Symmetric:
    """L M L' with L = I - a b', where `rest` is 1 - a'b."""
    a0, a1, a2 = a
    b0, b1, b2 = b
    c0, c1, c2 = a0 * b0, a1 * b1, a2 * b2
    row0 = rest + c1 + c2, -a0 * b1, -a0 * b2
    row1 = -a1 * b0, rest + c0 + c2, -a1 * b2
    row2 = -a2 * b0, -a2 * b1, rest + c0 + c1
    column0, column1, column2 = _times(m, row0), _times(m, row1), _times(m, row2)
    return (
        _dot(row0, column0),
        _dot(row0, column1),
        _dot(row0, column2),
        _dot(row1, column1),
        _dot(row1, column2),
        _dot(row2, column2),
    )


def _predict_state(x: Vector, dt: float, a: float) -> Vector:
    """F x."""
    return x[0] + dt * x[1], x[1], a * x[2]


def _predict_covariance(p: Symmetric, dt: float, a: float, q: float) -> Symmetric:
    """F P F' + Q."""
    p00, p01, p02, p11, p12, p22 = p
    later01 = p01 + dt * p11
    return (
        p00 + dt * (p01 + later01) + q * dt**3 / 3.0,
        later01 + q * dt**2 / 2.0,
        a * (p02 + dt * p12),
        p11 + q * dt,
        a * p12,
        a * a * p22 + 1.0 - a * a,
    )


def _earlier_vector(r: Vector, dt: float, a: float) -> Vector:
    """F' r."""
    return r[0], r[1] + dt * r[0], a * r[2]


def _earlier_matrix(m: Symmetric, dt: float, a: float) -> Symmetric:
    """F' M F."""
    m00, m01, m02, m11, m12, m22 = m
    before01 = m01 + dt * m00
    return m00, before01, a * m02, m11 + dt * (m01 + before01), a * (m12 + dt * m02), a * a * m22


def _log_student(apart2: float, variance: float) -> float:
    """Log density of an innovation on two axes, but for a constant."""
    return -log(variance) - 0.5 * (STUDENT_DOF + 2.0) * log1p(apart2 / variance / STUDENT_DOF)


def _store(
    vectors: FloatArray, matrices: FloatArray, k: int, x: Vector, y: Vector, m: Symmetric
) -> None:
    """Rows k: the vectors of both axes and a symmetric matrix."""
    vectors[k, :, 0], vectors[k, :, 1] = x, y
    m00, m01, m02, m11, m12, m22 = m
    matrices[k] = (m00, m01, m02), (m01, m11, m12), (m02, m12, m22)


def _filter(model: Model, excess: FloatArray, of_fixes: _Filtered, *, robust: bool) -> float:
    """The filter over all fixes; the log-likelihood of their innovations if `robust`.

    Then it sets `excess` from the innovations. Else it uses `excess` as it is and fills `of_fixes`.
    """
    log_likelihood = 0.0
    x, y = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    p00, p11, p22 = _START_VARIANCE
    p = (p00, 0.0, 0.0, p11, 0.0, p22)
    step_s, q, decay, z, wander_m, variances, slack = (values.tolist() for values in model)
    for k, dt in enumerate(step_s):
        if k > 0:
            x, y = _predict_state(x, dt, decay[k]), _predict_state(y, dt, decay[k])
            p = _predict_covariance(p, dt, decay[k], q[k])
        for kind in (_POSITION, _VELOCITY):
            noise = variances[k][kind]
            if noise == inf:
                continue
            h = _row(kind, wander_m[k])
            gain = _times(p, h)
            east = z[k][kind][0] - _dot(h, x)
            north = z[k][kind][1] - _dot(h, y)
            variance = _dot(h, gain) + noise
            if robust:
                added = 0.0
                if k > 0:  # the first fix has no prediction
                    apart2 = east * east + north * north
                    log_likelihood += _log_student(apart2, variance)
                    expected = variance + slack[k][kind]
                    added = max(apart2 - 2.0 * expected, 0.0) / (STUDENT_DOF + 2.0)
                excess[k, kind] = added
            else:
                added = float(excess[k, kind])
            noise += added
            variance += added
            share = _scale(gain, 1.0 / variance)
            x, y = _plus(x, east, share), _plus(y, north, share)
            p = _plus_square(_reduce(p, share, h, noise / variance), noise, share)
            if not robust:
                of_fixes.gain[k, kind] = gain
                of_fixes.innovation[k, kind] = east, north
                of_fixes.variance[k, kind] = variance
        if not robust:
            _store(of_fixes.x, of_fixes.p, k, x, y, p)
    return log_likelihood


def _adjoint(
    model: Model,
    excess: FloatArray,
    of_fixes: _Filtered,
    r: FloatArray,
    n: FloatArray,
    residual: FloatArray,
    precision: FloatArray,
) -> None:
    """Adjoint series `r` and `n` of `Series`; u (n, 2, 2) and D (n, 2) of each measurement.

    The leave-one-out residual is u / D, of variance 1 / D.
    """
    rx, ry = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    m = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    step_s, _, decay, _, wander_m, variances, _ = (values.tolist() for values in model)
    for k in range(len(step_s) - 1, -1, -1):
        for kind in (_VELOCITY, _POSITION):
            noise = variances[k][kind]
            if noise == inf:
                continue
            noise += float(excess[k, kind])
            h = _row(kind, wander_m[k])
            s = float(of_fixes.variance[k, kind])
            share = _scale(tuple(of_fixes.gain[k, kind].tolist()), 1.0 / s)
            east, north = of_fixes.innovation[k, kind].tolist()
            east, north = east / s - _dot(share, rx), north / s - _dot(share, ry)
            rx, ry = _plus(rx, east, h), _plus(ry, north, h)
            residual[k, kind, 0], residual[k, kind, 1] = east, north
            precision[k, kind] = 1.0 / s + _dot(share, _times(m, share))
            m = _plus_square(_reduce(m, h, share, noise / s), 1.0 / s, h)
        _store(r, n, k, rx, ry, m)
        dt, a = step_s[k], decay[k]
        rx, ry = _earlier_vector(rx, dt, a), _earlier_vector(ry, dt, a)
        m = _earlier_matrix(m, dt, a)
