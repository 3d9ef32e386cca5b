from dataclasses import replace

import numpy as np
import pytest

from logger.core import ekf, shadow_ekf
from logger.core.places import Places
from logger.core.shadow_ekf import ShadowNoise
from postproc.estimators import filters
from tests.kit.walks import simulate, with_places

NOISE = ShadowNoise(4.0, 20.0, 2.0, 5.0)


def start(obs, source):
    held = shadow_ekf.hold(
        [*source, -30.0, 3.0], NOISE, Places.of(float(obs.x_m[0]), float(obs.y_m[0]))
    )
    return shadow_ekf.release(held, np.diag([200.0, 150.0, 30.0, 0.2]))


def step_by_step(obs, state):
    for x_m, y_m, sigma_m, level_dbm, limit in zip(
        obs.x_m.tolist(),
        obs.y_m.tolist(),
        obs.position_sigma_m.tolist(),
        obs.level_dbm.tolist(),
        obs.limit.tolist(),
        strict=True,
    ):
        yield (result := shadow_ekf.step(state, NOISE, x_m, y_m, sigma_m, level_dbm, limit))
        state = result.state


def uncertain(obs, sigma_m=3.0):
    return with_places(obs, sigma_m=np.full(len(obs), sigma_m))


def test_reference_is_the_live_filter_step_by_step():
    obs, _ = simulate(np.random.default_rng(1), "L", count=50)
    result = filters.reference_ekf(obs)
    state = ekf.start(Places.of(float(obs.x_m[0]), float(obs.y_m[0])))
    for i in range(50):
        step = ekf.step(state, float(obs.x_m[i]), float(obs.y_m[i]), float(obs.level_dbm[i]))
        state = step.state
        assert result.x[i].tolist() == list(state[:4])
        assert np.array_equal(result.p[i], ekf.covariance_matrix(state.p))
        assert (result.innovation_db[i], result.innovation_var_db2[i]) == step[1:]


@pytest.mark.parametrize("share_at_floor", [0.0, 0.3])
def test_compiled_shadow_filter_is_the_live_one(share_at_floor):
    obs, source = simulate(np.random.default_rng(2), "square", count=300, shadow_db=4.0)
    lower_db = np.round(np.quantile(obs.level_dbm, share_at_floor)) + 110.0
    obs = replace(
        uncertain(obs),
        level_dbm=np.maximum(obs.level_dbm - lower_db, -110.0 if share_at_floor else -np.inf),
    )
    result, end, log_likelihood = filters.shadow_pass(obs, start(obs, source), NOISE)
    steps = list(step_by_step(obs, start(obs, source)))
    at_limit = sum(np.isnan(step.innovation_db) for step in steps)
    assert at_limit == pytest.approx(300 * share_at_floor, abs=20)
    assert result.consistency.n_at_limit == at_limit
    states = np.array([step.state[:5] for step in steps])
    covariances = shadow_ekf.covariance_matrix([step.state.factors for step in steps])
    np.testing.assert_allclose(result.x, states, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(result.p, covariances, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(
        result.innovation_db, [step.innovation_db for step in steps], rtol=1e-11, atol=1e-11
    )
    np.testing.assert_allclose(
        result.innovation_var_db2, [s.innovation_var_db2 for s in steps], rtol=1e-12
    )
    assert end.factors == pytest.approx(steps[-1].state.factors, rel=1e-11)
    e, s = result.innovation_db, result.innovation_var_db2
    assert log_likelihood == pytest.approx(-0.5 * np.nansum(np.log(s) + e**2 / s))


def test_a_part_of_the_walk_from_where_the_one_before_ended():
    obs, source = simulate(np.random.default_rng(3), "L", count=120)
    whole = filters.shadow_pass(obs, start(obs, source), NOISE)
    first = filters.shadow_pass(obs, start(obs, source), NOISE, readings=slice(50))
    second = filters.shadow_pass(obs, first.end, NOISE, readings=slice(50, None))
    assert second.end == whole.end
    np.testing.assert_array_equal(np.concatenate([first.path.t_ns, second.path.t_ns]), obs.t_ns)


def test_levels_that_are_unknown_are_walked_past_and_not_counted():
    obs, source = simulate(np.random.default_rng(5), "L", count=120)
    gone = np.arange(120) % 3 == 1
    holed = replace(obs, level_dbm=np.where(gone, np.nan, obs.level_dbm), known_limit=obs.limit)
    result = filters.shadow_pass(holed, start(obs, source), NOISE)
    left = obs.part(~gone)
    straight = np.arange(120) < 60  # past the corner two short ways are longer than one
    expected = filters.shadow_pass(left, start(obs, source), NOISE)
    np.testing.assert_allclose(
        result.path.x[straight & ~gone], expected.path.x[straight[~gone]], rtol=1e-9
    )
    assert np.all(np.isnan(result.path.innovation_db[gone]))
    assert (result.path.consistency.n, result.path.consistency.n_at_limit) == (80, 0)


def test_nis_is_the_innovation_by_its_variance():
    obs, _ = simulate(np.random.default_rng(2), "square", count=30)
    result = filters.reference_ekf(obs)
    assert np.array_equal(result.nis, result.innovation_db**2 / result.innovation_var_db2)
    assert result.consistency.mean_nis == pytest.approx(np.mean(result.nis))
    assert len(result) == 30


def test_states_of_a_long_walk_are_thinned_evenly_up_to_the_last(monkeypatch):
    obs, source = simulate(np.random.default_rng(4), "square", count=301)
    passes = [
        lambda: filters.reference_ekf(obs),
        lambda: filters.shadow_pass(obs, start(obs, source), NOISE)[0],
    ]
    whole = [run() for run in passes]
    monkeypatch.setattr(filters, "MOST_ROWS", 100)
    for every, retained in zip(whole, [run() for run in passes], strict=True):
        assert len(retained) == 76
        for column in ("t_ns", "x", "p", "innovation_db", "innovation_var_db2"):
            np.testing.assert_array_equal(getattr(retained, column), getattr(every, column)[::4])
        assert retained.consistency == every.consistency
        assert retained.consistency.n == 301


@pytest.mark.parametrize("count", [0, 1, 2, 99, 10_000, 10_001, 1_000_000])
def test_retained_rows_are_even_and_end_at_the_last(count):
    rows = filters.retained_rows(count)
    assert len(rows) <= filters.MOST_ROWS
    assert len(rows) >= min(count, filters.MOST_ROWS // 2)
    assert count == 0 or rows[-1] == count - 1
    assert len(set(np.diff(rows))) <= 1
