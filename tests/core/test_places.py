"""Places of the walker and of a transmitter: frame, time, ground measured before."""

from dataclasses import replace

import numpy as np
import pytest

from logger.core import shadow_ekf
from logger.core.certainty import OnMap
from logger.core.errors import ConfigError, GeoError
from logger.core.places import Places, Utm, join_places, position_of
from logger.core.shadow_ekf import ShadowNoise
from logger.sim.world import Shadowing

SHADOWED = ShadowNoise(6.0, 15.0, 2.0, 0.0)


def walk(t_s, x_m, y_m=None, **columns):
    x = np.asarray(x_m, float)
    y = np.zeros(len(x)) if y_m is None else np.asarray(y_m, float)
    t_ns = np.round(np.asarray(t_s) * 1e9).astype(np.int64)
    return Places.of(x, y, t_ns=t_ns, **columns)


def rounds(laps, step=2.8, side=200.0):
    s = np.arange(0.0, 4 * side * laps, step) % (4 * side)
    corner = [0, side, 2 * side, 3 * side, 4 * side]
    return np.interp(s, corner, [0, side, side, 0, 0]), np.interp(s, corner, [0, 0, side, side, 0])


# --- one and many ---


def test_one_place_is_a_part_of_length_one():
    many = walk([0.0, 1.0, 2.0], [5.0, 6.0, 9.0], [1.0, 1.0, 5.0])
    assert len(many[1]) == 1
    assert many[-1].x_m.item() == 9.0
    assert many[2].away_m(many[1]) == 5.0
    with pytest.raises(IndexError):
        many[3]
    again = join_places([many[k] for k in range(3)])
    assert all(np.array_equal(getattr(again, n), getattr(many, n)) for n in ("x_m", "y_m", "t_ns"))


def test_a_place_of_coordinates_alone_is_certain_and_has_no_height():
    place = Places.of(3.0, 4.0)
    assert (len(place), place.sigma_m.item(), place.t_ns.item()) == (1, 0.0, 0)
    assert np.isnan(place.z_m.item())


def test_equal_places_have_equal_numbers_and_unknown_heights_alike():
    walk = Places.of([0.0, 3.0], [1.0, 2.0], utm=Utm(32))
    assert walk == Places.of([0.0, 3.0], [1.0, 2.0], utm=Utm(32))
    assert walk != walk[0]
    assert walk != Places.of([0.0, 3.0], [1.0, 2.0], utm=Utm(33))
    assert walk != replace(walk, z_m=np.array([400.0, np.nan]))


def test_distances_are_from_each_to_each():
    here, there = Places.of([0.0, 3.0], [0.0, 0.0]), Places.of([0.0, 3.0, 0.0], [4.0, 4.0, 0.0])
    np.testing.assert_allclose(here.distances_m(there), [[4.0, 5.0, 0.0], [5.0, 4.0, 3.0]])
    unsure = Places.of([0.0], [0.0], sigma_m=np.array([2.0]))
    expected = 5.0 * np.log10(4.0**2 + 5.0**2 + 2.0 * 2.0**2)
    assert unsure.log_distance_to(there, 5.0)[0, 0] == pytest.approx(expected)


# --- the frame ---


@pytest.mark.parametrize(("lat_deg", "lon_deg"), [(52.5, 13.4), (-33.9, 18.4), (0.0, 179.999)])
def test_degrees_come_back_and_a_zone_may_be_given(lat_deg, lon_deg):
    place = Places.of_degrees(lat_deg, lon_deg)
    assert place.lat_lon_deg[:, 0] == pytest.approx((lat_deg, lon_deg), abs=1e-9)
    beside = place.in_zone(Utm(abs(place.utm.zone) % 60 + 1))
    at = beside.on_map
    assert (at.lat, at.lon) == pytest.approx((lat_deg, lon_deg), abs=1e-9)
    assert place.in_zone(place.utm) is place


@pytest.mark.parametrize("text", ["-33.9241,18.4247", "-33.9241 18.4247", " -33.9241, 18.4247"])
def test_a_position_is_read_as_it_is_written_and_as_our_tables_print_it(text):
    at = OnMap(lat=-33.9241, lon=18.4247)
    assert position_of(text) == (at, None)
    assert position_of(f"{text},80", "SIGMA_M") == (at, 80.0)


@pytest.mark.parametrize("text", ["", "here", "52.5", "nan,13.4", "52.5,13.4,80", "52,5,13,4"])
def test_what_is_no_position_is_said_with_what_is_wanted(text):
    with pytest.raises(ConfigError, match="is no position: LAT,LON is wanted, like 52.52,13.405"):
        position_of(text)
    with pytest.raises(GeoError, match="swapped"):
        position_of("133.9,52.5")


def test_beyond_the_map_there_is_no_place():
    with pytest.raises(GeoError, match="84"):
        Places.of_degrees([52.0, 85.0], [13.0, 13.0])


# --- in time ---


def test_places_between_fixes_are_interpolated_and_known_only_near_them():
    fixes = walk([0.0, 4.0, 30.0], [0.0, 40.0, 300.0])
    t_ns = np.array([2, 5, 15, 31, 33]) * 10**9
    np.testing.assert_allclose(fixes.at(t_ns).x_m[:2], [20.0, 50.0])
    assert fixes.covers(t_ns).tolist() == [True, True, False, True, False]
    assert fixes.way_m(np.array([0]), np.array([4 * 10**9])).tolist() == [40.0]


# --- ground measured before ---


def test_a_walk_that_never_comes_back_is_new_everywhere():
    s = np.arange(0.0, 2000.0, 1.4)
    assert np.all(Places.of(s, 0.3 * s).thin(again=False))


def test_the_second_round_is_no_news():
    new = Places.of(*rounds(2)).thin(again=False)
    half = len(new) // 2
    assert np.mean(new[:half]) > 0.97
    assert np.mean(new[half:]) < 0.03
    assert np.all(Places.of(*rounds(2)).thin(again=True))


def test_a_receivers_error_hides_little_of_it():
    rng = np.random.default_rng(1)
    x, y = rounds(2)
    walked = Places.of(x + rng.normal(0, 3, len(x)), y + rng.normal(0, 3, len(y)))
    assert np.mean(walked.thin(again=False)[len(x) // 2 :]) < 0.2


@pytest.mark.parametrize("again", [True, False])
def test_standing_still_soon_lingers_and_pacing_comes_back(again):
    still = Places.of(np.zeros(100), np.zeros(100)).thin(again=again)
    assert still.tolist() == [True] * 30 + [False] * 70
    assert not Places.of(np.tile([1.0, 4.0], 50), np.zeros(100)).thin(again=False)[-1]


@pytest.mark.parametrize(("once", "low", "high"), [(True, 0.87, 1.0), (False, 0.0, 0.85)])
def test_a_filter_stays_honest_over_a_street_walked_four_times(once, low, high):
    """Shadowing of the point, the same in each round; coverage of the 95 % ellipse in 80 worlds."""
    rng = np.random.default_rng(2)
    x, y = rounds(4, step=5.6)
    informative = Places.of(x, y).thin(again=False) | (not once)
    p = np.diag([8.0, 8.0, 3.0, 0.15]) ** 2
    held = []
    for _ in range(80):
        truth = np.array([*rng.uniform(50.0, 150.0, 2), -30.0, 3.0])
        level = truth[2] - 10.0 * truth[3] * np.log10(np.hypot(x - truth[0], y - truth[1]))
        level += Shadowing.draw(6.0, 15.0, rng).at_db(x, y) + 2.0 * rng.normal(size=len(x))
        mean = rng.multivariate_normal(truth, p)
        state = shadow_ekf.release(shadow_ekf.hold(mean, SHADOWED, Places.of(x[0], y[0])), p)
        for x_m, y_m, level_dbm, is_used in zip(
            x.tolist(), y.tolist(), level.tolist(), informative.tolist(), strict=True
        ):
            if is_used:
                state = shadow_ekf.step(state, SHADOWED, x_m, y_m, 0.0, level_dbm).state
        error = np.array(state[:2]) - truth[:2]
        covariance = shadow_ekf.covariance_matrix(state.factors)[:2, :2]
        held.append(error @ np.linalg.solve(covariance, error) < 5.991)
    assert low <= np.mean(held) <= high
