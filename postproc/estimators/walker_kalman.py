"""Kalman filter and adjoint smoother of a walker's track, compiled; the model is in `walker`.

The smoother inverts nothing and yields leave-one-out residuals (Bryson & Frazier 1963; de Jong, J.
Amer. Statist. Assoc. 84(408), 1989). A fix has two measurements, the position with h = [1, 0, s]
and the velocity with h = [0, 1, 0]; one with infinite variance is left out. Both axes share their
covariances. All functions work in place on small arrays, since numba is slow to allocate them.
"""

from math import log, log1p

import numpy as np

from logger.core.arrays import FloatArray
from postproc.estimators.machine_code import jit
from postproc.estimators.walker_model import Model, Series

STUDENT_DOF = 4.0  # heavy tails, and still a finite variance
_START_VARIANCE = np.array([1e8, 25.0, 1.0])
"""Position within 10 km of the first fix (m^2), a walker's velocity (m^2/s^2), wandering by s."""
_POSITION, _VELOCITY = 0, 1


def score(model: Model, excess: FloatArray) -> float:
    """Log-likelihood of the fixes, each innovation Student distributed.

    Overwrites `excess` (n, 2) with what the innovations suggest.
    """
    return float(_filter(model, excess, True)[0])


def excess_variance(apart2: FloatArray, expected: FloatArray) -> FloatArray:
    """Variance to be added to that of a measurement whose error is too large for it.

    All three have the same shape. Of a Student error with nu degrees of freedom and squared size
    e^2 on two axes where E was expected on one, the variance is E (nu + e^2 / E) / (nu + 2) at
    least.
    """
    return np.maximum(apart2 - 2.0 * expected, 0.0) / (STUDENT_DOF + 2.0)


def smooth(model: Model, excess: FloatArray) -> tuple[Series, FloatArray, FloatArray]:
    """Smooth with `excess` (n, 2) added to the variances; compare each measurement with the others.

    Returns the series, the squared distance (n, 2) of each measurement from the prediction by all
    others, and the variance (n, 2) of it expected on each axis, with the slack, without the excess.
    """
    _, x, p, gains, innovations, variances = _filter(model, excess, False)
    r, n, residuals, precision = _adjoint(model, gains, innovations, variances)
    slack = np.where(np.isfinite(model.variance), model.slack, 0.0)
    apart2 = np.sum(residuals**2, axis=2) / precision**2
    return Series(x, p, r, n), apart2, 1.0 / precision - excess + slack


@jit
def _dot(a: FloatArray, b: FloatArray) -> float:
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


@jit
def _multiply(matrix: FloatArray, v: FloatArray, product: FloatArray) -> None:
    for i in range(3):
        product[i] = _dot(matrix[i], v)


@jit
def _differ(z: FloatArray, h: FloatArray, x: FloatArray, difference: FloatArray) -> None:
    """Difference z - h' X on both axes."""
    for axis in range(2):
        difference[axis] = z[axis] - _dot(h, x[:, axis])


@jit
def _add_product(rows: FloatArray, factor: float, v: FloatArray, u: FloatArray) -> None:
    """X += factor v u', with X (3, 2)."""
    for i in range(3):
        for axis in range(2):
            rows[i, axis] += factor * v[i] * u[axis]


@jit
def _add_outer(matrix: FloatArray, factor: float, a: FloatArray, b: FloatArray) -> None:
    """M += factor (a b' + b a') / 2."""
    for i in range(3):
        for j in range(3):
            matrix[i, j] += 0.5 * factor * (a[i] * b[j] + a[j] * b[i])


@jit
def _transition(rows: FloatArray, to: int, source: int, dt: float, a: float) -> None:
    """F M for `to` 0 and `source` 1, F' M for `to` 1 and `source` 0; M has 3 rows."""
    for j in range(rows.shape[1]):
        rows[to, j] += dt * rows[source, j]
        rows[2, j] *= a


@jit
def _predict(x: FloatArray, p: FloatArray, dt: float, a: float, q: float) -> None:
    """F x and F P F' + Q."""
    _transition(x, 0, 1, dt, a)
    _transition(p, 0, 1, dt, a)
    _transition(p.T, 0, 1, dt, a)
    p[0, 0] += q * dt**3 / 3.0
    p[0, 1] += q * dt**2 / 2.0
    p[1, 0] += q * dt**2 / 2.0
    p[1, 1] += q * dt
    p[2, 2] += 1.0 - a * a


@jit
def _observation(h: FloatArray, kind: int, wander_m: float) -> None:
    """Row h of a measurement."""
    h[0], h[1], h[2] = (1.0, 0.0, wander_m) if kind == _POSITION else (0.0, 1.0, 0.0)


@jit
def _log_student(apart2: float, variance: float) -> float:
    """Log density of an innovation on two axes, but for a constant."""
    return -log(variance) - 0.5 * (STUDENT_DOF + 2.0) * log1p(apart2 / variance / STUDENT_DOF)


_excess_variance = jit(excess_variance)


@jit
def _filter(
    model: Model, excess: FloatArray, robust: bool
) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Log-likelihood; states and covariances; P h, innovation and its variance by measurement.

    `robust` sets `excess` from the innovations; else it is used as it is.
    """
    n, log_likelihood = len(model.step_s), 0.0
    xs, ps = np.empty((n, 3, 2)), np.empty((n, 3, 3))
    gains, innovations, variances = np.zeros((n, 2, 3)), np.zeros((n, 2, 2)), np.ones((n, 2))
    x, p, h = np.zeros((3, 2)), np.diag(_START_VARIANCE), np.empty(3)
    for k in range(n):
        if k > 0:
            _predict(x, p, model.step_s[k], model.a[k], model.q[k])
        for kind in (_POSITION, _VELOCITY):
            if model.variance[k, kind] == np.inf:
                continue
            _observation(h, kind, model.wander_m[k])
            gain, e = gains[k, kind], innovations[k, kind]
            _multiply(p, h, gain)
            _differ(model.z[k, kind], h, x, e)
            variance = _dot(h, gain) + model.variance[k, kind]
            if robust:
                excess[k, kind] = 0.0
                if k > 0:  # the first fix has no prediction
                    apart2 = e[0] * e[0] + e[1] * e[1]
                    log_likelihood += _log_student(apart2, variance)
                    expected = variance + model.slack[k, kind]
                    excess[k, kind] = _excess_variance(apart2, expected)
            variance += excess[k, kind]
            _add_product(x, 1.0 / variance, gain, e)
            _add_outer(p, -1.0 / variance, gain, gain)
            variances[k, kind] = variance
        xs[k], ps[k] = x, p
    return log_likelihood, xs, ps, gains, innovations, variances


@jit
def _adjoint(
    model: Model, gains: FloatArray, innovations: FloatArray, variances: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Adjoint series r and N; for each measurement u (n, 2, 2) and D (n, 2).

    The leave-one-out residual is u / D, of variance 1 / D.
    """
    n = len(model.step_s)
    rs, ns = np.empty((n, 3, 2)), np.empty((n, 3, 3))
    residuals, precision = np.zeros((n, 2, 2)), np.ones((n, 2))
    r, m, h, m_gain = np.zeros((3, 2)), np.zeros((3, 3)), np.empty(3), np.empty(3)
    for k in range(n - 1, -1, -1):
        for kind in (_VELOCITY, _POSITION):
            if model.variance[k, kind] == np.inf:
                continue
            _observation(h, kind, model.wander_m[k])
            gain, s, u = gains[k, kind], variances[k, kind], residuals[k, kind]
            _multiply(m, gain, m_gain)
            d = 1.0 / s + _dot(gain, m_gain) / s**2
            _differ(innovations[k, kind], gain, r, u)
            u /= s
            _add_product(r, 1.0, h, u)
            _add_outer(m, -2.0 / s, h, m_gain)
            _add_outer(m, d, h, h)
            precision[k, kind] = d
        rs[k], ns[k] = r, m
        dt, a = model.step_s[k], model.a[k]
        _transition(r, 1, 0, dt, a)
        _transition(m, 1, 0, dt, a)
        _transition(m.T, 1, 0, dt, a)
    return rs, ns, residuals, precision
