from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.stats

from logger.core.errors import EstimationError
from logger.core.geo import Utm
from logger.core.observations import CellObservations
from postproc import posterior
from postproc.posterior import Prior, locate, verdict
from postproc.region import highest_density


def observations(x, y, level, position_sigma=0.0):
    at = np.arange(len(x))
    x, y, level = (np.asarray(v, float) for v in (x, y, level))
    return CellObservations("c", "gsm", Utm(32), at * 10**9, x, y, np.full(len(x), position_sigma), level, at)


def path(shape, count=600, step=1.4):
    """Positions of a walk, about 840 m long."""
    s = np.arange(count) * step
    length = count * step
    if shape == "straight":
        return s - length / 2, np.zeros(count)
    if shape == "L":
        return np.minimum(s, length / 2), np.maximum(s - length / 2, 0.0)
    if shape == "circle":
        radius = length / (2 * np.pi)
        return radius * np.cos(s / radius), radius * np.sin(s / radius)
    side = length / 4
    corner = [0, side, 2 * side, 3 * side, length]
    return np.interp(s, corner, [0, side, side, 0, 0]), np.interp(s, corner, [0, 0, side, side, 0])


def shadowing(rng, x, y, sigma_db, d_c):
    """First-order autoregressive along the path."""
    rho = np.exp(-np.hypot(np.diff(x), np.diff(y)) / d_c)
    s = rng.normal(size=len(x))
    for k, r in enumerate(rho, start=1):
        s[k] = r * s[k - 1] + np.sqrt(1 - r * r) * s[k]
    return sigma_db * s


def simulate(rng, shape, *, white_db=3.0, shadow_db=0.0, d_c=15.0, count=600, step=1.4):
    """Readings of a walk and the source, 25 to 200 m off one of its points and never closer."""
    x, y = path(shape, count, step)
    while True:
        k, bearing, away = rng.integers(count), rng.uniform(0, 2 * np.pi), rng.uniform(25, 200)
        source = x[k] + away * np.cos(bearing), y[k] + away * np.sin(bearing)
        distance = np.hypot(x - source[0], y - source[1])
        if distance.min() >= 25.0:
            break
    level = rng.uniform(-45, -15) - 10 * rng.uniform(2.3, 3.9) * np.log10(distance) + white_db * rng.normal(size=count)
    if shadow_db:
        level = np.round(level + shadowing(rng, x, y, shadow_db, d_c))
    return observations(x, y, level), source


def covered(found, point, slack_m=0.0):
    """Whether the 95 % region holds a point."""
    chosen = highest_density(found.cells)
    cells = found.cells
    reach = 0.5 * cells.size_m[chosen] + slack_m
    inside = (np.abs(cells.x_m[chosen] - point[0]) <= reach) & (np.abs(cells.y_m[chosen] - point[1]) <= reach)
    return bool(np.any(inside))


def nearest_mode_m(found, point):
    return min(np.hypot(m.x_m - point[0], m.y_m - point[1]) for m in found.modes)


# --- the closed form ---


def brute_force_log_p(track, prior, x, y):
    """Log of the integral over P0, eta and sigma, mean over the noise hypotheses, by quadrature."""
    distance_db = posterior.distances_db(track, prior.height_m, np.array([x]), np.array([y]))
    weight = posterior.receiver_weights(track, prior, distance_db)[:, 0]
    distance_db = distance_db[:, 0]
    middle = np.mean(distance_db)
    best, cofactor = np.polyfit(middle - distance_db, track.level_dbm, 1, cov="unscaled")
    spread = 9.0 * np.sqrt(np.diag(cofactor)) + [0.3, 3.0]
    log_sigma = np.linspace(np.log(1.0), np.log(20.0), 81)
    etas, levels = np.linspace(-1, 1, 161), np.linspace(-1, 1, 161)
    total = 0.0
    for noise in posterior.noises(track, prior):
        k = np.linalg.inv(noise.whitener) @ np.linalg.inv(noise.whitener).T / np.outer(weight, weight)
        inverse, (_, log_det) = np.linalg.inv(k), np.linalg.slogdet(k)
        inner = []
        for s in np.exp(log_sigma):
            eta = best[0] + 2.0 * s * spread[0] * etas
            at_middle = best[1] + 2.0 * s * spread[1] * levels
            p0 = at_middle[:, None] + eta * middle
            r = track.level_dbm - at_middle[:, None, None] - eta[None, :, None] * (middle - distance_db)
            log_p = -0.5 * np.einsum("abn,nm,abm->ab", r, inverse, r, optimize=True) / s**2
            log_p -= len(r[0, 0]) * np.log(s) + 0.5 * log_det
            log_p += scipy.stats.norm.logpdf(p0, prior.p0_dbm, prior.p0_sigma_db)
            log_p += scipy.stats.norm.logpdf(eta, prior.eta, prior.eta_sigma)
            over_eta = scipy.integrate.trapezoid(np.exp(log_p + 30.0), eta, axis=1)
            inner.append(scipy.integrate.trapezoid(over_eta, at_middle))
        density = scipy.stats.norm.pdf(log_sigma, np.log(prior.sigma_db), prior.sigma_log_sd)
        total += scipy.integrate.trapezoid(np.array(inner) * density, log_sigma)
    return np.log(total)


@pytest.mark.parametrize("position_sigma", [0.0, 5.0])
def test_closed_form_agrees_with_brute_force(position_sigma):
    rng = np.random.default_rng(1)
    x, y = np.arange(14) * 20.0, np.where(np.arange(14) < 7, 0.0, 60.0)
    obs = observations(x, y, -30 - 28 * np.log10(np.hypot(x - 90, y - 40)) + 4 * rng.normal(size=14), position_sigma)
    prior = Prior(decorrelation_m=(30.0,), white_shares=(0.3,))
    track = posterior.blocks(obs)
    xs, ys = np.array([90.0, 200.0, -400.0]), np.array([40.0, -50.0, 300.0])
    ours = posterior.evidence(track, posterior.noises(track, prior), prior, xs, ys).log_p
    brute = np.array([brute_force_log_p(track, prior, *p) for p in zip(xs, ys, strict=True)])
    np.testing.assert_allclose(ours - ours[0], brute - brute[0], atol=1e-6)


def test_p0_and_eta_given_the_position():
    rng = np.random.default_rng(2)
    obs, source = simulate(rng, "square")
    flat = Prior(p0_sigma_db=1e4, eta_sigma=1e3, decorrelation_m=(), white_shares=(), height_m=0.0)
    track = posterior.blocks(obs)
    at = np.array([source[0]]), np.array([source[1]])
    ours = posterior.evidence(track, posterior.noises(track, flat), flat, *at)
    distance_db = 10 * np.log10(np.hypot(track.block_x_m - source[0], track.block_y_m - source[1]))
    root = np.sqrt(1.0 / (1.0 / track.readings + 1.0 / 12.0 / flat.sigma_db**2))
    design = np.column_stack([np.ones_like(distance_db), -distance_db])
    expected = np.linalg.lstsq(root[:, None] * design, root * track.level_dbm, rcond=None)[0]
    np.testing.assert_allclose(ours.theta[:, 0], expected, rtol=2e-3)


# --- the walk in blocks ---


def test_blocks_are_bounded_and_keep_every_reading():
    rng = np.random.default_rng(3)
    x, y = np.cumsum(rng.normal(size=(2, 200_000)), axis=1)
    track = posterior.blocks(observations(x, y, rng.normal(-80, 5, 200_000)))
    assert len(track.readings) <= 300
    assert track.readings.sum() == 200_000


def test_walking_a_street_twice_adds_no_block():
    x = np.arange(100) * 3.0
    there = observations(x, 0 * x, -80 - x / 10)
    and_back = observations(np.append(x, x[::-1]), np.zeros(200), np.append(-80 - x / 10, -80 - x[::-1] / 10))
    assert len(posterior.blocks(and_back).readings) == len(posterior.blocks(there).readings)


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
    assert reasons[0].count(" at (") == 2


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
