from dataclasses import replace

import numpy as np
import pytest

from logger.core.errors import EstimationError
from logger.core.locator.pipeline import locate
from logger.core.locator.region import HALF, highest_density, with_distant
from logger.core.locator.summary import BIAS_SHARE, DISTANT_M, DISTANT_SHARE
from logger.core.locator.verdict import assess
from logger.core.model.area import Area
from logger.core.model.prior import WHITE, NoiseGroup, Prior, Reach, Station
from tests.kit.walks import (
    censor_at_floor,
    nearest_mode_m,
    observations,
    path,
    region_contains,
    simulate,
    single_reading,
    with_places,
)


def simulate_walk(seed, shape, **noise):
    return simulate(np.random.default_rng(seed), shape, count=150, step=5.6, **noise)


# --- values ---


def test_numbers_of_a_clear_case():
    obs, source = simulate_walk(24, "square", white_db=2.0)
    found = locate(obs)
    assert assess(found, obs).verdict == "located"
    assert np.hypot(found.x_m - source[0], found.y_m - source[1]) < 1.5 * found.r95_m
    assert found.sigma_db == pytest.approx(2.0, abs=0.4)
    assert found.eta + 3 * found.eta_sigma > 2.3
    assert found.eta - 3 * found.eta_sigma < 3.9
    assert not found.at_limit
    assert np.all(np.linalg.eigvalsh(found.modes[0].covariance) > 0.0)


def test_numbers_are_those_of_the_cells():
    obs, _ = simulate_walk(28, "L", shadow_db=4.0)
    found = locate(obs)
    p, away = (
        found.squares.probability,
        np.hypot(found.squares.x_m - found.x_m, found.squares.y_m - found.y_m),
    )
    assert p.sum() == pytest.approx(1.0)
    assert p[away <= found.r95_m].sum() == pytest.approx(0.95, abs=0.01)
    assert p[away <= found.r50_m].sum() == pytest.approx(0.5, abs=0.03)
    assert found.drms_m == pytest.approx(np.sqrt(p @ away**2), rel=0.02)
    assert found.region_area_m2 == np.sum(found.squares.size_m[highest_density(found.squares)] ** 2)
    assert sum(mode.probability for mode in found.modes) == pytest.approx(1.0, abs=0.02)
    assert [m.probability for m in found.modes] == sorted(
        (m.probability for m in found.modes), reverse=True
    )
    assert max(mode.peak for mode in found.modes) == 1.0
    strongest = found.modes[0]
    assert (found.x_m, found.y_m) == (strongest.x_m, strongest.y_m)


@pytest.mark.parametrize("shape", ["straight", "L", "square", "circle"])
def test_the_position_shown_is_a_mode_and_the_ellipse_of_a_mode_is_about_it(shape):
    for seed in range(3):
        found = locate(simulate_walk(seed, shape, shadow_db=4.0)[0])
        assert (found.x_m, found.y_m) in {(mode.x_m, mode.y_m) for mode in found.modes}
        assert 0.0 < found.r50_m <= found.r95_m
        for mode in found.modes:
            off_m2 = (mode.x_m - mode.state[0]) ** 2 + (mode.y_m - mode.state[1]) ** 2
            about_m2 = np.trace(mode.covariance[:2, :2]) + off_m2
            axes_m2 = mode.ellipse.semi_major_m**2 + mode.ellipse.semi_minor_m**2
            assert axes_m2 == pytest.approx(5.991 * about_m2)


@pytest.mark.parametrize("aside", [0.49, 0.51])
def test_the_strongest_reading_is_inside_up_to_the_edge_of_the_half_region(aside):
    found = locate(simulate_walk(28, "L", shadow_db=4.0)[0])
    inner, squares = highest_density(found.squares, HALF), found.squares
    k = inner[np.argmax(squares.x_m[inner] + 0.5 * squares.size_m[inner])]  # its eastern edge
    at = single_reading(squares.x_m[k] + aside * squares.size_m[k], squares.y_m[k], -60.0)
    assert replace(found, strongest=at).is_strongest_inside == (aside < 0.5)


def test_what_is_finite_stays_finite_where_most_cells_hold_nothing():
    """Levels almost without noise: the probability of a far cell is no number that a float can
    hold.
    """
    x, y = path("square", 150, 5.6)
    level = (
        -30
        - 32 * np.log10(np.hypot(x - 100, y - 60))
        + 0.05 * np.random.default_rng(1).normal(size=150)
    )
    found = locate(observations(x, y, level))
    assert np.hypot(found.x_m - 100, found.y_m - 60) < 2.0
    numbers = (
        found.r95_m,
        found.drms_m,
        found.p0_dbm,
        found.p0_sigma_db,
        found.eta,
        found.eta_sigma,
        found.sigma_db,
    )
    assert np.all(np.isfinite(numbers))


def test_no_position_is_more_certain_than_its_square():
    x, y = path("square", 150, 5.6)
    found = locate(observations(x, y, -30 - 32 * np.log10(np.hypot(x - 100, y - 60))))
    assert found.r95_m > 0.3 * np.min(found.squares.size_m)


def test_no_reading_at_all():
    with pytest.raises(EstimationError, match="no reading"):
        locate(observations([], [], []))


# --- how far away ---


def walk_past(seed, away_m, noise_db=3.0):
    """An L of 840 m, and a station so far from one of its points."""
    rng = np.random.default_rng(seed)
    x_m, y_m = path("L", 75, 11.2)
    k, bearing = rng.integers(len(x_m)), rng.uniform(0.0, 2.0 * np.pi)
    apart_m = np.hypot(
        x_m - x_m[k] - away_m * np.cos(bearing), y_m - y_m[k] - away_m * np.sin(bearing)
    )
    level_dbm = -25.0 - 32.0 * np.log10(np.maximum(apart_m, 5.0))
    return observations(x_m, y_m, np.round(level_dbm + rng.normal(0.0, noise_db, 75)), 3.0)


@pytest.mark.parametrize("away_m", [60.0, 1000.0, 4000.0])
def test_what_distant_transmitters_add_is_by_the_ratio_of_evidences(away_m):
    """Against the posterior under a prior that has nothing but such places."""
    white = (NoiseGroup(1.0, (WHITE,)),)
    usual, distant = Prior(noise=white), Prior(noise=white, reaches=(Reach(1.0, DISTANT_M, 60.0),))
    for seed in range(2):
        obs = walk_past(seed, away_m)
        found, far = locate(obs, usual), locate(obs, distant)
        weight = DISTANT_SHARE * np.exp(far.log_evidence - found.log_evidence)
        weight /= weight + 1.0 - DISTANT_SHARE
        squares = zip(far.squares.x_m, far.squares.y_m, far.squares.probability, strict=True)
        held = sum(p for x_m, y_m, p in squares if region_contains(found, (x_m, y_m)))
        expected = 1.0 - (1.0 - weight) * 0.95 - weight * held
        widened = with_distant(found.squares, found.distant_share)
        outside = 1.0 - np.sum(widened.probability[highest_density(found.squares)])
        assert outside == pytest.approx(expected, abs=0.15)


def test_levels_of_a_distant_mast_are_named_so_and_those_of_a_near_one_are_not():
    walks = range(6)
    assert all(locate(walk_past(seed, 5000.0)).may_be_distant for seed in walks)
    assert not any(locate(walk_past(seed, 60.0)).may_be_distant for seed in walks)


def test_an_area_and_a_timing_advance_bound_the_distance():
    obs = walk_past(1, 800.0)
    assert locate(obs).may_be_distant
    timed = replace(obs, ta=np.full(len(obs), 1), rat="GSM")
    assert not locate(timed).may_be_distant
    assert not locate(obs, Prior(area=Area.within_walk(300.0))).may_be_distant


# --- mirror images ---


def test_straight_walk_leaves_two_mirror_images():
    for seed in (14, 15, 16):
        obs, (x, y) = simulate_walk(seed, "straight")
        found = locate(obs)
        assert len(found.modes) >= 2
        assert found.modes[1].peak == pytest.approx(found.modes[0].peak, rel=0.02)
        # one of them has the squares between both; which, and how many, rounding decides
        assert found.modes[1].probability == pytest.approx(found.modes[0].probability, abs=0.3)
        assert region_contains(found, (x, y), 10.0) == region_contains(found, (x, -y), 10.0)
        best = found.modes[0]  # the squares between both move its mean
        assert nearest_mode_m(found, (best.x_m, -best.y_m)) < best.ellipse.semi_major_m
        assert assess(found, obs).verdict != "located"


@pytest.mark.parametrize("away", [0.6, 1.6])
def test_round_walk_leaves_the_inverse_point(away):
    """The distances from p and from its inverse have one ratio all along the circle
    (Apollonius).
    """
    x, y = path("circle", 150, 5.6)
    radius = np.hypot(x, y)[0]
    source, mirror = (away * radius, 0.0), (radius / away, 0.0)
    noise = np.random.default_rng(15).normal(size=len(x))
    obs = observations(x, y, -30 - 32 * np.log10(np.hypot(x - source[0], y)) + 2.0 * noise)
    found = locate(obs, Prior(stations=(Station(1.0, 0.0),)))
    assert nearest_mode_m(found, source) < 40.0
    assert nearest_mode_m(found, mirror) < 40.0
    assert region_contains(found, source, 10.0)
    assert region_contains(found, mirror, 10.0)
    assert assess(found, obs).verdict != "located"


# --- invariances ---


def turn(obs, angle):
    c, s = np.cos(angle), np.sin(angle)
    return with_places(obs, x_m=c * obs.x_m - s * obs.y_m, y_m=s * obs.x_m + c * obs.y_m)


def test_shift_of_the_walk():
    obs, _ = simulate_walk(20, "L")
    a, b = locate(obs), locate(with_places(obs, x_m=obs.x_m + 500_000.0, y_m=obs.y_m + 5_000_000.0))
    assert (b.x_m - 500_000.0, b.y_m - 5_000_000.0) == pytest.approx((a.x_m, a.y_m), abs=0.15)
    assert b.region_area_m2 == pytest.approx(a.region_area_m2, rel=0.05)
    assert b.log_evidence == pytest.approx(a.log_evidence, abs=0.01)


def test_rotation_of_the_walk():
    obs, _ = simulate_walk(21, "random")
    a, b = locate(obs), locate(turn(obs, 0.7))
    c, s = np.cos(0.7), np.sin(0.7)
    off = np.hypot(b.x_m - (c * a.x_m - s * a.y_m), b.y_m - (s * a.x_m + c * a.y_m))
    assert off < 0.25 * a.r95_m
    # the edge of the region lies in a flat tail, which depends on how the walk falls into blocks
    assert b.r95_m == pytest.approx(a.r95_m, rel=0.25)
    assert 0.6 < b.region_area_m2 / a.region_area_m2 < 1.7
    assert b.log_evidence == pytest.approx(a.log_evidence, abs=0.2)


def test_constant_added_to_all_levels():
    obs, _ = simulate_walk(22, "square")
    wide = Prior(p0_sigma_db=300.0)
    a, b = locate(obs, wide), locate(replace(obs, level_dbm=obs.level_dbm + 20.0), wide)
    assert (b.x_m, b.y_m) == pytest.approx((a.x_m, a.y_m), abs=0.02 * a.r95_m)
    assert b.p0_dbm - a.p0_dbm == pytest.approx(20.0, abs=0.2)
    assert b.eta == pytest.approx(a.eta, abs=0.02)


def test_equal_levels_leave_no_rounding():
    """Squared levels exceed what remains of them a million times.

    Lost digits must not decide the position.
    """
    x = np.arange(50) * 10.0
    a, b = (locate(observations(x, 0 * x, 0 * x - 80.0 + tiny)) for tiny in (0.0, 1e-9))
    assert b.log_evidence == pytest.approx(a.log_evidence, abs=0.01)
    assert b.r95_m == pytest.approx(a.r95_m, rel=0.05)
    assert np.max(a.squares.probability) < 0.1


def test_order_of_the_readings_does_not_matter():
    obs, _ = simulate_walk(23, "L")
    order = np.random.default_rng(23).permutation(len(obs))
    a = locate(obs)
    b = locate(obs.part(order))
    assert (b.x_m, b.y_m, b.r95_m) == pytest.approx((a.x_m, a.y_m, a.r95_m), abs=0.01)


def test_standing_still_adds_no_certainty():
    rng = np.random.default_rng(4)
    obs, _ = simulate(rng, "square", white_db=1.0, shadow_db=5.0, count=150, step=5.6)
    again = 20_000
    long = observations(
        np.append(obs.x_m, np.full(again, obs.x_m[70])),
        np.append(obs.y_m, np.full(again, obs.y_m[70])),
        np.append(obs.level_dbm, obs.level_dbm[70] + rng.normal(size=again)),
    )
    assert locate(long).region_area_m2 > 0.7 * locate(obs).region_area_m2


# --- the end of the searched area ---


def test_the_search_reaches_as_far_as_the_prior():
    obs, _ = simulate_walk(29, "square")
    for reach_m in (500.0, 30_000.0):
        cells = locate(obs, Prior(reach_m=reach_m)).squares
        assert np.max(np.abs(cells.x_m) + 0.5 * cells.size_m) >= reach_m
        assert np.max(np.abs(cells.y_m) + 0.5 * cells.size_m) >= reach_m


@pytest.mark.parametrize("power", [3.0, 0.0])
def test_mass_at_the_end_of_the_search_is_reported(power):
    """A source 10 km away, searched to 3 km, with 1 dB of noise; also under a prior that is
    even.
    """
    x, y = path("square", 150, 5.6)
    noise = np.random.default_rng(30).normal(size=len(x))
    obs = observations(x, y, 20 - 30 * np.log10(np.hypot(x - 10_000, y)) + noise)
    found = locate(obs, Prior(reach_m=3000.0, reaches=(Reach(1.0, 200.0, power),)))
    away = np.hypot(found.squares.x_m - 100, found.squares.y_m - 100)
    assert found.limit_share == pytest.approx(
        found.squares.probability[away > 2200.0].sum(), abs=0.1
    )
    assert found.limit_share > 0.02
    assert found.at_limit
    outcome, reasons, *_ = assess(found, obs)
    assert outcome == "cannot tell"
    assert any("farther than the searched 3 km" in reason for reason in reasons)


def test_no_mass_at_the_end_of_the_search_of_a_clear_case():
    obs, _ = simulate_walk(24, "square", white_db=2.0)
    assert locate(obs).limit_share < 0.01


# --- the receiver's error ---


@pytest.mark.parametrize("position_sigma", [3.0, 8.0, 20.0])
def test_an_error_of_the_receiver_that_lasts_moves_the_answer_along(position_sigma):
    """However strong the levels, a position is no more certain than the walk."""
    x, y = path("square", 150, 5.6)
    level = np.round(-30 - 32 * np.log10(np.hypot(x - 100, y - 90)))
    found = locate(observations(x, y, level, position_sigma))
    p, cells = found.squares.probability, found.squares
    for at in (cells.x_m, cells.y_m):
        assert np.sqrt(p @ (at - p @ at) ** 2) > 0.9 * np.sqrt(BIAS_SHARE) * position_sigma


# --- the end of the scale ---


def test_a_walk_half_at_the_floor_is_located_no_better_than_the_whole():
    obs, _ = simulate_walk(24, "square", white_db=2.0)
    half, complete = locate(censor_at_floor(obs, 0.5)), locate(obs)
    assert half.region_area_m2 > complete.region_area_m2
    assert np.isfinite(half.log_evidence)


@pytest.mark.parametrize("seed", [1, 8])
def test_the_small_mirror_image_within_a_round_walk_is_found(seed):
    """A twentieth of the mass on a hundredth of the area: no cell of the first search shows it."""
    x, y = path("circle")
    level = (
        -30.0
        - 30.0 * np.log10(np.hypot(x - 300.0, y - 10.0))
        + 3.0 * np.random.default_rng(seed).normal(size=600)
    )
    outside, inside = locate(observations(x, y, level)).modes
    radius_m2 = x[0] ** 2 + y[0] ** 2
    assert np.hypot(inside.x_m, inside.y_m) == pytest.approx(
        radius_m2 / np.hypot(outside.x_m, outside.y_m), rel=0.1
    )
    assert inside.probability > 0.02
    assert inside.peak > 0.5
