import math

import numpy as np
import pytest
from scipy.stats import chi2, norm

from logger.core import shadow_ekf
from logger.core.ekf import EkfStep
from logger.core.places import Places
from logger.core.shadow_ekf import FilterMonitor, ShadowNoise

NOISE = ShadowNoise(0.0, 0.0, 3.0, 0.0)


def state_at(distance_m, sigma_m=5.0):
    held = shadow_ekf.hold([distance_m, 0.0, -30.0, 3.0], NOISE, Places.of(0.0, 0.0))
    return shadow_ekf.release(held, np.diag([sigma_m**2, 4.0, 1.0, 0.01]))


def counts_of(innovations, distance_m=200.0, monitor=FilterMonitor()):  # noqa: B008 (immutable)
    """The monitor after innovations of stated variance 1, the walker far from the position."""
    state = state_at(distance_m)
    for innovation in innovations:
        monitor = monitor.after_step(EkfStep(state, float(innovation), 1.0), NOISE)
    return monitor


def first_alarm(innovations):
    monitor, state = FilterMonitor(), state_at(200.0)
    for i, innovation in enumerate(innovations):
        monitor = monitor.after_step(EkfStep(state, float(innovation), 1.0), NOISE)
        if monitor.disagrees:
            return i
    return None


@pytest.mark.parametrize("dof", [3.0, 10.0, 59.0, 400.0])
def test_bound_is_the_chi_square_quantile(dof):
    assert shadow_ekf.mean_bound(dof, 4.0) == pytest.approx(
        chi2.isf(norm.sf(4.0), dof) / dof, rel=0.05 if dof < 20.0 else 0.01
    )


def test_consistent_innovations_raise_no_alarm():
    rng = np.random.default_rng(1)
    alarms = [first_alarm(rng.normal(size=1000)) for _ in range(100)]
    assert sum(alarm is not None for alarm in alarms) <= 2


@pytest.mark.parametrize(("factor", "within"), [(1.7, 100), (2.5, 40)])
def test_innovations_larger_than_stated_raise_the_alarm(factor, within):
    rng = np.random.default_rng(2)
    alarms = [first_alarm(factor * rng.normal(size=400)) for _ in range(50)]
    assert all(alarm is not None for alarm in alarms)
    assert np.median(alarms) < within


def test_one_outlier_discards_nothing():
    rng = np.random.default_rng(3)
    monitor = counts_of([1e3], monitor=counts_of(rng.normal(size=100)))
    assert monitor.disagrees is None
    assert counts_of([1e3]).disagrees is None


def test_the_alarm_goes_on_until_it_has_been_denied_as_often():
    monitor = counts_of(np.full(60, 2.0))
    assert "NIS 4.0" in monitor.disagrees
    quiet = 0
    while monitor.disagrees:
        monitor = counts_of([0.0], monitor=monitor)
        quiet += 1
    assert monitor.mean_nis < monitor.nis_bound
    assert (
        quiet > math.log(4.0 / monitor.nis_bound) * 30.0
    )  # falling below the bound alone is not enough


def test_a_censored_reading_leaves_the_nis_unchanged():
    monitor = counts_of([1.5, 2.0])
    after = monitor.after_step(EkfStep(state_at(200.0), math.nan, math.nan), NOISE)
    assert (after.mean_nis, after.weight) == (monitor.mean_nis, monitor.weight)


def compare(times, apart_m):
    monitor = FilterMonitor()
    for _ in range(times):
        monitor = monitor.after_search(
            state_at(200.0, sigma_m=3.0),
            np.array([200.0 + apart_m, 0.0, 0.0, 0.0]),
            np.diag([16.0, 9.0, 1.0, 1.0]),
        )
    return monitor


def test_a_position_far_from_the_locators_raises_the_alarm_after_three():
    assert compare(1, 10.0).apart2 == pytest.approx(100.0 / 25.0)
    assert compare(9, 10.0).disagrees is None
    assert compare(2, 20.0).disagrees is None
    assert "4.0 standard deviations apart" in compare(3, 20.0).disagrees


def test_distance_is_by_both_covariances():
    rng = np.random.default_rng(4)
    root = rng.normal(size=(4, 4))
    p = root @ root.T + np.eye(4)
    state = shadow_ekf.release(shadow_ekf.hold([3.0, 4.0, 0.0, 0.0], NOISE, Places.of(0.0, 0.0)), p)
    other = np.array([[5.0, -1.0], [-1.0, 2.0]])
    expected = np.array([2.0, -1.0]) @ np.linalg.solve(p[:2, :2] + other, [2.0, -1.0])
    covariance = np.eye(4)
    covariance[:2, :2] = other
    compared = FilterMonitor().after_search(state, np.array([1.0, 5.0, 0.0, 0.0]), covariance)
    assert compared.apart2 == pytest.approx(expected)


def test_a_walker_too_near_for_the_uncertainty_raises_the_alarm():
    assert counts_of(np.zeros(9), distance_m=25.0).disagrees is None
    assert counts_of(np.zeros(2), distance_m=15.0).disagrees is None
    near = counts_of(np.zeros(3), distance_m=15.0)
    assert "33 % of the distance" in near.disagrees
    assert counts_of(np.zeros(3), distance_m=200.0, monitor=near).disagrees is None


def test_widest_axis_is_the_largest_eigenvalue():
    assert shadow_ekf.widest(5.0, -1.0, 2.0) ** 2 == pytest.approx(
        np.linalg.eigvalsh([[5.0, -1.0], [-1.0, 2.0]])[1]
    )
