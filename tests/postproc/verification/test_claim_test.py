import numpy as np
import pytest
from scipy.stats import ncx2

from logger.core.locator.region import Squares
from logger.core.model.prior import Prior
from logger.core.places import Places
from postproc.verification.claim_test import BEARINGS_DEG, ClaimTest, around
from postproc.verification.claims import Claim
from postproc.verification.run_claims import benjamini_hochberg, verify_cell
from tests.kit.walks import observations, path, simulate

SIGMA_M = 50.0


def gaussian(side_m=5.0, extent_m=300.0):
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


def at(*place):
    return np.array(place, float)[:, None]


def test_s_is_the_probability_of_what_is_less_likely():
    squares = gaussian()
    for away_m in (0.0, 30.0, 70.0, 120.0):
        tail = ClaimTest(squares, at(0.6 * away_m, 0.8 * away_m)).tail()
        assert tail == pytest.approx(np.exp(-0.5 * (away_m / SIGMA_M) ** 2), abs=0.05)
    far, farther = (ClaimTest(squares, at(x_m, 0.0)).tail() for x_m in (600.0, 850.0))
    assert 1e-6 > far > farther > 0.0
    assert ClaimTest(squares, at(5000.0, 0.0)).tail() == 0.0


def test_every_square_is_found_by_its_places():
    squares = gaussian()
    rng = np.random.default_rng(1)
    chosen = rng.integers(len(squares), size=200)
    inside = rng.uniform(-0.49, 0.49, (2, 200)) * squares.size_m[chosen]
    places = np.stack([squares.x_m, squares.y_m])[:, chosen] + inside
    found = ClaimTest(squares, at(0.0, 0.0))._densities(places)
    assert found == pytest.approx(squares.density[chosen])


def test_power_is_that_of_the_posterior():
    test = ClaimTest(gaussian(), at(0.0, 0.0))
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
    free, within = (ClaimTest(gaussian(), at(0.0, 0.0), one) for one in (False, True))
    assert within.p_values(tail) == pytest.approx(tail)
    assert free.p_values(tail) == pytest.approx([0.0, 0.0371, 0.05, 1.0], abs=0.001)
    assert free.p <= within.p == within.tail()


def test_true_claims_pass_and_false_ones_fail():
    for seed in range(3):
        obs, source = simulate(np.random.default_rng(100 + seed), "square", white_db=2.0)
        lat_deg, lon_deg = obs.utm.to_latlon(*source)
        true = verify_cell(obs, Claim(obs.cell, lat_deg, lon_deg, 0.0, "test"), 0.05, Prior())
        false = Claim(obs.cell, lat_deg + 0.02, lon_deg, 0.0, "test")
        far = verify_cell(obs, false, 0.05, Prior())
        assert true.p > 0.05 > far.p
        assert true.notices_m < 2000.0


def test_uncertainty_of_the_claim_is_as_good_as_distance():
    squares, off = gaussian(), Places.of(100.0, 90.0)
    sharp, soft = (ClaimTest(squares, around(off, sigma_m)).tail() for sigma_m in (0.0, 200.0))
    assert soft > sharp
    places = around(Places.of(10.0, -20.0), 50.0)
    assert np.mean(places, axis=1) == pytest.approx([10.0, -20.0])
    assert np.std(places, axis=1) == pytest.approx([50.0, 50.0], rel=0.1)


def test_claim_has_no_hole_that_a_place_falls_into():
    places = around(Places.of(0.0, 0.0), 100.0)
    x, y = (v.ravel() for v in np.meshgrid(*[np.arange(-100.0, 101.0, 5.0)] * 2))
    apart = np.hypot(*(v[:, None] - own for v, own in zip((x, y), places, strict=True)))
    assert np.max(np.min(apart, axis=1)[np.hypot(x, y) < 100.0]) < 17.0


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
