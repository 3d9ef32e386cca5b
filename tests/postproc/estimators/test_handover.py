import numpy as np
import pytest

from logger.core.geo import Utm
from logger.core.observations import CellObservations
from postproc.estimators import handover, metrics
from postproc.estimators.evidence import Prior
from postproc.estimators.posterior import locate


def square_walk(rng, *, noise_db=2.0, laps=2, step=2.8, source=(60.0, 95.0)):
    """Laps round a square of 200 m past a source inside it."""
    s = np.arange(0.0, 800.0 * laps, step)
    corner = [0, 200, 400, 600, 800]
    x = np.interp(s % 800.0, corner, [0, 200, 200, 0, 0])
    y = np.interp(s % 800.0, corner, [0, 0, 200, 200, 0])
    level = -30.0 - 30.0 * np.log10(np.hypot(x - source[0], y - source[1])) + noise_db * rng.normal(size=len(s))
    at = np.arange(len(s))
    return CellObservations("c", None, Utm(32), at * 10**9, x, y, np.zeros(len(s)), level, at), np.array(source)


def handed_over(obs, prior=Prior()):  # noqa: B008 (frozen)
    return handover.run(obs, locate(obs, prior))


def test_hands_over_and_stays_consistent():
    obs, source = square_walk(np.random.default_rng(1))
    run = handed_over(obs, Prior(height_m=0.0))
    assert isinstance(run, handover.EkfRun)
    error = run.filtered.x[-1, :2] - source
    assert (
        metrics.nees(error[None], run.filtered.p[-1:, :2, :2])[0] < 13.8
    )  # 0.999 of chi-square with 2 degrees of freedom
    assert np.hypot(*error) < 15.0


def test_no_reading_is_used_twice():
    obs, _ = square_walk(np.random.default_rng(2))
    run = handed_over(obs)
    assert isinstance(run, handover.EkfRun)
    first = run.first
    before = locate(handover.part(obs, slice(first)))
    np.testing.assert_array_equal(run.filtered.t_ns, obs.t_ns[first:])
    np.testing.assert_allclose(run.posterior.modes[0].state, before.modes[0].state)
    assert len(run.filtered) == len(run.smoothed) == len(run.filtered.nis) == len(obs) - first


def test_innovations_are_as_large_as_said():
    obs, _ = square_walk(np.random.default_rng(3), laps=4)
    run = handed_over(obs, Prior(height_m=0.0))
    assert isinstance(run, handover.EkfRun)
    np.testing.assert_allclose(run.filtered.nis, run.filtered.innovation_db**2 / run.filtered.innovation_var_db2)
    assert 0.5 < np.mean(run.filtered.nis) < 1.5
    assert abs(metrics.lag1(run.filtered.innovation_db)) < 0.2


def test_without_motion_smoothing_gives_the_last_state():
    obs, _ = square_walk(np.random.default_rng(4))
    run = handed_over(obs)
    assert isinstance(run, handover.EkfRun)
    np.testing.assert_allclose(
        run.smoothed.x, np.broadcast_to(run.filtered.x[-1], run.filtered.x.shape), rtol=1e-6, atol=1e-6
    )


def test_correlated_readings_count_less():
    rng = np.random.default_rng(5)
    obs, _ = square_walk(rng, noise_db=0.0)
    noise = rng.normal(size=len(obs))
    for k in range(1, len(noise)):
        noise[k] = 0.7 * noise[k - 1] + np.sqrt(1 - 0.49) * noise[k]
    obs.level_dbm[:] += 3.0 * noise
    found = locate(obs)
    assert handover.effective_variance_db2(obs, found) > 3.0 * found.sigma_db**2


def test_straight_walk_gives_a_reason():
    obs, _ = square_walk(np.random.default_rng(6))
    straight = handover.part(obs, slice(70))
    run = handed_over(straight)
    assert isinstance(run, handover.NoRun)
    assert "one place" in run.reason


@pytest.mark.parametrize("count", [1, 5])
def test_few_readings_give_a_reason(count):
    obs, _ = square_walk(np.random.default_rng(7))
    run = handed_over(handover.part(obs, slice(count)))
    assert isinstance(run, handover.NoRun)
    assert run.reason
