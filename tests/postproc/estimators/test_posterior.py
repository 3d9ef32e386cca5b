from dataclasses import replace

import numpy as np
import pytest

from logger.core.errors import EstimationError
from logger.core.geo import Utm
from postproc.estimators.evidence import Prior
from postproc.estimators.posterior import locate
from postproc.estimators.verdict import verdict
from tests.kit.walks import covered, nearest_mode_m, observations, path, simulate


def test_standing_still_adds_no_certainty():
    rng = np.random.default_rng(4)
    obs, _ = simulate(rng, "square", white_db=1.0, shadow_db=5.0)
    again = 20_000
    long = observations(
        np.append(obs.x_m, np.full(again, obs.x_m[300])),
        np.append(obs.y_m, np.full(again, obs.y_m[300])),
        np.append(obs.level_dbm, obs.level_dbm[300] + rng.normal(size=again)),
    )
    assert locate(long).region_area_m2 > 0.7 * locate(obs).region_area_m2


# --- coverage ---


@pytest.mark.parametrize("shape", ["L", "square"])
def test_region_holds_the_truth_white_noise(shape):
    rng = np.random.default_rng(10)
    runs = [simulate(rng, shape, count=300, step=2.8) for _ in range(20)]
    held = [covered(locate(obs), source) for obs, source in runs]
    assert np.mean(held) >= 0.8  # 20 runs of 0.95: fewer than 16 in 0.3 %


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["L", "square"])
def test_region_holds_the_truth_white_noise_many(shape):
    rng = np.random.default_rng(11)
    runs = [simulate(rng, shape) for _ in range(100)]
    assert 0.9 <= np.mean([covered(locate(obs), source) for obs, source in runs]) <= 0.99


def test_region_holds_the_truth_correlated_shadowing():
    rng = np.random.default_rng(12)
    runs = [simulate(rng, "square", white_db=0.0, shadow_db=6.0, count=300, step=2.8) for _ in range(20)]
    assert np.mean([covered(locate(obs), source) for obs, source in runs]) >= 0.85


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["L", "square"])
def test_region_holds_the_truth_correlated_shadowing_many(shape):
    rng = np.random.default_rng(13)
    runs = [simulate(rng, shape, white_db=0.0, shadow_db=6.0) for _ in range(60)]
    assert np.mean([covered(locate(obs), source) for obs, source in runs]) >= 0.85


def test_straight_walk_leaves_two_mirror_images():
    rng = np.random.default_rng(14)
    for _ in range(8):
        obs, (x, y) = simulate(rng, "straight", count=300, step=2.8)
        found = locate(obs)
        mirrored = max(abs(m.y_m) for m in found.modes)
        assert len(found.modes) >= 2
        assert covered(found, (x, y), 10.0) == covered(found, (x, -y), 10.0)
        assert covered(found, (x, y), 25.0)
        assert nearest_mode_m(found, (found.x_m, -found.y_m)) < 0.1 * mirrored + 2.0
        assert verdict(found, obs)[0] != "located"


def test_round_walk_leaves_the_inverse_point():
    rng = np.random.default_rng(15)
    x, y = path("circle", 300, 2.8)
    radius = np.hypot(x, y)[0]
    for away in (0.6, 1.6):
        source = away * radius, 0.0
        twin = radius / away, 0.0
        level = -30 - 32 * np.log10(np.hypot(x - source[0], y)) + 2.0 * rng.normal(size=len(x))
        found = locate(observations(x, y, level), Prior(height_m=0.0))
        assert nearest_mode_m(found, source) < 40.0
        assert nearest_mode_m(found, twin) < 40.0
        assert covered(found, source, 10.0)
        assert covered(found, twin, 10.0)
        assert verdict(found, observations(x, y, level))[0] != "located"


# --- invariances ---


def test_shift_of_the_walk():
    obs, _ = simulate(np.random.default_rng(20), "L")
    a, b = locate(obs), locate(replace(obs, x_m=obs.x_m + 500_000.0, y_m=obs.y_m + 5_000_000.0))
    assert (b.x_m - 500_000.0, b.y_m - 5_000_000.0) == pytest.approx((a.x_m, a.y_m), abs=0.1)
    assert b.region_area_m2 == pytest.approx(a.region_area_m2, rel=0.05)


def test_rotation_of_the_walk():
    obs, _ = simulate(np.random.default_rng(21), "square")
    c, s = np.cos(0.7), np.sin(0.7)
    a, b = locate(obs), locate(replace(obs, x_m=c * obs.x_m - s * obs.y_m, y_m=s * obs.x_m + c * obs.y_m))
    off = np.hypot(b.x_m - (c * a.x_m - s * a.y_m), b.y_m - (s * a.x_m + c * a.y_m))
    assert off < 0.25 * a.r95_m
    assert b.region_area_m2 == pytest.approx(a.region_area_m2, rel=0.25)


def test_constant_added_to_all_levels():
    obs, _ = simulate(np.random.default_rng(22), "square")
    wide = Prior(p0_sigma_db=300.0)
    a, b = locate(obs, wide), locate(replace(obs, level_dbm=obs.level_dbm + 20.0), wide)
    assert (b.x_m, b.y_m) == pytest.approx((a.x_m, a.y_m), abs=0.5)
    assert b.p0_dbm - a.p0_dbm == pytest.approx(20.0, abs=0.2)
    assert b.eta == pytest.approx(a.eta, abs=0.02)


def test_order_of_the_readings_does_not_matter():
    rng = np.random.default_rng(23)
    obs, _ = simulate(rng, "L")
    order = rng.permutation(len(obs))
    a = locate(obs)
    b = locate(replace(obs, x_m=obs.x_m[order], y_m=obs.y_m[order], level_dbm=obs.level_dbm[order]))
    assert (b.x_m, b.y_m, b.r95_m) == pytest.approx((a.x_m, a.y_m, a.r95_m), abs=0.01)


# --- what is told ---


def test_numbers_of_a_clear_case():
    obs, source = simulate(np.random.default_rng(24), "square", white_db=2.0)
    found = locate(obs)
    assert verdict(found, obs)[0] == "located"
    assert np.hypot(found.x_m - source[0], found.y_m - source[1]) < 1.5 * found.r95_m
    assert found.cells.probability.sum() == pytest.approx(1.0)
    assert found.sigma_db == pytest.approx(2.0, abs=0.4)
    assert found.drms_m < found.r95_m < 3.0 * found.drms_m
    assert found.eta + 3 * found.eta_sigma > 2.3
    assert found.eta - 3 * found.eta_sigma < 3.9
    assert not found.at_limit
    assert found.modes[0].ellipse.semi_major_m == pytest.approx(found.r95_m, rel=0.5)
    assert np.all(np.linalg.eigvalsh(found.modes[0].covariance) > 0.0)


def test_two_places_are_named():
    obs, _ = simulate(np.random.default_rng(25), "straight", white_db=2.0)
    told, reasons = verdict(locate(obs), obs)
    assert told == "ambiguous"
    assert reasons[0].count("50% at ") == 2


def test_a_transmitter_far_away_is_not_located():
    x, y = path("L")
    rng = np.random.default_rng(26)
    obs = observations(x, y, -95.0 + 4.0 * rng.normal(size=len(x)))
    assert verdict(locate(obs), obs)[0] == "cannot tell"


RNG = np.random.default_rng(27)
STILL = np.zeros(100_000)


@pytest.mark.parametrize(
    "obs",
    [
        observations([5.0], [5.0], [-70.0]),
        observations([0.0, 8.0], [0.0, 1.0], [-70.0, -71.0]),
        observations(STILL[:500], STILL[:500], RNG.normal(-80, 5, 500)),
        observations(STILL, STILL, RNG.normal(-80, 5, 100_000), 4.0),
        observations(*RNG.normal(0, 4, (2, 100_000)), RNG.normal(-80, 5, 100_000), 4.0),
        observations(np.arange(300) * 2.0, STILL[:300], np.full(300, -80.0)),
        observations(STILL[:40], STILL[:40], np.full(40, -80.0)),
        observations(np.arange(6) * 20.0, STILL[:6], [-80, -75, -70, -75, -80, -85]),
    ],
    ids=["one", "two", "still", "1e5 still", "1e5 trembling", "same level", "all the same", "six"],
)
def test_too_little_to_tell(obs):
    found = locate(obs)
    told, reasons = verdict(found, obs)
    assert told == "cannot tell"
    assert reasons
    assert found.modes
    assert np.all(np.isfinite([found.r95_m, found.drms_m, found.p0_dbm, found.eta, found.sigma_db]))
    assert found.r95_m > 50.0


def test_no_reading_at_all():
    with pytest.raises(EstimationError, match="no reading"):
        locate(observations([], [], []))


# --- measured walks ---


@pytest.mark.slow
def test_measured_walks(traces):
    """Of every tenth measured walk the region, widened by 10 m, holds the surveyed transmitter."""
    import csv
    import json

    rows = list(csv.DictReader((traces / "reference.csv").read_text().splitlines()))[::10]
    held = []
    for row in rows:
        truth = json.loads((traces / row["dataset"] / "truth.json").read_text())
        info = truth["traces"][row["trace"]]
        source = truth["transmitters"][info["tx"]]
        table = np.genfromtxt(traces / row["dataset"] / info["file"], delimiter=",", names=True, usecols=(1, 2, 3))
        utm = Utm.at(source["lat"], source["lon"])
        x, y = utm.to_xy_arrays(table["lat"], table["lon"])
        found = locate(observations(x, y, table["rssi_dbm"], 4.0))
        held.append(covered(found, utm.to_xy(source["lat"], source["lon"]), 10.0))
    assert np.mean(held) > 0.8
