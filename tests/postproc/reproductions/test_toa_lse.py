import numpy as np
import pytest

from postproc.reproductions.toa import README_ANCHORS_M, Anchors, all_pairs, covariance_m2, fix_m

README = Anchors(np.array(README_ANCHORS_M))


def test_the_fix_is_least_squares_over_all_pairs():
    ranges = np.random.default_rng(0).uniform(2.0, 12.0, (5, 4))
    pairs = all_pairs(README)
    expected = [np.linalg.lstsq(pairs.h, pairs.z_m2(z), rcond=None)[0] for z in ranges]
    assert fix_m(README, ranges) == pytest.approx(np.array(expected))


@pytest.mark.parametrize(("k", "factor"), [(0, 1.00), (1, 0.82), (2, 0.68)])
def test_the_covariance_in_closed_form(k, factor):
    for sigma2 in (0.01, 100.0):
        expected = (factor * sigma2 + 0.005 * sigma2**2) * np.eye(2)
        assert covariance_m2(README, np.array([k, k], float), sigma2) == pytest.approx(expected)


def test_the_covariance_is_that_of_simulated_fixes():
    anchors = Anchors(np.array([[0.0, 0.0], [30.0, 5.0], [10.0, 40.0]]))
    at, sigma2 = np.array([12.0, 3.0]), 9.0
    ranges = anchors.ranges_m(at) + 3.0 * np.random.default_rng(1).normal(size=(100_000, 3))
    fixes, expected = fix_m(anchors, ranges), covariance_m2(anchors, at, sigma2)
    assert np.mean(fixes, axis=0) == pytest.approx(at, abs=4.0 * np.sqrt(np.max(expected) / 1e5))
    assert np.cov(fixes.T) == pytest.approx(expected, abs=0.03 * np.max(expected))
