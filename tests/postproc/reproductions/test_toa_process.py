import numpy as np
import pytest

from postproc.reproductions.toa import (
    README_ANCHORS_M,
    README_PATH_M,
    README_SIGMA2_M2,
    Anchors,
    closed_form,
    fix_m,
    readme_values,
)

README, PATH = Anchors(np.array(README_ANCHORS_M)), np.array(README_PATH_M)


@pytest.mark.parametrize("sigma2", README_SIGMA2_M2)
def test_the_printed_q_and_mean_are_the_derived_ones_with_sampling_noise(sigma2):
    result, expected = readme_values(README, PATH, sigma2), closed_form(README, PATH, sigma2)
    variance = 4.28 * sigma2 + 0.025 * sigma2**2
    assert expected.q_m2 == pytest.approx(variance * np.eye(2))
    # of 10 000 runs: 1.4 % for a variance, 1 % of it for a covariance, 1 % of its root for a mean
    assert result.q_m2 == pytest.approx(expected.q_m2, abs=0.042 * variance)
    assert expected.mean_m == pytest.approx(np.zeros(2))
    assert result.mean_m == pytest.approx(np.zeros(2), abs=0.04 * np.sqrt(variance))


def test_the_derived_moments_are_those_of_simulated_fixes():
    path = np.array([[1.0, 2.0], [3.0, 3.0], [5.0, 4.0], [7.0, 5.0]])
    ranges = README.ranges_m(path[:2]) + 2.0 * np.random.default_rng(0).normal(size=(100_000, 2, 4))
    fixes = fix_m(README, ranges)
    w = path[2] - 2.0 * fixes[:, 1] + fixes[:, 0]
    expected = closed_form(README, path, 4.0)
    assert np.cov(w.T) == pytest.approx(expected.q_m2, abs=0.03 * np.max(expected.q_m2))
    assert np.mean(w, axis=0) == pytest.approx(expected.mean_m, abs=0.1)


def test_a_turn_of_the_path_is_process_noise():
    path = np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0], [4.0, 2.0], [4.0, 4.0]])
    turned = closed_form(README, path, 1e-9)
    assert turned.mean_m == pytest.approx([-2.0 / 3.0, 2.0 / 3.0])
    assert turned.q_m2[0, 0] == pytest.approx(8.0 / 9.0, rel=1e-6)


def test_the_table_is_for_its_own_geometry():
    assert readme_values(README, PATH, 0.5) is None
    assert readme_values(README, PATH[:5], 1.0) is None
    assert readme_values(Anchors(README.position_m + 1.0), PATH, 1.0) is None
