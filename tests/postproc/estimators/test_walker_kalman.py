"""The smoother against the dense solution: one joint Gaussian of all states and measurements."""

import numpy as np

from postproc.estimators import walker, walker_kalman
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
    series, apart2, expected = walker_kalman.smooth(model, excess)
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
    np.testing.assert_allclose(apart2[known], np.sum(residual**2, axis=1), rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(
        (expected - model.slack + excess)[known], residual_variance, rtol=1e-5, atol=1e-5
    )
