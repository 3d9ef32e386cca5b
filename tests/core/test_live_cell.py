from dataclasses import replace

import numpy as np
import pytest

from logger.core.live import live_prior
from logger.core.live_cell import EKF, LOCATOR, LiveCell
from logger.core.live_settings import LiveSettings
from logger.core.shadow_ekf import widest
from tests.kit.walks import simulate, single_reading, with_places

PRIOR = live_prior(LiveSettings(height_m=0.0))


def readings_of(obs):
    return [obs[k] for k in range(len(obs))]


def estimates(readings, cell=None):
    cell, found, news = cell or LiveCell(PRIOR), [], []
    for reading in readings:
        found.append(cell.take(reading))
        news += cell.news
        if cell.stale > 1.0:
            cell.search()
    return found, news


@pytest.mark.parametrize("seed", [3, 4])
def test_the_locator_begins_and_its_ellipse_holds_the_truth(seed):
    obs, source = simulate(np.random.default_rng(seed), "square", count=300, step=2.8)
    found, news = estimates(readings_of(obs))
    assert found[0] is None
    last = found[-1]
    assert last.stage in {LOCATOR, EKF}
    p = np.array([[last.p_xx, last.p_xy], [last.p_xy, last.p_yy]])
    off = np.array([last.x_m, last.y_m]) - source
    assert off @ np.linalg.solve(p, off) < 13.8  # 99.9 %
    assert (EKF in {e.stage for e in found if e}) == any(code == "ekf-started" for code, _ in news)


def test_an_ekf_whose_transmitter_has_moved_is_taken_back():
    seeds = (obs for obs in (simulate(np.random.default_rng(s), "square") for s in range(20)))
    for obs, _ in seeds:
        cell = LiveCell(PRIOR)
        found, _ = estimates(readings_of(obs), cell)
        if found[-1].stage == EKF:
            break
    readings = [
        replace(r, level_dbm=np.array([-60.0 - 20.0 * (k % 2)]))
        for k, r in enumerate(readings_of(obs))
    ]
    after, news = estimates(readings, cell)
    assert "ekf-taken-back" in {code for code, _ in news}
    assert LOCATOR in {e.stage for e in after if e}


def test_the_same_readings_give_the_same_bits():
    obs, _ = simulate(np.random.default_rng(5), "L", count=200, step=4.2, shadow_db=4.0)
    assert repr(estimates(readings_of(obs))) == repr(estimates(readings_of(obs)))


def test_readings_at_the_floor_alone_say_nothing():
    found, _ = estimates([single_reading(10.0 * k, 0.0, -110.0, -1) for k in range(50)])
    assert found == [None] * 50


def with_error(obs, source, error_db=30.0):
    """One level wrong, at the end of the walk that is farther from the source."""
    at = int(np.argmax(np.hypot(obs.x_m - source[0], obs.y_m - source[1])))
    level_dbm = obs.level_dbm.copy()
    level_dbm[at] += error_db
    return replace(obs, level_dbm=level_dbm)


@pytest.mark.parametrize("seed", [1, 3, 5, 6])
def test_one_gross_error_moves_nothing(seed):
    obs, source = simulate(np.random.default_rng(seed), "random", count=400)
    cell = LiveCell(PRIOR)
    plain, (found, news) = (
        estimates(readings_of(obs))[0],
        estimates(readings_of(with_error(obs, source)), cell),
    )
    before, after = ([e for e in each if e][-1] for each in (plain, found))
    assert np.hypot(after.x_m - before.x_m, after.y_m - before.y_m) < 8.0
    assert widest(after.p_xx, after.p_xy, after.p_yy) < 1.5 * widest(
        before.p_xx, before.p_xy, before.p_yy
    )
    assert (cell.n, cell.n_set_aside) == (399, 1)
    (text,) = [text for code, text in news if code == "level-set-aside"]
    assert "dB above the readings around it" in text


def test_a_gross_error_at_the_end_of_the_walk_is_never_taken():
    obs, _ = simulate(np.random.default_rng(3), "L", count=300)
    readings = readings_of(obs)
    cell = LiveCell(PRIOR)
    found, _ = estimates(
        [*readings[:-1], replace(readings[-1], level_dbm=readings[-1].level_dbm + 30.0)], cell
    )
    assert found[-1] is None
    assert cell.n == 299
    assert found[-2] == estimates(readings[:-1])[0][-1]


def test_a_level_that_lasts_is_taken_after_two_more():
    obs, _ = simulate(np.random.default_rng(3), "L", count=300)
    readings = [
        replace(r, level_dbm=r.level_dbm + 30.0 * (k >= 200))
        for k, r in enumerate(readings_of(obs))
    ]
    cell = LiveCell(PRIOR)
    found, _ = estimates(readings, cell)
    assert cell.n == 300
    assert cell.n_set_aside == 0
    assert [k for k in range(150, 300) if found[k] is None] == [200, 201]


def test_levels_that_the_modem_repeats_while_moving_count_once():
    """After an honest walk the last report for another 900 m: the estimate stays as it was."""
    obs, _ = simulate(np.random.default_rng(5), "square", count=200, step=4.2)
    obs = with_places(obs, sigma_m=np.full(len(obs), 4.0))
    walk = readings_of(replace(obs, level_dbm=np.round(obs.level_dbm)))
    last = walk[-1]
    repeated = [with_places(last, x_m=last.x_m + 11.0 * k) for k in range(1, 80)]
    cell = LiveCell(PRIOR)
    _, before = estimates(walk, cell)
    assert "level-repeated" not in {code for code, _ in before}
    n = cell.n
    found, news = estimates(repeated, cell)
    assert [code for code, _ in news].count("level-repeated") == 1
    assert cell.n_repeated >= 60
    assert cell.n == n + len(repeated) - cell.n_repeated
    assert found[-40:] == [None] * 40
