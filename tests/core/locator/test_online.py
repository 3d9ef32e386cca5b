import numpy as np
import pytest

from logger.core.live import live_prior
from logger.core.live_settings import LiveSettings
from logger.core.locator.online import MOST_BLOCKS, OnlineLocator, ReadingsInOrder
from logger.core.locator.pipeline import locate
from logger.core.locator.summary import summarise
from tests.kit.walks import add_position_errors, censor_at_floor, simulate, single_reading

PRIOR = live_prior(LiveSettings(height_m=0.0))


def follow(obs):
    online = OnlineLocator(PRIOR)
    for reading in obs:
        online.take(reading)
        if online.stale > 1.0:
            online.search()
    return online


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_says_what_the_whole_walk_says(seed):
    """As long as no block was merged the model is the same; the cells are larger and sigma is
    approximated.
    """
    obs, _ = simulate(np.random.default_rng(seed), "square", count=MOST_BLOCKS - 5, step=8.4)
    locator, offline = follow(obs), locate(obs, PRIOR)
    online_mode, shown = locator.strongest_mode(), summarise(*locator.last_search())
    mode = min(
        offline.modes,
        key=lambda m: np.hypot(m.x_m - online_mode.state[0], m.y_m - online_mode.state[1]),
    )
    sigma_m = np.sqrt(np.trace(mode.covariance[:2, :2]))
    assert (
        np.hypot(mode.x_m - online_mode.state[0], mode.y_m - online_mode.state[1])
        < 0.5 * sigma_m + 2.0
    )
    shown_sigma_m = np.sqrt(np.trace(shown.modes[0].covariance[:2, :2]))
    assert shown_sigma_m == pytest.approx(sigma_m, rel=0.5)
    assert locator.level_sigma_db == pytest.approx(offline.sigma_db, rel=0.1)


def test_rows_added_one_by_one_are_those_of_a_new_search():
    obs, _ = simulate(np.random.default_rng(4), "L", count=60, step=14.0)
    online = follow(obs)
    before = online.strongest_mode()
    online.search()
    after = online.strongest_mode()
    assert (
        np.hypot(*(before.state - after.state)[:2])
        < 0.3 * np.sqrt(np.trace(after.covariance[:2, :2])) + 2.0
    )


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_errors_of_the_fixes_choose_no_side_of_a_straight_walk(seed):
    """With the track as told one side holds more than 90 % in a third of such walks."""
    rng = np.random.default_rng(seed)
    obs = add_position_errors(rng, 3.0, simulate(rng, "straight", count=400, step=2.1)[0])
    assert follow(obs).strongest_mode().probability < 0.7


def test_a_walk_that_turns_is_searched_anew():
    rng = np.random.default_rng(5)
    obs = add_position_errors(rng, 3.0, simulate(rng, "L", count=400, step=2.1)[0])
    ahead = obs.part(slice(200))
    online = follow(ahead)
    assert online._curve is not None
    assert online.stale <= 1.0
    for k in range(200, 230):
        online.take(single_reading(obs.x_m[k], obs.y_m[k], obs.level_dbm[k]))
    assert online.stale > 1.0
    online.search()
    assert online._curve is None


def test_nothing_is_said_of_a_few_readings():
    online = OnlineLocator(PRIOR)
    online.take(single_reading(0.0, 0.0, -80.0))
    assert online.strongest_mode() is None
    assert online.stale == 0.0


def test_a_long_walk_stays_bounded():
    obs, _ = simulate(np.random.default_rng(6), "square", count=1500, step=2.8)
    online = follow(obs)
    assert online._n <= MOST_BLOCKS
    assert online._block[4, : online._n].sum() == len(obs)


def test_readings_at_the_floor_are_kept_and_bounded():
    obs, source = simulate(np.random.default_rng(7), "square", count=900)
    low = censor_at_floor(obs, 0.45)
    online = follow(low)
    assert len(online._gone) <= 40
    assert sum(count for *_, count, _ in online._gone) == np.count_nonzero(low.limit)
    online_mode = online.strongest_mode()
    off = np.subtract(online_mode.state[:2], source)
    assert off @ np.linalg.solve(online_mode.covariance[:2, :2], off) < 9.0
    assert np.hypot(*off) < 60.0


def test_the_same_readings_at_the_floor_lead_to_the_same_bits():
    low = censor_at_floor(simulate(np.random.default_rng(8), "L", count=200, step=4.2)[0], 0.45)
    both = follow(low), follow(low)
    one, again = (online.strongest_mode() for online in both)
    assert np.array_equal(one.state, again.state)
    assert np.array_equal(one.covariance, again.covariance)
    assert one.probability == again.probability
    assert both[0].level_sigma_db == both[1].level_sigma_db


def test_levels_that_never_change_leave_no_number_undefined():
    online = OnlineLocator(live_prior(LiveSettings()))
    for k in range(200):
        online.take(single_reading(1.4 * k, 0.0, -85.0, sigma_m=7.0))
        online_mode = online.strongest_mode()
        assert online_mode is None or np.all(np.isfinite(online_mode.state))
        if online.stale > 1.0:
            online.search()
    assert online.strongest_mode() is not None


def test_readings_are_kept_in_order_and_bounded():
    readings = ReadingsInOrder()
    for k in range(5000):
        readings.add(single_reading(float(k), 0.0, -70.0))
        x_m = readings.readings().x_m
        apart_m = 2.0 ** (k >= 1023) * 2.0 ** (k >= 2047) * 2.0 ** (k >= 4095)
        assert np.array_equal(x_m, np.arange(0.0, k + 1.0, apart_m))


def test_without_readings_there_are_none():
    assert len(ReadingsInOrder().readings()) == 0
