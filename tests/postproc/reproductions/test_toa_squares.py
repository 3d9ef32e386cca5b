import numpy as np
import pytest

from postproc.estimators.metrics import mean_bounds, nees
from postproc.reproductions import toa
from postproc.reproductions.toa import (
    README_ANCHORS_M,
    README_PATH_M,
    Anchors,
    mean_bound_m,
    motion_bound_m2,
)

README, PATH = Anchors(np.array(README_ANCHORS_M)), np.array(README_PATH_M)


def simulate_runs(path, sigma2, runs):
    rng = np.random.default_rng(0)
    return README.ranges_m(path) + np.sqrt(sigma2) * rng.normal(size=(runs, len(path), 4))


def test_the_covariance_is_true_and_the_bound_is_nearly_reached():
    runs, sigma2 = 2000, 0.01
    track = toa.on_squares(README, simulate_runs(PATH, sigma2, runs), sigma2, np.zeros((2, 2)))
    least_m = mean_bound_m(motion_bound_m2(README, PATH, sigma2))
    for k in (2, 5, 10):
        off = track.position_m[:, k] - PATH[k]
        low, high = mean_bounds(runs, 2, level=0.999)
        assert low <= np.mean(nees(off, track.p_m2[:, k])) <= high
        assert 0.97 * least_m[k] <= np.mean(np.hypot(*off.T)) <= 1.12 * least_m[k]


def test_one_step_is_the_dense_formula_with_simulated_moments():
    """The gain from the sample moments of place and squared ranges, which the closed form claims to
    be exact for.
    """
    rng = np.random.default_rng(3)
    path, sigma2 = PATH[:3], 4.0
    ranges = README.ranges_m(path) + 2.0 * rng.normal(size=(1, 3, 4))
    before = toa.on_squares(README, ranges[:, :2], sigma2, np.zeros((2, 2)))
    after = toa.on_squares(README, ranges, sigma2, np.zeros((2, 2)))
    (first, second), (c0, c1) = before.position_m[0], before.p_m2[0]
    count = 400_000
    sample = (2.0 * second - first) + rng.multivariate_normal(np.zeros(2), 4.0 * c1 + c0, count)
    squared = (README.ranges_m(sample) + 2.0 * rng.normal(size=(count, 4))) ** 2
    joint = np.cov(np.hstack([sample, squared]).T)
    gain = joint[:2, 2:] @ np.linalg.inv(joint[2:, 2:])
    expected = 2.0 * second - first + gain @ (ranges[0, 2] ** 2 - np.mean(squared, axis=0))
    assert after.position_m[0, 2] == pytest.approx(expected, abs=0.05)
    assert after.p_m2[0, 2] == pytest.approx(
        joint[:2, :2] - gain @ joint[2:, :2], rel=0.02, abs=0.02
    )


def test_a_turn_is_followed_when_it_is_output():
    path = np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0], [4.0, 2.0], [4.0, 4.0], [4.0, 6.0]])
    ranges = simulate_runs(path, 1e-4, 50)
    blind = toa.on_squares(README, ranges, 1e-4, np.zeros((2, 2)))
    output = toa.on_squares(README, ranges, 1e-4, 2.0 * np.eye(2))
    assert np.mean(np.hypot(*(output.position_m[:, 3] - path[3]).T)) < 0.05
    assert np.mean(np.hypot(*(blind.position_m[:, 3] - path[3]).T)) > 0.2
