from dataclasses import replace

import numpy as np
import pytest

from logger.core.locator.online import EFFORT
from logger.core.locator.pipeline import locate, search
from logger.core.locator.posterior import Mode
from logger.core.locator.preparation import prepare
from logger.core.locator.quadtree import Effort
from logger.core.model.prior import Hypothesis, Prior, Station
from logger.core.places import Places, Utm
from logger.core.readings import Readings
from logger.core.shadow_ekf import ShadowNoise
from postproc.estimators import ekf_initialisation, metrics
from postproc.estimators.filters import compare
from tests.kit.walks import simulate, with_places

FLAT = Prior(stations=(Station(1.0, 0.0),))


def square_walk(rng, *, noise_db=2.0, laps=2, step=2.8, source=(60.0, 95.0), shadow_db=0.0):
    """Laps round a square of 200 m past a source inside it; the shadowing decorrelates over 15 m of
    way.
    """
    s = np.arange(0.0, 800.0 * laps, step)
    corner = [0, 200, 400, 600, 800]
    x = np.interp(s % 800.0, corner, [0, 200, 200, 0, 0])
    y = np.interp(s % 800.0, corner, [0, 0, 200, 200, 0])
    shadow = rng.normal(size=len(s))
    rho = np.exp(-step / 15.0)
    for k in range(1, len(s)):
        shadow[k] = rho * shadow[k - 1] + np.sqrt(1.0 - rho**2) * shadow[k]
    level = -30.0 - 30.0 * np.log10(np.hypot(x - source[0], y - source[1])) + shadow_db * shadow
    level += noise_db * rng.normal(size=len(s))
    at = np.arange(len(s))
    obs = Readings(
        "c",
        None,
        Places.of(x, y, utm=Utm(32), sigma_m=np.zeros(len(s)), t_ns=at * 10**9),
        level,
        at,
    )
    return obs, np.array(source), shadow_db * shadow


def filter_run(obs, prior=FLAT, **options):
    run = ekf_initialisation.run(obs, locate(obs, prior, EFFORT), **options)
    assert isinstance(run, ekf_initialisation.EkfRun)
    return run


def reason(obs):
    run = ekf_initialisation.run(obs, locate(obs, FLAT, EFFORT))
    assert isinstance(run, str)
    return run


@pytest.fixture(scope="module")
def walk():
    return square_walk(np.random.default_rng(1))


@pytest.fixture(scope="module")
def forward(walk):
    return filter_run(walk[0])


@pytest.fixture(scope="module")
def backward(walk):
    return filter_run(walk[0], backward=True)


def nees(run, source):
    error = run.filtered.x[-1, :2] - source
    return metrics.nees(error[None], run.filtered.p[-1:, :2, :2])[0]


def test_both_passes_are_consistent_at_the_end(walk, forward, backward):
    for run in (forward, backward):
        assert nees(run, walk[1]) < 13.8  # 0.999 of chi-square with 2 degrees of freedom
        assert np.hypot(*(run.filtered.x[-1, :2] - walk[1])) < 15.0
    assert compare(forward.filtered, backward.filtered).agrees


def test_no_reading_is_used_twice_for_the_position(walk, forward):
    obs, first = walk[0], forward.first
    prior = ekf_initialisation._likely_noise(locate(obs, FLAT))
    before = locate(obs.part(slice(first)), prior)
    np.testing.assert_array_equal(forward.filtered.t_ns, obs.t_ns[first:])
    np.testing.assert_allclose(forward.posterior.modes[0].state, before.modes[0].state)
    assert len(forward.filtered) == len(forward.filtered.nis) == len(obs) - first


def test_the_start_is_close_for_the_rest_of_the_walk(walk, forward):
    obs, mode = walk[0], forward.posterior.modes[0]
    distance_m = np.hypot(obs.x_m - mode.x_m, obs.y_m - mode.y_m)[forward.first :]
    assert np.linalg.eigvalsh(mode.covariance[:2, :2])[1] <= (0.15 * distance_m.min()) ** 2
    assert 0.1 * len(obs) < forward.first < 0.9 * len(obs)


def test_innovations_are_as_large_as_claimed(forward):
    result = forward.filtered.consistency
    assert result.mean_nis == pytest.approx(np.mean(forward.filtered.nis))
    n_levels = np.count_nonzero(np.isfinite(forward.filtered.nis))
    assert abs(result.mean_nis - 1.0) < 3.0 * np.sqrt(2.0 / n_levels)  # chi-square with 1 each
    assert abs(result.autocorrelation[0]) < 0.2


def test_backward_is_forward_over_the_reversed_walk(walk, backward):
    obs = walk[0]
    again = filter_run(obs.part(slice(None, None, -1)))
    np.testing.assert_allclose(backward.filtered.x, again.filtered.x, rtol=1e-2)
    np.testing.assert_array_equal(backward.filtered.t_ns, obs.t_ns[::-1][backward.first :])
    np.testing.assert_array_equal(obs.t_ns[backward.rows], backward.smoothed.t_ns)


def test_smoothing_keeps_the_position_and_covers_the_complete_walk(walk, forward):
    last = forward.filtered.x[-1]
    np.testing.assert_array_equal(forward.rows, np.arange(len(walk[0])))
    np.testing.assert_array_equal(forward.smoothed.t_ns, walk[0].t_ns)
    np.testing.assert_array_equal(forward.smoothed.x[:, :4], np.tile(last[:4], (len(walk[0]), 1)))
    assert forward.smoothed.x[-1, 4] == pytest.approx(last[4], abs=1e-9)


def test_shadowing_is_estimated_also_before_the_start_of_the_filter():
    rng = np.random.default_rng(7)
    p = np.diag([36.0, 36.0, 4.0, 0.02])
    errors = []
    for _ in range(60):
        obs, source, true = square_walk(rng, noise_db=1.0, shadow_db=4.0)
        mean = rng.multivariate_normal([*source, -30.0, 3.0], p)
        mode = Mode(1.0, 1.0, mean, p, Places.of(*mean[:2]))
        _, result = ekf_initialisation._filter_and_smooth(
            obs, 200, mode, ShadowNoise(4.0, 15.0, 1.0, 0.0)
        )
        off = result.x[:, 4] - true
        assert np.std(off) < 0.5 * np.std(true)
        errors.append(off**2 / result.p[:, 4, 4])
    before, after = np.mean(errors, axis=0)[:200], np.mean(errors, axis=0)[200:]
    assert np.mean(before) == pytest.approx(1.0, abs=0.35)
    assert np.mean(after) == pytest.approx(1.0, abs=0.35)


def test_noise_is_split_as_the_levels_ask_for():
    obs, _, _ = square_walk(np.random.default_rng(8), noise_db=2.0, shadow_db=4.0)
    whole = locate(obs, FLAT, EFFORT)
    for of_noise in (Hypothesis(0.05, 30.0), Hypothesis(0.7, 30.0)):
        probability = np.array([one == of_noise for one in FLAT.hypotheses], float)
        noise = ekf_initialisation.noise_of(obs, replace(whole, noise_probability=probability))
        assert noise.white_db == pytest.approx(2.0, rel=0.35)
        assert noise.decorrelation_m == 30.0
        assert np.hypot(noise.white_db, noise.shadow_db) == pytest.approx(whole.sigma_db)


def test_a_try_of_a_prefix_is_a_fraction_of_a_search(walk):
    """Squares times hypotheses, and grids of blocks: a busy machine changes neither."""
    full = locate(walk[0])
    likely = ekf_initialisation._likely_noise(full)
    assert set(likely.hypotheses) < set(Prior().hypotheses)
    tried, whole = (
        prepare(walk[0], prior, effort)
        for prior, effort in ((likely, ekf_initialisation._ROUGH), (Prior(), Effort()))
    )
    work = [len(search(one).x_m) * len(one.prior.hypotheses) for one in (tried, whole)]
    assert work[0] < 0.3 * work[1]
    assert not tried.walk.shifted


def test_straight_walk_gives_a_reason(walk):
    assert "does not locate" in reason(walk[0].part(slice(70)))


@pytest.mark.parametrize("count", [1, 5])
def test_few_readings_give_a_reason(walk, count):
    assert reason(walk[0].part(slice(count)))


def test_a_walk_that_ends_too_near_for_its_knowledge_gives_a_reason(walk):
    """The last reading is taken at the transmitter: no prefix is close enough for that."""
    obs, source, _ = walk
    at_source = with_places(
        obs, x_m=np.append(obs.x_m[:-1], source[0]), y_m=np.append(obs.y_m[:-1], source[1])
    )
    whole = locate(obs, FLAT, EFFORT)
    run = ekf_initialisation.run(at_source, whole)
    assert isinstance(run, str)
    assert "15 % of its distance" in run


def test_a_point_counts_once_where_there_is_shadowing(walk):
    obs = walk[0]
    shadowed = ekf_initialisation._thin(obs, ShadowNoise(6.0, 15.0, 2.0, 0.0))
    lap = len(obs) // 2
    assert np.mean(np.isfinite(shadowed.level_dbm[:lap])) > 0.95
    assert np.mean(np.isfinite(shadowed.level_dbm[lap:])) < 0.05
    np.testing.assert_array_equal(shadowed.limit, obs.limit)
    np.testing.assert_array_equal(
        ekf_initialisation._thin(obs, ShadowNoise(0.0, 0.0, 2.0, 0.0)).level_dbm, obs.level_dbm
    )


def test_a_mirror_image_half_way_is_no_start():
    """Half of this L leaves the place and its mirror image, and a rough search may hold the wrong
    one for sure.
    """
    obs, source = simulate(np.random.default_rng(113), "L")
    run = ekf_initialisation.run(obs, locate(obs, FLAT, EFFORT))
    assert isinstance(run, str) or nees(run, source) < 13.8


@pytest.mark.slow
def test_consistent_in_many_worlds():
    rng = np.random.default_rng(9)
    result = []
    for k in range(40):
        source = tuple(rng.uniform(40.0, 160.0, 2))
        obs, place, _ = square_walk(
            rng, noise_db=2.0, shadow_db=(0.0, 3.0)[k % 2], laps=1, source=source
        )
        run = ekf_initialisation.run(obs, locate(obs, FLAT, EFFORT))
        if isinstance(run, ekf_initialisation.EkfRun):
            result.append(nees(run, place))
    assert len(result) >= 8
    assert np.mean(np.array(result) < 5.991) >= 0.85


@pytest.mark.parametrize("shortest", range(160, 420, 20))
def test_the_start_is_found_with_few_searches(shortest):
    """Each prefix that is tried costs a posterior."""
    tried = []

    def is_located(count):
        tried.append(count)
        return count >= shortest

    found = ekf_initialisation._bisect(100, 400, is_located)
    if shortest > 400 - (300 >> 4):
        assert found is None
        assert len(tried) == 2
    else:
        assert 0 <= found - shortest <= 300 >> 3
        assert len(tried) <= 5
