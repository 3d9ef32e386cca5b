import numpy as np
import pytest

from logger.core.live import live_prior
from logger.core.live_cell import EKF, LOCATOR, Heard, LiveCell
from logger.core.live_settings import LiveSettings
from tests.kit.walks import simulate

PRIOR = live_prior(LiveSettings(height_m=0.0))


def heard(obs):
    columns = (obs.x_m, obs.y_m, obs.position_sigma_m, obs.level_dbm, obs.limit)
    return [Heard(*row) for row in zip(*(c.tolist() for c in columns), strict=True)]


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
    found, news = estimates(heard(obs))
    assert found[0] is None
    last = found[-1]
    assert last.stage in {LOCATOR, EKF}
    p = np.array([[last.p[0], last.p[1]], [last.p[1], last.p[4]]])
    off = np.array(last.state[:2]) - source
    assert off @ np.linalg.solve(p, off) < 13.8  # 99.9 %
    assert (EKF in {e.stage for e in found if e}) == any(code == "ekf-started" for code, _ in news)


def test_an_ekf_whose_transmitter_has_moved_is_taken_back():
    seeds = (obs for obs in (simulate(np.random.default_rng(s), "square") for s in range(20)))
    for obs, _ in seeds:
        cell = LiveCell(PRIOR)
        found, _ = estimates(heard(obs), cell)
        if found[-1].stage == EKF:
            break
    readings = [r._replace(level_dbm=-60.0 - 20.0 * (k % 2)) for k, r in enumerate(heard(obs))]
    after, news = estimates(readings, cell)
    assert "ekf-taken-back" in {code for code, _ in news}
    assert LOCATOR in {e.stage for e in after if e}


def test_the_same_readings_give_the_same_bits():
    obs, _ = simulate(np.random.default_rng(5), "L", count=200, step=4.2, shadow_db=4.0)
    assert repr(estimates(heard(obs))) == repr(estimates(heard(obs)))


def test_readings_at_the_floor_alone_say_nothing():
    found, _ = estimates([Heard(10.0 * k, 0.0, 3.0, -110.0, -1) for k in range(50)])
    assert found == [None] * 50
