import numpy as np
import pytest

from benchmarks.scoreboard import bound
from benchmarks.scoreboard.walks import SHAPES
from benchmarks.scoreboard.world import Noise, Walk
from postproc.reproductions.specification_walks import median_error_m

STATE = np.array([140.0, 80.0, -30.0, 3.0])
PRECISION = np.array([30.0**-2, 0.9**-2])


def walk_on_a_circle():
    return SHAPES["L"](np.random.default_rng(1), 60, 7.0)


def mean_level_dbm(state):
    x_m, y_m = walk_on_a_circle()
    return state[2] - 10.0 * state[3] * np.log10(np.hypot(x_m - state[0], y_m - state[1]))


@pytest.mark.parametrize(
    "noise", [Noise(3.0), Noise(1.0, 6.0, 15.0), Noise(0.5, 6.0, 40.0, in_plane=True)]
)
def test_information_agrees_with_finite_differences(noise):
    x_m, y_m = walk_on_a_circle()
    covariance_db2 = noise.covariance_db2(x_m, y_m)
    step = np.diag([1e-3, 1e-3, 1e-4, 1e-5])
    slope = np.column_stack(
        [(mean_level_dbm(STATE + d) - mean_level_dbm(STATE - d)) / (2.0 * np.sum(d)) for d in step]
    )
    information = slope.T @ np.linalg.inv(covariance_db2) @ slope + np.diag([0.0, 0.0, *PRECISION])
    walk = Walk(x_m, y_m, mean_level_dbm(STATE))
    found = bound.covariance_bound(walk, (STATE[0], STATE[1]), STATE[3], covariance_db2, PRECISION)
    np.testing.assert_allclose(found @ information, np.eye(4), atol=1e-5)


@pytest.mark.parametrize("axes_m", [(1.0, 1.0), (10.0, 2.0), (50.0, 1.0)])
def test_median_error_of_a_gaussian(axes_m):
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    covariance = turn @ np.diag(np.square(axes_m)) @ turn.T
    drawn = np.random.default_rng(2).multivariate_normal([0, 0], covariance, 200_000)
    assert median_error_m(covariance) == pytest.approx(np.median(np.hypot(*drawn.T)), rel=0.01)
