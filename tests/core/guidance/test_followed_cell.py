from dataclasses import replace

import numpy as np
import pytest
from pyproj import Geod

from logger.core.guidance.followed_cell import (
    CONFIRMED_AFTER,
    FollowedCell,
    LiveVerdict,
    squares_of_region,
    true_azimuth_deg,
)
from logger.core.locator.online import OnlineLocator
from logger.core.locator.pipeline import decide, locate
from logger.core.locator.quadtree import Effort
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR, LIVE, divide_in_time
from logger.core.locator.verdict import LIVE_M, assess
from logger.core.model.prior import Prior
from logger.core.places import Places, Utm
from tests.kit.guided_walks import line
from tests.kit.walks import observations

EFFORT = Effort(most_squares=400, split_share=0.02, nodes=1, most_blocks=80)
AROUND = line(
    (0.0, 0.0), (240.0, 0.0), (240.0, 200.0), (0.0, 200.0), (0.0, 0.0), (120.0, 60.0),
    (120.0, 220.0), (60.0, 60.0), (260.0, 120.0),
)  # fmt: skip
WGS84 = Geod(ellps="WGS84")


def _walk(points_m, emitter_m, seed=0, noise_db=2.0):
    """Readings past transmitters (n, 2), one position for each reading."""
    rng = np.random.default_rng(seed)
    x_m, y_m = points_m.T
    east_m, north_m = (points_m - emitter_m).T
    away_m = np.hypot(np.hypot(east_m, north_m), 5.0)
    level_dbm = -25.0 - 28.0 * np.log10(away_m) + rng.normal(0.0, noise_db, len(x_m))
    return observations(x_m, y_m, np.round(level_dbm), 4.0)


def test_a_location_is_believed_after_one_more_leg():
    obs = _walk(AROUND, np.array([120.0, 90.0]))
    posterior = locate(obs, Prior(), EFFORT)
    assert posterior.r95_m <= LIVE_M
    verdict = LiveVerdict()
    decisions = [verdict.update(posterior, obs) for _ in range(CONFIRMED_AFTER + 2)]
    words = [decision.verdict for decision in decisions]
    assert words == ["cannot tell"] * CONFIRMED_AFTER + ["located"] * 2
    assert "walk one leg away to confirm it" in decisions[0].reasons[0]


def test_where_the_walker_stands_the_verdict_is_that_of_the_desktop():
    obs = _walk(AROUND, np.array([120.0, 90.0]))
    posterior = locate(obs, Prior(), EFFORT)
    verdict = LiveVerdict()
    assert verdict.update(posterior, obs).verdict == "cannot tell"
    assert verdict.update(posterior, obs, stands=True) == decide(posterior, obs, within_m=LIVE_M)
    assert verdict.update(posterior, obs).verdict == "located"


def test_a_location_that_is_lost_has_to_be_confirmed_again():
    obs = _walk(AROUND, np.array([120.0, 90.0]))
    posterior = locate(obs, Prior(), EFFORT)
    verdict = LiveVerdict()
    for _ in range(CONFIRMED_AFTER + 1):
        verdict.update(posterior, obs)
    for r95_m in (LIVE_M + 1.0, posterior.r95_m):
        decision = verdict.update(replace(posterior, r95_m=r95_m), obs)
        assert decision.verdict == "cannot tell"


def test_the_answer_is_that_of_the_desktop_for_the_same_readings():
    obs = _walk(AROUND, np.array([120.0, 90.0]))
    locator, followed, answers = OnlineLocator(Prior()), FollowedCell("a"), []
    for reading in obs:
        locator.take(reading)
        if locator.stale > 1.0:
            locator.search()
        before, way = followed.answer, followed.way
        followed.update(reading.places, locator)
        if followed.way is not None and followed.way is not way:
            places = followed.answer.place.likely_modes
            assert ("places fit" in followed.way.text) == (len(places) > 1)
        if followed.answer is not before:
            answers.append(len(locator.readings.readings()))
            if len(answers) % 5 == 0:  # each costs as much as the answer
                at_desktop = locate(locator.readings.readings())
                assert followed.answer.place.r95_m == pytest.approx(at_desktop.r95_m, abs=0.1)
    print(f"answers after readings {answers} of {len(obs)}")
    assert len(answers) >= 10
    assert min(np.diff(answers)) >= 15  # a reading is a second


def test_where_the_walker_stops_the_answer_is_that_of_all_readings():
    obs = _walk(AROUND, np.array([120.0, 90.0])).part(slice(250))
    locator, followed = OnlineLocator(Prior()), FollowedCell("a")
    for reading in obs:
        locator.take(reading)
        if locator.stale > 1.0:
            locator.search()
        followed.update(reading.places, locator)
    last, answers = obs.places[-1], [followed.answer]
    for second in range(60):
        stand = replace(last, x_m=last.x_m + second % 7, t_ns=last.t_ns + second * 10**9)
        followed.update(stand, locator)
        if followed.answer is not answers[-1]:
            answers.append(followed.answer)
            renewed_s = second
    at_desktop = locate(locator.readings.readings())
    print(f"{answers[0].place.r95_m:.1f} -> {answers[-1].place.r95_m:.1f} m after {renewed_s} s")
    assert len(answers) == 2
    assert 10 <= renewed_s <= 25
    assert answers[-1].place.r95_m == pytest.approx(at_desktop.r95_m, abs=0.1)


def test_a_transmitter_that_moved_is_two_positions_in_time():
    there = np.linspace(0.0, 1.0, len(AROUND)) > 0.5
    emitter_m = np.where(there[:, None], [420.0, 150.0], [40.0, 60.0])
    obs = _walk(AROUND, emitter_m)
    posterior = locate(obs, Prior(), EFFORT)
    division = divide_in_time(obs, posterior, LIVE)
    assert division.is_in_time
    assert division.log_factor > LEAST_LOG_FACTOR
    decision = LiveVerdict().update(posterior, obs)
    assert decision.verdict == "cannot tell"
    assert "seems to have moved, from near" in decision.reasons[0]
    sharp = locate(_walk(AROUND, np.array([120.0, 90.0])), Prior(), EFFORT)
    assert LiveVerdict().update(sharp, obs, stands=True).verdict == "cannot tell"
    of_two_walks = assess(posterior, replace(obs, is_timed=False), division)
    assert "seems to have moved, between" in of_two_walks.reasons[0]


def test_one_that_stays_is_one_position():
    for seed in range(5):
        obs = _walk(AROUND, np.array([120.0, 90.0]), seed=seed)
        posterior = locate(obs, Prior(), EFFORT)
        assert divide_in_time(obs, posterior, LIVE).log_factor < 0.0


def test_one_that_moves_is_not_located_by_a_walker_who_circles_it():
    share = np.linspace(0.0, 1.0, 300)
    emitter_m = share[:, None] * [300.0, 0.0]
    angle = 4.0 * np.pi * share
    away_m = 80.0 * (1.0 + 0.5 * np.cos(2.3 * angle))
    around = np.stack([away_m * np.sin(angle), 80.0 * np.cos(angle)], axis=1)
    obs = _walk(emitter_m + around, emitter_m, noise_db=3.0)
    sharp = locate(_walk(AROUND, np.array([120.0, 90.0])), Prior(), EFFORT)
    assert divide_in_time(obs, sharp, LIVE).log_factor < 0.0
    verdict = LiveVerdict()
    decisions = [verdict.update(sharp, obs) for _ in range(CONFIRMED_AFTER + 2)]
    assert "located" not in {decision.verdict for decision in decisions}
    assert "a transmitter that moves" in decisions[-1].reasons[0]


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg"),
    [(60.4, 5.9995), (0.0003, 9.5), (-54.8, -72.0), (-16.8, 179.9995), (83.9, 17.9)],
)
@pytest.mark.parametrize("direction_deg", [3.0, 85.0, 140.0, 275.0])
def test_directions_are_from_true_north_also_across_zones_equator_and_date_line(
    lat_deg, lon_deg, direction_deg
):
    to_lon_deg, to_lat_deg, _ = WGS84.fwd(lon_deg, lat_deg, direction_deg, 150.0)
    utm = Utm.at(lat_deg, lon_deg)
    found_deg = true_azimuth_deg(
        Places.of_degrees(lat_deg, lon_deg, utm=utm),
        Places.of_degrees(to_lat_deg, to_lon_deg, utm=utm),
    )
    # the flattening of the Earth is not part of it: 0.2 degrees at the equator
    assert abs((found_deg - direction_deg + 180.0) % 360.0 - 180.0) < 0.3


def test_the_region_on_the_page_is_not_smaller_than_its_area():
    obs = _walk(line((0.0, 0.0), (150.0, 0.0)), np.array([400.0, 900.0]), noise_db=5.0)
    posterior = locate(obs, Prior(), Effort(most_squares=4000, split_share=1e-4, nodes=1))
    rings = np.array(squares_of_region(posterior).coordinates)
    assert len(rings) <= 400
    areas_m2 = [abs(WGS84.polygon_area_perimeter(*ring.T)[0]) for ring in rings[:, 0]]
    assert 0.99 < sum(areas_m2) / posterior.region_area_m2 < 2.0
