import numpy as np
import pytest
from filterpy.kalman import rts_smoother

from postproc.estimators.rts import smooth


def random_problem(seed, steps=40, size=4):
    """A random linear system with measurements, and its Kalman-filtered series."""
    rng = np.random.default_rng(seed)
    f = np.eye(size) + 0.1 * rng.normal(size=(steps - 1, size, size))
    root = rng.normal(size=(steps - 1, size, size))
    q = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(size)
    h = rng.normal(size=(steps, size))
    z = rng.normal(size=steps)
    x0, p0, r = rng.normal(size=size), 3.0 * np.eye(size), 0.7
    x, p = x0, p0
    xs, ps = [], []
    for k in range(steps):
        if k:
            x, p = f[k - 1] @ x, f[k - 1] @ p @ f[k - 1].T + q[k - 1]
        gain = p @ h[k] / (h[k] @ p @ h[k] + r)
        x = x + gain * (z[k] - h[k] @ x)
        a = np.eye(size) - np.outer(gain, h[k])
        p = a @ p @ a.T + r * np.outer(gain, gain)
        xs.append(x)
        ps.append(p)
    return np.array(xs), np.array(ps), f, q, (h, z, x0, p0, r)


def dense_batch(f, q, h, z, x0, p0, r):
    """Mean and covariances of the whole trajectory from its information matrix."""
    steps, size = h.shape
    info = np.zeros((steps * size, steps * size))
    vector = np.zeros(steps * size)
    info[:size, :size] += np.linalg.inv(p0)
    vector[:size] += np.linalg.solve(p0, x0)
    for k in range(steps):
        own = slice(k * size, (k + 1) * size)
        info[own, own] += np.outer(h[k], h[k]) / r
        vector[own] += h[k] * z[k] / r
        if k:
            row = np.zeros((size, steps * size))
            row[:, own] = np.eye(size)
            row[:, (k - 1) * size : k * size] = -f[k - 1]
            info += row.T @ np.linalg.solve(q[k - 1], row)
    covariance = np.linalg.inv(info)
    blocks = [covariance[k * size : (k + 1) * size, k * size : (k + 1) * size] for k in range(steps)]
    return np.linalg.solve(info, vector).reshape(steps, size), np.array(blocks)


@pytest.mark.parametrize("seed", range(5))
def test_agrees_with_dense_batch_solution(seed):
    x, p, f, q, rest = random_problem(seed)
    expected_x, expected_p = dense_batch(f, q, *rest)
    x_smooth, p_smooth = smooth(x, p, f, q)
    np.testing.assert_allclose(x_smooth, expected_x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(p_smooth, expected_p, rtol=1e-9, atol=1e-9)


def test_agrees_with_filterpy():
    x, p, f, q, _ = random_problem(11)
    fs, qs = [*f, np.eye(4)], [*q, np.eye(4)]  # one more than it uses
    x_filterpy, p_filterpy, *_ = rts_smoother(x, p, fs, qs)
    x_smooth, p_smooth = smooth(x, p, f, q)
    np.testing.assert_allclose(x_smooth, x_filterpy, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(p_smooth, p_filterpy, rtol=1e-8, atol=1e-9)


def test_static_state_is_smoothed_to_the_last_filtered_one():
    x, p, _, _, _ = random_problem(2)
    x_smooth, p_smooth = smooth(x, p, np.eye(4), np.zeros((4, 4)))
    np.testing.assert_allclose(x_smooth, np.broadcast_to(x[-1], x.shape), atol=1e-9)
    np.testing.assert_allclose(p_smooth, np.broadcast_to(p[-1], p.shape), atol=1e-9)


def test_stays_symmetric_with_units_far_apart():
    x, p, _, _, _ = random_problem(6)
    units = np.diag([1e4, 1e4, 1.0, 1e-4])
    scaled_x, scaled_p = x @ units, units @ p @ units
    x_smooth, p_smooth = smooth(scaled_x, scaled_p, np.eye(4), 1e-6 * units**2)
    plain_x, _ = smooth(x, p, np.eye(4), 1e-6 * np.eye(4))
    np.testing.assert_allclose(x_smooth, plain_x @ units, rtol=1e-7, atol=1e-9)
    even = p_smooth / np.outer(np.diag(units), np.diag(units))
    np.testing.assert_allclose(even, np.swapaxes(even, 1, 2), rtol=1e-12, atol=1e-15)
    assert np.all(np.linalg.eigvalsh(even) > 0.0)


@pytest.mark.parametrize("steps", [0, 1])
def test_short_series_come_back(steps):
    x, p = np.ones((steps, 2)), np.broadcast_to(np.eye(2), (steps, 2, 2))
    x_smooth, p_smooth = smooth(x, p, np.eye(2), np.eye(2))
    np.testing.assert_array_equal(x_smooth, x)
    np.testing.assert_array_equal(p_smooth, p)
