"""Kalman filter and adjoint smoother of a walker's track; `walker` makes the model.

The smoother inverts nothing and yields leave-one-out residuals (Bryson & Frazier 1963; de Jong, J.
Amer. Statist. Assoc. 84(408), 1989). Its matrices are reduced by products (Joseph's form): after an
hour without a fix the variance is 1e11 m2, and a difference of two of those is not positive.

A fix has two measurements, the position with h = [1, 0, s] and the velocity with h = [0, 1, 0]; one
with infinite variance is left out. Both axes share their covariances. Symmetric matrices are tuples
(00, 01, 02, 11, 12, 22): plain numbers take 8 us a fix in Python where numpy's matrices take 27.
"""

from math import inf, log, log1p
from typing import NamedTuple, TypeVar

import numpy as np

from logger.core.arrays import FloatArray


class Model(NamedTuple):
    """Fixes and what is assumed of them.

    `step_s` (n,) is the time since the fix before, `q` and `a` (n,) belong to that step. `z` (n, 2,
    2) is by fix, kind (position, velocity) and axis, `wander_m` (n,) is s, `variance` (n, 2) that
    of the white noise, `slack` (n, 2) the variance within which nothing is an outlier.
    """

    step_s: FloatArray
    q: FloatArray
    a: FloatArray
    z: FloatArray
    wander_m: FloatArray
    variance: FloatArray
    slack: FloatArray

    def part(self, some: slice) -> "Model":
        """That of some of the fixes."""
        return Model(*(values[some] for values in self))


class Series(NamedTuple):
    """States `x` (n, 3, 2) and covariances `p` (n, 3, 3) of the filter after each fix.

    Adjoint vectors `r` (n, 3, 2) and matrices `n` (n, 3, 3): what a fix and all later ones add to
    the state before it. `apart2` (n, 2) is the squared distance of each measurement from the
    prediction by all others, `expected` (n, 2) the variance of it expected on each axis.
    """

    x: FloatArray
    p: FloatArray
    r: FloatArray
    n: FloatArray
    apart2: FloatArray
    expected: FloatArray


STUDENT_DOF = 4.0  # heavy tails, and still a finite variance
_START_VARIANCE = 1e8, 25.0, 1.0
"""Position within 10 km of the first fix (m^2), a walker's velocity (m^2/s^2), wandering by s."""
_POSITION, _VELOCITY = 0, 1

Variance = TypeVar("Variance", float, FloatArray)
Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]


_Measured = tuple[int, Vector, float, float, float, float]
"""A measurement in the filter: its kind, P h, innovations, variances of noise and of these."""


class _Step(NamedTuple):
    """States of both axes and covariance after a fix, and its measurements."""

    by_axis: tuple[Vector, Vector]
    p: Symmetric
    measured: list[_Measured]


def score(model: Model, excess: FloatArray) -> float:
    """Log-likelihood of the fixes, each innovation Student distributed.

    Overwrites `excess` (n, 2) with what the innovations suggest.
    """
    return _filter(model, excess, None)


def excess_variance(apart2: Variance, expected: Variance) -> Variance:
    """Variance to be added to that of a measurement whose error is too large for it.

    All three have the same shape. Of a Student error with nu degrees of freedom and squared size
    e^2 on two axes where E was expected on one, the variance is E (nu + e^2 / E) / (nu + 2) at
    least.
    """
    excess: Variance = np.maximum(apart2 - 2.0 * expected, 0.0) / (STUDENT_DOF + 2.0)
    return excess


def _row(kind: int, wander_m: float) -> Vector:
    return (1.0, 0.0, wander_m) if kind == _POSITION else (0.0, 1.0, 0.0)


def _plus(x: Vector, factor: float, v: Vector) -> Vector:
    return x[0] + factor * v[0], x[1] + factor * v[1], x[2] + factor * v[2]


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


def _measure_position(m: Symmetric, a: Vector, s: float, noise: float, rest: float) -> Symmetric:
    """L M L' + noise a a' with L = I - a h', written out for h = [1, 0, s]; `rest` is 1 - a'h."""
    m00, m01, m02, m11, m12, m22 = m
    a0, a1, a2 = a
    t0, t1, t2 = -a0 * s, -a1 * s, rest + a0  # third column of L
    l00 = rest + a2 * s
    b00, b01, b02 = l00 * m00 + t0 * m02, l00 * m01 + t0 * m12, l00 * m02 + t0 * m22
    b10, b11, b12 = m01 - a1 * m00 + t1 * m02, m11 - a1 * m01 + t1 * m12, m12 - a1 * m02 + t1 * m22
    b20, b22 = t2 * m02 - a2 * m00, t2 * m22 - a2 * m02
    n0, n1, n2 = noise * a0, noise * a1, noise * a2
    return (
        b00 * l00 + b02 * t0 + n0 * a0,
        b01 - b00 * a1 + b02 * t1 + n0 * a1,
        b02 * t2 - b00 * a2 + n0 * a2,
        b11 - b10 * a1 + b12 * t1 + n1 * a1,
        b12 * t2 - b10 * a2 + n1 * a2,
        b22 * t2 - b20 * a2 + n2 * a2,
    )


def _measure_velocity(m: Symmetric, a: Vector, _: float, noise: float, rest: float) -> Symmetric:
    """The same for h = [0, 1, 0]."""
    m00, m01, m02, m11, m12, m22 = m
    a0, a1, a2 = a
    b01, b21 = m01 - a0 * m11, m12 - a2 * m11
    n0, n1, n2 = noise * a0, noise * a1, noise * a2
    return (
        m00 - a0 * (m01 + b01) + n0 * a0,
        rest * b01 + n0 * a1,
        m02 - a0 * m12 - a2 * b01 + n0 * a2,
        rest * rest * m11 + n1 * a1,
        rest * b21 + n1 * a2,
        m22 - a2 * (m12 + b21) + n2 * a2,
    )


def _before_position(m: Symmetric, a: Vector, s: float, added: float, rest: float) -> Symmetric:
    """L' M L + added h h', with L and h of `_measure_position`."""
    m00, m01, m02, m11, m12, m22 = m
    a0, a1, a2 = a
    r0, c0, c1, c2 = rest + s * a2, -s * a0, -s * a1, rest + a0  # rows 0 and 2 of L'
    b00, b01, b02 = (
        r0 * m00 - a1 * m01 - a2 * m02,
        r0 * m01 - a1 * m11 - a2 * m12,
        r0 * m02 - a1 * m12 - a2 * m22,
    )
    b20, b21, b22 = (
        c0 * m00 + c1 * m01 + c2 * m02,
        c0 * m01 + c1 * m11 + c2 * m12,
        c0 * m02 + c1 * m12 + c2 * m22,
    )
    return (
        r0 * b00 - a1 * b01 - a2 * b02 + added,
        b01,
        c0 * b00 + c1 * b01 + c2 * b02 + s * added,
        m11,
        b21,
        c0 * b20 + c1 * b21 + c2 * b22 + s * s * added,
    )


def _before_velocity(m: Symmetric, a: Vector, _: float, added: float, rest: float) -> Symmetric:
    """The same with those of `_measure_velocity`."""
    m00, m01, m02, m11, m12, m22 = m
    a0, _, a2 = a
    b0, b1, b2 = (
        rest * m01 - a0 * m00 - a2 * m02,
        rest * m11 - a0 * m01 - a2 * m12,
        rest * m12 - a0 * m02 - a2 * m22,
    )
    return m00, b0, m02, rest * b1 - a0 * b0 - a2 * b2 + added, b2, m22


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


def _square(packed: list[Symmetric]) -> FloatArray:
    """The symmetric matrices (n, 3, 3)."""
    return np.array(packed)[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


def _filter(  # noqa: C901 (the filter in one piece)
    model: Model, excess: FloatArray, steps: list[_Step] | None
) -> float:
    """The filter over all fixes, with `excess` as it is; it adds each to `steps`.

    Without `steps` it is the log-likelihood of the innovations, and sets `excess` from these.
    """
    log_likelihood = 0.0
    x, y = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    p00, p11, p22 = _START_VARIANCE
    p = (p00, 0.0, 0.0, p11, 0.0, p22)
    step_s, q, decay, z, wander_m, variances, slack = (values.tolist() for values in model)
    added = excess.tolist()
    for k, dt in enumerate(step_s):
        if k > 0:
            x, y = _predict_state(x, dt, decay[k]), _predict_state(y, dt, decay[k])
            p = _predict_covariance(p, dt, decay[k], q[k])
        measured: list[_Measured] = []
        for kind in (_POSITION, _VELOCITY):
            noise = variances[k][kind]
            if noise == inf:
                continue
            s = wander_m[k]
            p00, p01, p02, p11, p12, p22 = p
            if kind == _POSITION:
                gain = p00 + s * p02, p01 + s * p12, p02 + s * p22  # P h
                east, north = x[0] + s * x[2], y[0] + s * y[2]
                variance = gain[0] + s * gain[2] + noise
            else:
                gain, east, north, variance = (p01, p11, p12), x[1], y[1], p11 + noise
            east, north = z[k][kind][0] - east, z[k][kind][1] - north
            if steps is None:
                added[k][kind] = 0.0
                if k > 0:  # the first fix has no prediction
                    apart2 = east * east + north * north
                    tail = log1p(apart2 / variance / STUDENT_DOF)
                    log_likelihood += -log(variance) - 0.5 * (STUDENT_DOF + 2.0) * tail
                    expected = variance + slack[k][kind]
                    added[k][kind] = max(apart2 - 2.0 * expected, 0.0) / (STUDENT_DOF + 2.0)
            noise += added[k][kind]
            variance += added[k][kind]
            share = _scale(gain, 1.0 / variance)
            x, y = _plus(x, east, share), _plus(y, north, share)
            after = _measure_position if kind == _POSITION else _measure_velocity
            p = after(p, share, s, noise, noise / variance)
            if steps is not None:
                measured.append((kind, gain, east, north, noise, variance))
        if steps is not None:
            steps.append(_Step((x, y), p, measured))
    if steps is None:
        excess[:] = np.reshape(added, excess.shape)
    return log_likelihood


def smooth(model: Model, excess: FloatArray) -> Series:
    """Smooth with `excess` (n, 2) added to the variances; compare each measurement with the others.

    What is expected has the slack and not the excess.
    """
    steps: list[_Step] = []
    _filter(model, excess, steps)
    count = len(steps)
    # of each measurement u and D: its leave-one-out residual is u / D, of variance 1 / D
    residual, precision = np.zeros((count, 2, 2)), np.ones((count, 2))
    rx, ry = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    m = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    vectors, matrices = [], []
    step_s, decay, wander_m = (v.tolist() for v in (model.step_s, model.a, model.wander_m))
    for k in range(count - 1, -1, -1):
        for kind, gain, ahead, aside, noise, variance in reversed(steps[k].measured):
            share = _scale(gain, 1.0 / variance)
            east = ahead / variance - _dot(share, rx)
            north = aside / variance - _dot(share, ry)
            residual[k, kind] = east, north
            precision[k, kind] = 1.0 / variance + _dot(share, _times(m, share))
            s, h = wander_m[k], _row(kind, wander_m[k])
            rx, ry = _plus(rx, east, h), _plus(ry, north, h)
            before = _before_position if kind == _POSITION else _before_velocity
            m = before(m, share, s, 1.0 / variance, noise / variance)
        vectors.append((rx, ry))
        matrices.append(m)
        dt, a = step_s[k], decay[k]
        rx, ry = _earlier_vector(rx, dt, a), _earlier_vector(ry, dt, a)
        m = _earlier_matrix(m, dt, a)
    slack = np.where(np.isfinite(model.variance), model.slack, 0.0)
    return Series(
        x=np.swapaxes(np.array([one.by_axis for one in steps]), 1, 2),
        p=_square([one.p for one in steps]),
        r=np.swapaxes(np.array(vectors[::-1]), 1, 2),
        n=_square(matrices[::-1]),
        apart2=np.sum(residual**2, axis=2) / precision**2,
        expected=1.0 / precision - excess + slack,
    )
