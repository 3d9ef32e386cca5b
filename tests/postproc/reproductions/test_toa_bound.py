import numpy as np
import pytest
from scipy.optimize import least_squares

from postproc.reproductions import toa
from postproc.reproductions.toa import README_ANCHORS_M, Anchors

README = Anchors(np.array(README_ANCHORS_M))
PATH = np.array([[2.0, 3.0], [3.0, 3.5], [4.0, 4.0], [5.0, 4.5]])


def test_least_squares_on_ranges_reaches_the_bounds():
    rng, sigma2, runs = np.random.default_rng(0), 1e-4, 400
    epoch, motion = (
        toa.epoch_bound_m2(README, PATH, sigma2)[3],
        toa.motion_bound_m2(README, PATH, sigma2)[3],
    )
    age = np.arange(3, -1, -1)[:, None]
    single, together = [], []
    for _ in range(runs):
        z = README.ranges_m(PATH) + 0.01 * rng.normal(size=(4, 4))
        single.append(least_squares(lambda p, z=z: README.ranges_m(p) - z[3], [5.0, 5.0]).x)
        fitted = least_squares(
            lambda s, z=z: (README.ranges_m(s[:2] - age * s[2:]) - z).ravel(),
            [5.0, 4.0, 0.5, 0.5],
            method="lm",
        )
        together.append(fitted.x[:2])
    # the sd of a variance over 400 runs is 7 %
    for fits, least in ((single, epoch), (together, motion)):
        assert np.trace(np.cov(np.array(fits).T)) == pytest.approx(np.trace(least), rel=0.2)
    assert np.all(np.linalg.eigvalsh(epoch - motion) > 0.0)


def test_the_information_is_the_derivative_of_the_ranges():
    step, at = 1e-6, PATH[1]
    g = np.column_stack(
        [
            (README.ranges_m(at + step * e) - README.ranges_m(at - step * e)) / (2.0 * step)
            for e in np.eye(2)
        ]
    )
    assert toa.epoch_bound_m2(README, PATH, 0.25)[1] == pytest.approx(
        0.25 * np.linalg.inv(g.T @ g), rel=1e-6
    )


def test_at_an_anchor_the_limit_along_the_path_holds():
    path = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])
    near = path + 1e-4 * np.array([1.0, 1.0])
    at = toa.epoch_bound_m2(README, path, 1.0)
    assert at[0] == pytest.approx(toa.epoch_bound_m2(README, near, 1.0)[0], rel=1e-3)


@pytest.mark.parametrize("variances", [(1.0, 1.0), (4.0, 0.25), (9.0, 0.0)])
def test_the_mean_error_is_that_of_a_sample(variances):
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    covariance = turn @ np.diag(variances) @ turn.T
    sample = np.random.default_rng(0).normal(size=(400_000, 2)) * np.sqrt(variances)
    assert toa.mean_bound_m(covariance) == pytest.approx(np.mean(np.hypot(*sample.T)), rel=0.005)
