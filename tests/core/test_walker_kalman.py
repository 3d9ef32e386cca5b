"""The smoother against the dense solution: one joint Gaussian of all states and measurements."""

from bisect import bisect
from fractions import Fraction
from operator import mul

import numpy as np
import pytest

from logger.core import walker, walker_kalman
from tests.kit.walker_tracks import track


def dense(model, times_s, at_s, q):
    """Mean and variance of the position at `at_s`, from one joint Gaussian.

    Also, for each measurement, its distance from the prediction by all the others, and the variance
    of that.
    """
    every = np.unique(np.concatenate([times_s, at_s]))
    size = 3 * len(every)
    first = int(np.searchsorted(every, times_s[0]))
    # innovations form: every state is a sum of independent increments
    root = np.zeros((size, 3 * len(every)))
    root[3 * first : 3 * first + 3, 3 * first : 3 * first + 3] = np.diag([1e4, 5.0, 1.0])
    for k in [*range(first + 1, len(every)), *range(first - 1, -1, -1)]:
        origin = k - 1 if k > first else k + 1
        dt = every[k] - every[origin]
        a = np.exp(-abs(dt) / walker.WANDER_S)
        step = abs(dt)
        noise = np.array(
            [
                [q * step**3 / 3, q * dt * step / 2, 0],
                [q * dt * step / 2, q * step, 0],
                [0, 0, 1 - a * a],
            ]
        )
        own = slice(3 * k, 3 * k + 3)
        root[own] = np.array([[1, dt, 0], [0, 1, 0], [0, 0, a]]) @ root[3 * origin : 3 * origin + 3]
        root[own, own] += np.linalg.cholesky(noise)
    h, z, r = [], [], []
    for i, t in enumerate(times_s):
        k = int(np.searchsorted(every, t))
        for j, row in enumerate(([1.0, 0.0, model.wander_m[i]], [0.0, 1.0, 0.0])):
            if np.isfinite(model.variance[i, j]):
                h.append(np.zeros(size))
                h[-1][3 * k : 3 * k + 3] = row
                z.append(model.z[i, j])
                r.append(model.variance[i, j])
    h, z, prior = np.array(h), np.array(z), root @ root.T
    joint = h @ prior @ h.T + np.diag(r)
    rows = prior[3 * np.searchsorted(every, at_s)]
    gain = np.linalg.solve(joint, h @ rows.T).T
    spread = np.diag(prior)[3 * np.searchsorted(every, at_s)] - np.sum(gain * (rows @ h.T), axis=1)
    inverse = np.linalg.inv(joint)
    return gain @ z, spread, (inverse @ z) / np.diag(inverse)[:, None], 1.0 / np.diag(inverse)


def test_smoother_agrees_with_the_dense_solution():
    rng = np.random.default_rng(1)
    t_s = np.sort(rng.uniform(0.0, 60.0, 14))
    t_s[5] = t_s[4]  # a repeated time stamp
    fixes = track(t_s, 20.0 * rng.normal(size=(14, 2)), rng.uniform(2.0, 6.0, 14))
    sigma = np.where(rng.random(14) < 0.5, 0.4, np.inf)
    speed = walker.Velocities(rng.normal(size=14), rng.normal(size=14), sigma)
    q = 0.3
    model = walker._model(fixes, speed, q, 0.2)._replace(q=np.full(14, q))
    excess = rng.uniform(0.0, 3.0, (14, 2))
    series = walker_kalman.smooth(model, excess)
    model = model._replace(variance=model.variance + excess)
    times_s = (fixes.t_ns - fixes.t_ns[0]) / 1e9
    at_s = np.concatenate(
        [
            [-7.0, -0.5],
            times_s,
            rng.uniform(0.0, times_s[-1], 10),
            times_s[-1] + np.array([0.5, 8.0]),
        ]
    )
    mean, variance = walker.interpolate(times_s, series, q, at_s)
    # beyond gaps of 10 s the walk is taken to be livelier than the dense solution has it
    step_s = np.diff(times_s)[np.clip(np.searchsorted(times_s, at_s, side="right") - 1, 0, 12)]
    same = step_s <= 10.0
    expected_mean, expected_variance, residual, residual_variance = dense(model, times_s, at_s, q)
    assert np.count_nonzero(same) > 15
    np.testing.assert_allclose(mean[same], expected_mean[same], rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(variance[same], expected_variance[same], rtol=1e-6, atol=1e-5)
    known = np.isfinite(model.variance)
    np.testing.assert_allclose(
        series.apart2[known], np.sum(residual**2, axis=1), rtol=1e-5, atol=1e-5
    )
    np.testing.assert_allclose(
        (series.expected - model.slack + excess)[known], residual_variance, rtol=1e-5, atol=1e-5
    )


def exact_variance(model, times_s, at_s):
    """Variance of the position at `at_s`, not before the first fix, in exact fractions."""
    every = sorted({*times_s, *at_s})
    before = [max(0, bisect(times_s, t) - 1) for t in every]
    step_q = [model.q[min(k + 1, len(times_s) - 1)] for k in before]
    start = [[Fraction(1e8), 0, 0], [0, Fraction(25), 0], [0, 0, Fraction(1)]]
    covariance = [[start]]  # of the states at all times so far
    for k in range(1, len(every)):
        dt, q = Fraction(every[k]) - Fraction(every[k - 1]), Fraction(step_q[k - 1])
        a = Fraction(float(np.exp(-float(dt) / walker.WANDER_S)))
        step = [[1, dt, 0], [0, 1, 0], [0, 0, a]]
        noise = [[q * dt**3 / 3, q * dt**2 / 2, 0], [q * dt**2 / 2, q * dt, 0], [0, 0, 1 - a * a]]
        ahead = [product(step, one) for one in covariance[-1]]
        own = product(ahead[-1], transpose(step))
        covariance.append([*ahead, [[own[i][j] + noise[i][j] for j in range(3)] for i in range(3)]])

    def between(k, i, row):
        """Covariances of the state at time k with what `row` measures at time i."""
        one = covariance[k][i] if i <= k else transpose(covariance[i][k])
        return [sum(one[j][m] * row[m] for m in range(3)) for j in range(3)]

    rows = [
        (every.index(t), row, Fraction(model.variance[i, j]))
        for i, t in enumerate(times_s)
        for j, row in enumerate(([1, 0, Fraction(model.wander_m[i])], [0, 1, 0]))
        if np.isfinite(model.variance[i, j])
    ]
    joint = [
        [
            sum(map(mul, between(k, i, row), own)) + (noise if m == n else 0)
            for n, (i, row, _) in enumerate(rows)
        ]
        for m, (k, own, noise) in enumerate(rows)
    ]
    known = [[between(every.index(t), i, row)[0] for i, row, _ in rows] for t in at_s]
    weights = solve(joint, transpose(known))
    prior = [covariance[every.index(t)][every.index(t)][0][0] for t in at_s]
    of_each = zip(known, transpose(weights), strict=True)
    explained = [sum(map(mul, one, weight)) for one, weight in of_each]
    return np.array([float(p - e) for p, e in zip(prior, explained, strict=True)])


def product(a, b):
    return [[sum(map(mul, row, column)) for column in zip(*b, strict=True)] for row in a]


def transpose(a):
    return [list(column) for column in zip(*a, strict=True)]


def solve(a, b):
    """A^-1 B of fractions, A positive definite."""
    rows = [[*one, *other] for one, other in zip(a, b, strict=True)]
    for k in range(len(rows)):
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for i in range(len(rows)):
            if i != k:
                rows[i] = [v - rows[i][k] * w for v, w in zip(rows[i], rows[k], strict=True)]
    return [row[len(a) :] for row in rows]


@pytest.mark.parametrize("claimed_m", [0.01, 7.0, 60.0])
@pytest.mark.parametrize("gap_s", [12.0, 600.0, 3600.0])
@pytest.mark.parametrize("with_velocity", [False, True])
def test_variance_before_the_fix_that_ends_a_gap(claimed_m, gap_s, with_velocity):
    """After an hour the variance is 1e11 m2, and a fix leaves a few of them."""
    t_s = np.cumsum([0.0, 8.0, 8.0, gap_s, 8.0, 8.0])
    fixes = track(t_s, np.zeros((6, 2)), claimed_m)
    given = walker.Velocities(np.zeros(6), np.zeros(6), np.full(6, 0.3)) if with_velocity else None
    q = max(walker.ACCELERATIONS_M2S3)
    model = walker._model(fixes, given, q, 0.02)
    series = walker_kalman.smooth(model, np.zeros((6, 2)))
    at_s = [*t_s, t_s[3] - 0.01, t_s[3] - 0.5, t_s[3] - 4.0, t_s[2] + 0.5 * gap_s, t_s[2] + 1.0]
    _, variance = walker.interpolate(t_s, series, q, np.array(at_s))
    expected = exact_variance(model, t_s.tolist(), at_s)
    assert np.all(variance > 0.0)
    np.testing.assert_allclose(variance, expected, rtol=2e-3, atol=1e-3)


def test_no_variance_is_negative_on_any_track():
    rng = np.random.default_rng(1)
    for _ in range(40):
        n = int(rng.integers(2, 40))
        gap_s = 10.0 ** rng.uniform(1.0, 5.0, n)
        step_s = np.where(rng.random(n) < 0.15, gap_s, rng.choice([0.0, 0.1, 1.0, 8.0], n))
        claimed_m = rng.choice([0.01, 0.5, 7.0, 50.0], n)
        xy_m = np.cumsum(rng.normal(size=(n, 2)) * np.minimum(step_s, 100.0)[:, None], axis=0)
        xy_m[rng.integers(n)] += rng.choice([0.0, 1e3, 1e6])
        fixes = track(np.cumsum(step_s), xy_m, claimed_m)
        sigma = np.where(rng.random(n) < 0.3, 0.3, np.inf)
        speed = walker.Velocities(rng.normal(size=n), rng.normal(size=n), sigma)
        smooth_fixes = walker.smooth_track(fixes, speed)
        around_ns = np.concatenate([fixes.t_ns + shift for shift in (-500_000_000, 0, 10_000_000)])
        times_s = walker._clock_s(fixes, fixes.t_ns)
        at_s = walker._clock_s(fixes, around_ns)
        q = smooth_fixes.accel_m2s3
        _, variance = walker.interpolate(times_s, smooth_fixes.series, q, at_s)
        assert np.all(variance >= 0.0)
        assert np.all(smooth_fixes.at(around_ns).sigma_m > 0.1)
