"""The posterior where the transmitter is said to stand in an area."""

from dataclasses import replace

import numpy as np
import pytest

from logger.core.locator.online import OnlineLocator
from logger.core.locator.pipeline import decide, locate
from logger.core.locator.quadtree import Effort
from logger.core.locator.region import highest_density
from logger.core.locator.summary import summarise
from logger.core.model.area import Area, WalkArea
from logger.core.model.prior import Prior
from tests.kit.walks import observations

EFFORT = Effort(most_squares=1500, split_share=0.01, most_blocks=40)


def walk_past(source_m, noise_db=6.0):
    """A street of 800 m, and levels of a transmitter beside it."""
    x_m = np.linspace(-400.0, 400.0, 120)
    away_m = np.hypot(x_m - source_m[0], source_m[1])
    noise_db = np.random.default_rng(5).normal(0.0, noise_db, len(x_m))
    return observations(x_m, np.zeros(len(x_m)), -30.0 - 30.0 * np.log10(away_m) + noise_db)


@pytest.fixture(scope="module")
def obs():
    return walk_past((50.0, 80.0))


@pytest.fixture(scope="module")
def everywhere(obs):
    return locate(obs, Prior(), EFFORT)


@pytest.fixture(scope="module")
def within(obs):
    return locate(obs, replace(Prior(), area=Area.within_walk(150.0)), EFFORT)


def test_nothing_outside_is_possible_and_what_was_there_is_stated(everywhere, within):
    area = within.prior.area
    squares = within.squares
    share = area.share(np.stack([squares.x_m, squares.y_m, squares.size_m]))
    assert np.sum(squares.probability[share == 0.0]) < 1e-6
    squares = everywhere.squares
    share = area.share(np.stack([squares.x_m, squares.y_m, squares.size_m]))
    assert within.outside_share == pytest.approx(1.0 - share @ squares.probability, abs=0.02)
    assert 0.05 < within.outside_share < 0.9
    assert everywhere.outside_share is None
    assert within.r95_m < everywhere.r95_m


def test_inside_the_posterior_is_the_same_up_to_a_factor(everywhere, within):
    inside = [
        np.sum(one.squares.probability[(np.abs(one.squares.x_m) < 100.0)
               & (np.abs(one.squares.y_m) < 100.0)]) for one in (everywhere, within)
    ]  # fmt: skip
    assert inside[0] / (1.0 - within.outside_share) == pytest.approx(inside[1], rel=0.1)


def test_a_small_polygon_far_from_the_walk_is_found(obs):
    ring = ((5000.0, 9000.0), (5050.0, 9000.0), (5050.0, 9060.0), (5000.0, 9060.0))
    far = Area("there", polygons=((ring,),), utm=obs.utm)
    posterior = locate(obs, replace(Prior(), area=far), EFFORT)
    assert far.beyond_m(posterior.place) < 0.0
    region = highest_density(posterior.squares)
    assert np.sum(posterior.squares.size_m[region] ** 2) < 2.0 * 50.0 * 60.0
    verdict, (reason, *_), *_ = decide(posterior, obs)
    assert verdict == "cannot tell"
    assert reason.startswith("the readings contradict the area: without the area, > 99 % is not")


def test_the_device_says_what_the_desktop_says(obs):
    within = locate(obs, replace(Prior(), area=Area.within_walk(150.0)))
    where = WalkArea(150.0)
    online = OnlineLocator(Prior(), where=where)
    for one in obs:
        where.add(one.places)
        online.take(one)
        if online.stale > 1.0:
            online.search()
    posterior = summarise(*online.last_search())
    assert posterior.prior.area.text == "within 150 m of the walk"
    assert posterior.r95_m == pytest.approx(within.r95_m, rel=0.3)
    where.widen(None)
    assert online.stale > 1.0
    online.search()
    assert summarise(*online.last_search()).prior.area is None


@pytest.mark.parametrize(
    ("outside_share", "verdict", "reason"),
    [
        (0.1, "ambiguous", "without the area, 10 % is not within 150 m of the walk"),
        (0.3, "cannot tell", "the readings do not show that it is in the area"),
        (0.7, "cannot tell", "the readings contradict the area"),
    ],
)
def test_a_location_is_one_by_the_readings_too(obs, within, outside_share, verdict, reason):
    posterior = replace(within, outside_share=outside_share)
    decision = decide(posterior, obs, within_m=1000.0)
    assert decision.verdict == verdict
    assert any(one.startswith(reason) for one in decision.reasons)
    assert (decision.reasons[0].startswith(reason)) == (verdict == "cannot tell")


def test_the_position_shown_is_inside(obs):
    """Here the strongest reading lies 30 m outside of the area, and the region on its border."""
    x_m = float(obs.x_m[np.argmax(obs.level_dbm)]) + 30.0
    ring = ((x_m, -500.0), (x_m + 1000.0, -500.0), (x_m + 1000.0, 500.0), (x_m, 500.0))
    area = Area("there", polygons=((ring,),), utm=obs.utm)
    found = locate(obs, replace(Prior(), area=area), EFFORT)
    for mode in found.modes:
        assert area.beyond_m(mode.place)[0] <= 0.0
