from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest, ncx2

from logger.core.errors import ConfigError
from logger.core.locator.pipeline import locate
from logger.core.locator.region import Squares
from logger.core.model.area import Area
from logger.core.model.prior import Prior
from logger.core.places import Places
from postproc.verification.claims import Claim
from postproc.verification.run_claims import (
    BEARINGS_DEG,
    ClaimTest,
    benjamini_hochberg,
    verify_cell,
)
from tests.kit.walks import observations, path, simulate

SIGMA_M = 50.0


def gaussian(side_m=10.0, extent_m=300.0):
    """A round posterior about the origin, in squares of which the outer ones are larger."""
    squares = []
    for side, low_m, high_m in ((side_m, 0.0, extent_m), (4.0 * side_m, extent_m, 3 * extent_m)):
        edge = np.arange(-high_m, high_m, side) + 0.5 * side
        x_m, y_m = (one.ravel() for one in np.meshgrid(edge, edge))
        ring = np.maximum(np.abs(x_m), np.abs(y_m)) > low_m
        squares.append(np.stack([x_m, y_m, np.full(len(x_m), side)])[:, ring])
    x_m, y_m, size_m = np.concatenate(squares, axis=1)
    p = size_m**2 * np.exp(-0.5 * (x_m**2 + y_m**2) / SIGMA_M**2)
    return Squares(x_m, y_m, size_m, p / np.sum(p))


def at(x_m, y_m):
    return Places.of(x_m, y_m)


def test_s_is_the_probability_of_what_is_less_likely():
    squares = gaussian()
    for away_m in (0.0, 30.0, 70.0, 120.0):
        tail = ClaimTest(squares).tail(at(0.6 * away_m, 0.8 * away_m))
        assert tail == pytest.approx(np.exp(-0.5 * (away_m / SIGMA_M) ** 2), abs=0.05)
    far, farther = (ClaimTest(squares).tail(at(x_m, 0.0)) for x_m in (300.0, 400.0))
    assert 1e-3 > far > farther > 0.0
    assert ClaimTest(squares).tail(at(5000.0, 0.0)) == 0.0


def test_every_square_is_found_by_its_places():
    squares = gaussian()
    rng = np.random.default_rng(1)
    chosen = rng.integers(len(squares), size=200)
    inside = rng.uniform(-0.49, 0.49, (2, 200)) * squares.size_m[chosen]
    places = np.stack([squares.x_m, squares.y_m])[:, chosen] + inside
    test = ClaimTest(squares)
    assert test._square_around(places).tolist() == chosen.tolist()
    assert test._square_around(np.array([[5000.0], [0.0]])).tolist() == [-1]


def test_power_is_that_of_the_posterior():
    test = ClaimTest(gaussian())
    off_m = np.array([0.0, 100.0, 150.0, 250.0])
    power = test.power(off_m, 0.05)
    edge = -2.0 * np.log(0.05 ** (1.0 / 1.1))  # squared, where p is .05
    wanted = ncx2.sf(edge, 2, np.maximum((off_m / SIGMA_M) ** 2, 1e-9))
    assert power.shape == (len(BEARINGS_DEG), len(off_m))
    assert np.mean(power, axis=0) == pytest.approx(wanted, abs=0.04)
    notices_m, directions = test.detectable(0.05)
    assert notices_m == pytest.approx(190.0, rel=0.15)
    assert [one.azimuth_deg for one in directions] == list(BEARINGS_DEG)


def test_the_p_value_is_s_within_an_area_and_less_without():
    tail = np.array([0.0, 0.05, 0.0656, 1.0])
    free, within = (ClaimTest(gaussian(), 0.0, one) for one in (False, True))
    assert within.p_values(tail) == pytest.approx(tail)
    assert free.p_values(tail) == pytest.approx([0.0, 0.0371, 0.05, 1.0], abs=0.001)
    place = at(0.0, 0.0)
    assert free.p(place) <= within.p(place) == within.tail(place)


def test_true_claims_pass_and_false_ones_fail():
    for seed in range(3):
        obs, source = simulate(np.random.default_rng(100 + seed), "square", white_db=2.0)
        lat_deg, lon_deg = obs.utm.to_latlon(*source)
        true = verify_cell(obs, Claim(obs.cell, lat_deg, lon_deg, 0.0, "test"), 0.05, Prior())
        false = Claim(obs.cell, lat_deg + 0.02, lon_deg, 0.0, "test")
        far = verify_cell(obs, false, 0.05, Prior())
        assert true.p > 0.05 > far.p
        assert true.notices_m < 2000.0


@pytest.mark.parametrize("sigma_m", [0.0, 20.0, 50.0, 200.0, 5000.0])
def test_a_vague_claim_is_as_hard_to_reject_as_it_is_vague(sigma_m):
    test = ClaimTest(gaussian(), sigma_m)
    assert test.p(at(0.0, 0.0)) > 0.95
    together_m = np.hypot(SIGMA_M, sigma_m)
    for away in (0.5, 1.5, 2.5):
        tail = test.tail(at(away * together_m, 0.0))
        assert tail == pytest.approx(np.exp(-0.5 * away**2), abs=0.05)


def test_p_of_true_claims_is_uniform_whatever_their_error():
    rng = np.random.default_rng(4)
    for sigma_m in (30.0, 300.0):
        place_m = np.hypot(SIGMA_M, sigma_m) * rng.standard_normal((200, 2))
        test = ClaimTest(gaussian(20.0), sigma_m)
        tails = [test.tail(at(*one)) for one in place_m]
        assert kstest(tails, "uniform").pvalue > 0.01


def test_the_power_falls_with_the_error_of_the_claim():
    notices_m = [ClaimTest(gaussian(), sigma_m).detectable(0.05)[0] for sigma_m in (0.0, 200.0)]
    assert notices_m[1] > 3.0 * notices_m[0]


@pytest.mark.parametrize("sigma_m", [12_000.0, 100_000.0, 900_000.0])
def test_no_walk_notices_where_a_claim_as_vague_as_a_country_is(sigma_m):
    notices_m, directions = ClaimTest(gaussian(), sigma_m).detectable(0.05)
    assert notices_m is None
    assert [one.indirect_m for one in directions] == [None] * len(BEARINGS_DEG)


@pytest.mark.parametrize("sigma_m", [-5.0, np.nan, np.inf])
def test_a_claim_without_a_true_sigma_is_refused(sigma_m):
    with pytest.raises(ConfigError, match="the sigma of a claim is a number of metres"):
        Claim("a", 48.0, 11.0, sigma_m)


def test_an_area_that_the_readings_contradict_decides_nothing():
    obs, source = simulate(np.random.default_rng(100), "square", white_db=2.0)
    lat_deg, lon_deg = obs.utm.to_latlon(*source)
    claim = Claim(obs.cell, lat_deg, lon_deg, 0.0, "test")
    at_m = obs.places.xy_m[:, 0] + [[3000.0], [0.0]]
    ring = tuple((float(at_m[0, 0]) + x, float(at_m[1, 0]) + y) for x, y in (
        (-300.0, -300.0), (300.0, -300.0), (300.0, 300.0), (-300.0, 300.0)
    ))  # fmt: skip
    area = Area("there", polygons=((ring,),), utm=obs.utm)
    verdict = verify_cell(obs, claim, 0.05, replace(Prior(), area=area))
    assert (verdict.verdict, verdict.p) == ("cannot tell", None)
    assert "contradict the area" in verdict.reasons[0]
    wide = replace(area, wider_m=5000.0)
    verdict = verify_cell(obs, claim, 0.05, replace(Prior(), area=wide))
    assert verdict.p > 0.05
    assert verdict.reasons[0].startswith("if it is there: without the area, ")


def walk_past_mast(seed, away_m):
    """Readings of an L, and the mast so far from its beginning."""
    rng = np.random.default_rng(seed)
    x_m, y_m = path("L", 75, 11.2)
    bearing = rng.uniform(0.0, 2.0 * np.pi)
    mast = at(away_m * np.cos(bearing), away_m * np.sin(bearing))
    distance_m = np.hypot(x_m - mast.x_m, y_m - mast.y_m)
    level_dbm = -25.0 - 32.0 * np.log10(distance_m) + rng.normal(0.0, 4.0, len(x_m))
    return observations(x_m, y_m, np.round(level_dbm), 3.0), mast


def test_the_place_of_a_distant_mast_is_not_rejected_for_its_distance_alone():
    """Nothing in the levels speaks against it, only that most stand closer."""
    p = []
    for seed in range(10):
        obs, mast = walk_past_mast(seed, 5000.0)
        test = ClaimTest.of(locate(obs))
        p.append((test.p(mast), ClaimTest(test.squares).p(mast)))
    of_test, by_prior = np.transpose(p)
    assert np.sum(of_test <= 0.05) <= 4
    assert np.sum(by_prior <= 0.05) >= 9


def test_a_rejection_says_that_it_supposes_no_distant_mast():
    rejected = []
    for seed in range(6):
        obs, mast = walk_past_mast(seed, 3000.0)
        claim = Claim(obs.cell, *obs.utm.to_latlon(*mast.xy_m[:, 0]), 0.0, "test")
        verdict = verify_cell(obs, claim, 0.05, Prior())
        rejected += [verdict] if verdict.p <= 0.05 else []
    assert rejected
    assert all(one.reasons[0].startswith("if it is no distant mast") for one in rejected)


def test_a_near_walk_rejects_a_distant_claim():
    obs, _ = simulate(np.random.default_rng(100), "square", white_db=2.0)
    test = ClaimTest.of(locate(obs))
    far_m = np.array([5000.0])
    assert test.p(at(*(obs.places.xy_m[:, 0] + far_m))) < 0.01
    assert np.all(test.power(far_m, 0.05) > 0.99)


def test_benjamini_hochberg():
    q = benjamini_hochberg(np.array([0.01, 0.04, 0.03, 0.9]))
    assert q == pytest.approx([0.04, 0.16 / 3, 0.16 / 3, 0.9])
    assert len(benjamini_hochberg(np.zeros(0))) == 0


def test_walks_that_cannot_tell_say_why():
    claim = Claim("c", 0.0, 9.0, 0.0, "test")
    x, y = path("straight", 4)
    few = verify_cell(observations(x, y, -60.0 - 3.0 * np.arange(4)), claim, 0.05, Prior())
    assert few.verdict == "cannot tell"
    assert "only 4 readings" in few.reasons[0]
    standing = observations(np.zeros(50), np.zeros(50), np.full(50, -60.0))
    assert verify_cell(standing, claim, 0.05, Prior()).verdict == "cannot tell"
