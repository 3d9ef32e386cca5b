import numpy as np
import pytest

from logger.core.guidance.advice import AGAIN_M, LEAST_NATS_PER_KM, Guide
from logger.core.locator.online import OnlineLocator
from logger.core.model.prior import Prior
from logger.core.places import Places
from tests.kit.guided_walks import line
from tests.kit.walks import single_reading

EMITTER_M = (150.0, 200.0)


def _locator(points_m, emitter_m=EMITTER_M, seed=0):
    rng = np.random.default_rng(seed)
    locator = OnlineLocator(Prior())
    for point_m in points_m:
        _hear(locator, point_m, emitter_m, rng)
    return locator


def _hear(locator, point_m, emitter_m, rng, noise_db=2.0):
    away_m = np.hypot(np.hypot(*np.subtract(point_m, emitter_m)), 5.0)
    level_dbm = round(-25.0 - 28.0 * np.log10(away_m) + rng.normal(0.0, noise_db))
    locator.take(single_reading(*point_m, float(level_dbm), sigma_m=4.0))
    if locator.stale > 1.0:
        locator.search()


def _advice_for(points_m, emitter_m=EMITTER_M):
    guide, locator = Guide(), _locator(points_m, emitter_m)
    for x_m, y_m in points_m:
        guide.walk(Places.of(float(x_m), float(y_m)))
    guide.decide(*locator.last_search())
    return guide


def test_a_plan_is_due_every_25_m():
    guide = Guide()
    assert not guide.is_due
    searched = _locator(line((0.0, 0.0), (60.0, 0.0))).last_search()
    plans = 0
    for x_m in np.arange(0.0, 200.0, 3.0):
        guide.walk(Places.of(float(x_m), 0.0))
        if guide.is_due:
            guide.decide(*searched)
            plans += 1
    assert plans == pytest.approx(200.0 / AGAIN_M, abs=1)


def test_a_straight_walk_is_led_off_its_line():
    """Its mirror image is as probable; only a turn decides between both."""
    advice = _advice_for(line((0.0, 0.0), (300.0, 0.0)), (150.0, 70.0)).advice
    (x_m, y_m), (to_x_m, to_y_m) = advice.start.xy_m[:, 0], advice.end.xy_m[:, 0]
    azimuth_deg = np.degrees(np.arctan2(to_x_m - x_m, to_y_m - y_m)) % 180.0
    assert min(azimuth_deg, 180.0 - azimuth_deg) <= 67.5
    assert "places fit" in advice.text
    assert "dBm if it is the" in advice.text


def test_the_same_walk_has_the_same_advice():
    walk = line((0.0, 0.0), (200.0, 40.0), (150.0, 90.0))
    assert _advice_for(walk).advice == _advice_for(walk).advice


def test_a_walk_all_around_ends():
    around = [
        point
        for radius_m in (30.0, 45.0, 60.0, 15.0)
        for point in np.array(EMITTER_M)
        + radius_m * np.array([[np.sin(a), np.cos(a)] for a in np.linspace(0.0, 6.28, 60)])
    ]
    before = _advice_for(np.array(around[:30])).advice
    after = _advice_for(np.array(around)).advice
    assert before is not None
    assert after is None or after.nats_per_km < 0.3 * before.nats_per_km


@pytest.mark.parametrize("seed", range(1, 4))
def test_the_search_goes_on_where_no_place_is_likely(seed):
    """Shadowing of 8 dB over 50 m hides the path loss, so no way near here says much."""
    rng = np.random.default_rng(seed)
    guide, locator, shadow_db = Guide(), OnlineLocator(Prior()), 0.0
    for x_m, y_m in line((0.0, 0.0), (1500.0, 0.0)):
        kept = np.exp(-4.0 / 50.0)
        shadow_db = kept * shadow_db + 8.0 * np.sqrt(1.0 - kept**2) * rng.standard_normal()
        level_dbm = float(round(-85.0 + shadow_db + rng.normal(0.0, 2.0)))
        locator.take(single_reading(x_m, y_m, level_dbm, sigma_m=4.0))
        if locator.stale > 1.0:
            locator.search()
        guide.walk(Places.of(float(x_m), float(y_m)))
    guide.decide(*locator.last_search())
    assert guide.advice is not None
    assert guide.advice.nats_per_km < LEAST_NATS_PER_KM
    assert guide.advice.text.endswith("; no way near here says much")


def test_the_turn_is_from_the_course_of_the_walker():
    east = _advice_for(line((0.0, 0.0), (300.0, 0.0))).advice
    west = _advice_for(line((0.0, 0.0), (300.0, 0.0))[::-1]).advice
    for advice in (east, west):
        assert advice.text.split(",")[0] in {
            "turn right", "turn left", "half right", "half left", "sharp right", "sharp left",
        }  # fmt: skip


def test_there_is_no_plan_without_a_position():
    guide = Guide()
    guide.decide(*_locator(line((0.0, 0.0), (60.0, 0.0))).last_search())
    assert guide.advice is None


@pytest.mark.parametrize("emitter_m", [(300.0, 250.0), (500.0, 150.0), (200.0, 400.0)])
def test_a_street_without_side_streets_is_not_walked_again_and_again(emitter_m):
    """No street leads to where the arrow points; the walker goes on unless it points behind him."""
    rng = np.random.default_rng(0)
    guide, locator = Guide(), OnlineLocator(Prior())
    x_m, heading, turns = 0.0, 1.0, 0
    for _ in range(18):  # crossings 80 m apart
        for _ in range(20):
            x_m += heading * 4.0
            guide.walk(Places.of(x_m, 0.0))
            _hear(locator, (x_m, 0.0), emitter_m, rng, noise_db=3.0)
            searched = locator.last_search()
            if guide.is_due and searched is not None:
                guide.decide(*searched)
        if guide.advice is not None:
            east_m, north_m = (guide.advice.end.xy_m - guide.advice.start.xy_m)[:, 0]
            points_behind = abs(np.degrees(np.arctan2(north_m, heading * east_m))) > 100.0
            heading, turns = (-heading, turns + 1) if points_behind else (heading, turns)
    assert turns <= 3
