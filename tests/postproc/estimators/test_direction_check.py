import numpy as np
import pytest

from postproc.estimators.filters import FilterPath, compare


def filter_path(last, sigmas):
    """A path whose last row alone counts."""
    x = np.array([np.zeros(5), last])
    p = np.array([np.eye(5), np.diag(np.square(sigmas))])
    return FilterPath(np.array([1, 2]), x, p, np.zeros(2), np.ones(2))


FORWARD = filter_path([10.0, 20.0, -30.0, 3.0, 4.0], [3.0, 3.0, 1.0, 0.3, 2.0])


def test_differences_are_in_combined_sigmas():
    result = compare(
        FORWARD, filter_path([20.0, 20.0, -33.0, 2.5, -40.0], [4.0, 4.0, 0.5, 0.4, 2.0])
    )
    assert result.difference == pytest.approx((10.0, 0.0, -3.0, -0.5))
    assert result.sigmas == pytest.approx((2.0, 0.0, -3.0 / 1.25**0.5, -1.0))
    assert result.largest == pytest.approx(3.0 / 1.25**0.5)
    assert result.agrees
    assert result.warning is None


def test_one_axis_beyond_four_sigma_is_a_contradiction():
    result = compare(FORWARD, filter_path([10.0, 41.0, -30.0, 3.0, 4.0], [4.0, 4.0, 1.0, 0.4, 2.0]))
    assert not result.agrees
    assert result.warning == (
        "the EKF forward and the EKF backward contradict each other, so trust neither: "
        "north by 21 m (4.2 sigma)"
    )


def test_the_shadowing_belongs_to_other_points_and_is_not_compared():
    other = filter_path([10.0, 20.0, -30.0, 3.0, -400.0], [3.0, 3.0, 1.0, 0.3, 0.1])
    assert compare(FORWARD, other).largest == 0.0
