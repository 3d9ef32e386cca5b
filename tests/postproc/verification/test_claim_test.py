import numpy as np
import pytest

from logger.core.model.blocks import blocks
from logger.core.model.columns import distances_db, varying_columns
from logger.core.model.noise import covariances, whiteners_of
from logger.core.model.prior import Hypothesis, Prior, Station
from logger.core.places import Places
from postproc.verification.claim_test import (
    BEARINGS_DEG,
    around,
    calibrate,
    claim_test,
    prepare_walk,
)
from postproc.verification.claims import Claim
from postproc.verification.likelihood_grid import likelihood_grid
from postproc.verification.run_claims import ClaimOptions, benjamini_hochberg, verify_cell
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import observations, path, simulate

PRIOR = Prior(noise=noise_groups(Hypothesis(0.1, 15.0), Hypothesis(0.1, 60.0)))


def walk_of(seed, shape="square", prior=PRIOR, **noise):
    obs, source = simulate(np.random.default_rng(seed), shape, **noise)
    return prepare_walk(blocks(obs, 40), prior), np.array(source)


@pytest.mark.parametrize("antenna_db", [0.0, 6.0])
def test_grid_has_the_density_of_its_model_in_one_piece(antenna_db):
    pattern_db = (antenna_db,) if antenna_db else ()
    prior = PRIOR.of_station(Station(1.0, PRIOR.height_m, pattern_db))
    walk, source = walk_of(1)
    places = np.array([[source[0], 300.0, -900.0], [source[1], -50.0, 700.0], [1.0, 1.0, 1.0]])
    covariance = covariances(walk.blocks, PRIOR)
    field = likelihood_grid(walk.blocks, prior, places, whiteners_of(covariance))
    log_p, variance = field.evaluate(walk.level_dbm[:, None])
    k = (PRIOR.eta_sigma / PRIOR.sigma_db) ** 2
    n = len(walk.blocks)
    for c in range(len(PRIOR.hypotheses)):
        for h in range(3):
            d = distances_db(
                walk.blocks, PRIOR.height_m, Places.of(places[0, h : h + 1], places[1, h : h + 1])
            )[:, 0]
            columns = varying_columns(
                walk.blocks, prior, Places.of(places[0, h : h + 1], places[1, h : h + 1])
            )
            pattern = sum((column @ column.T for column in columns[1:]), np.zeros((n, n)))
            shape = (
                covariance[c]
                + k * np.outer(d, d)
                + 1e7
                + (antenna_db / PRIOR.sigma_db) ** 2 * pattern
            )
            off = walk.level_dbm + PRIOR.eta * d
            misfit = off @ np.linalg.solve(shape, off)
            total = 1.7 * PRIOR.sigma_db**2 + 0.5 * misfit
            assert variance[c, h, 0] == pytest.approx(total / (0.7 + 0.5 * (n - 1)), rel=1e-4)
            wanted = -0.5 * np.linalg.slogdet(shape)[1] - (1.7 + 0.5 * (n - 1)) * np.log(total)
            if (c, h) == (0, 0):
                constant = log_p[0, 0, 0] - wanted
            assert log_p[c, h, 0] - wanted == pytest.approx(constant, abs=1e-2)


def test_antenna_is_no_displacement_to_a_measured_walk():
    """Levels bent from end to end look like those of another place."""
    rng = np.random.default_rng(4)
    stationary, measured, far = [], [], []
    for seed in range(6):
        obs, source = simulate(
            np.random.default_rng(300 + seed), ("square", "L")[seed % 2], white_db=2.0
        )
        off = np.array([obs.x_m, obs.y_m]).T - source
        sent_db = 9.0 * np.cos(np.arctan2(off[:, 1], off[:, 0]) - seed)
        walk = prepare_walk(
            blocks(observations(obs.x_m, obs.y_m, obs.level_dbm + sent_db), 40), PRIOR
        )
        level = walk.level_dbm[:, None]
        test = claim_test(walk, np.array(source)[:, None], rng)
        stationary.append(test.p_values(level, trusting=True)[0])
        measured.append(test.p_values(level, trusting=False)[0])
        assert measured[-1] >= test.tails(level, trusting=False)[0]
        away = claim_test(
            walk, (source + 900.0 * np.array([np.cos(seed), np.sin(seed)]))[:, None], rng
        )
        far.append(away.p_values(level, trusting=False)[0])
    assert np.mean(np.array(stationary) < 0.05) > 0.6
    assert np.mean(np.array(measured) < 0.05) < 0.25
    assert np.mean(np.array(far) < 0.05) > 0.6


def test_position_error_makes_near_blocks_count_less():
    obs, source = simulate(np.random.default_rng(2), "L")
    at = np.array([[source[0]], [source[1]], [1.0]])
    walks = (blocks(observations(obs.x_m, obs.y_m, obs.level_dbm, s), 40) for s in (0.0, 15.0))
    sure, unsure = (
        likelihood_grid(walk, PRIOR, at, whiteners_of(covariances(walk, PRIOR))) for walk in walks
    )
    level = (sure.blocks.level_dbm - sure.blocks.level_dbm.mean())[:, None]
    assert unsure.evaluate(level)[1][0, 0, 0] < sure.evaluate(level)[1][0, 0, 0]


def test_true_claims_pass_and_false_ones_fail_at_their_rate():
    rng = np.random.default_rng(5)
    true, far = [], []
    for seed in range(14):
        walk, source = walk_of(100 + seed, ("square", "L")[seed % 2], white_db=2.0)
        for found, claim in (
            (true, source),
            (far, source + 600.0 * np.array([np.cos(seed), np.sin(seed)])),
        ):
            test = claim_test(walk, claim[:, None], rng)
            level = walk.level_dbm[:, None]
            found.append(test.p_values(level, trusting=True)[0])
    true, far = np.array(true), np.array(far)
    assert np.mean(true < 0.05) < 0.25
    assert np.mean(true > 0.3) > 0.3
    assert np.mean(far < 0.05) > 0.6


def test_white_noise_is_known_for_white():
    """The sharper the peak the finer the places it takes to see it: what is left is shadowing that
    nobody had.
    """
    for seed, shape in enumerate(("square", "L", "random", "L")):
        walk, _ = walk_of(200 + seed, shape, Prior())
        assert np.count_nonzero(walk.noise.root) == len(walk.blocks)
        assert walk.noise.mean_sigma_db == pytest.approx(3.0, rel=0.3)


def test_shadowing_that_lasts_alarms_no_more_often():
    for seed in (31, 32):
        walk, source = walk_of(seed, shadow_db=6.0, d_c=60.0, white_db=1.0)
        rng = np.random.default_rng(1)
        test = claim_test(walk, source[:, None], rng)
        rate = test.power(Places.of(*source[:, None]), 0.1, 600, rng, trusting=True)
        assert 0.05 < rate[0] < 0.16


def test_power_is_what_drawn_walks_are_rejected_at():
    walk, source = walk_of(3, white_db=2.0)
    rng = np.random.default_rng(1)
    test = claim_test(walk, source[:, None], rng)
    alarms = test.power(Places.of(*source[:, None]), 0.1, 400, rng, trusting=True)
    assert 0.04 < alarms[0] < 0.17
    seen = test.detectable(0.05, rng, trusting=True)
    assert [one.azimuth_deg for one in seen] == list(BEARINGS_DEG)
    for one in seen[::3]:
        if one.indirect_m is not None:
            angle = np.radians(one.azimuth_deg)
            place = source + 2.0 * one.indirect_m * np.array([np.sin(angle), np.cos(angle)])
            beyond = test.power(Places.of(*place[:, None]), 0.05, 100, rng, trusting=True)[0]
            assert beyond > 0.8 or one.indirect_blind_m is not None


def test_mirror_image_of_a_straight_walk_is_not_noticed():
    obs, source = simulate(np.random.default_rng(8), "straight", white_db=1.0)
    walk = prepare_walk(blocks(obs, 40), PRIOR)
    rng = np.random.default_rng(2)
    level = walk.level_dbm[:, None]
    mirror = claim_test(walk, np.array([[source[0]], [-source[1]]]), rng)
    assert mirror.p_values(level, trusting=True)[0] > 0.02
    beside = claim_test(walk, np.array([[source[0] + 400.0], [source[1]]]), rng)
    assert beside.p_values(level, trusting=True)[0] < 0.05


def test_uncertainty_of_the_claim_is_as_good_as_distance():
    walk, source = walk_of(4, white_db=1.5)
    level, off = walk.level_dbm[:, None], source + np.array([150.0, 120.0])
    sharp, soft = (
        claim_test(walk, around(Places.of(*off), sigma), np.random.default_rng(1))
        for sigma in (0.0, 200.0)
    )
    assert soft.p_values(level, trusting=True)[0] > sharp.p_values(level, trusting=True)[0]
    places = around(Places.of(10.0, -20.0), 50.0)
    assert np.mean(places, axis=1) == pytest.approx([10.0, -20.0])
    assert np.std(places, axis=1) == pytest.approx([50.0, 50.0], rel=0.1)


def test_claim_has_no_hole_that_a_place_falls_into():
    places = around(Places.of(0.0, 0.0), 100.0)
    x, y = (v.ravel() for v in np.meshgrid(*[np.arange(-100.0, 101.0, 5.0)] * 2))
    apart = np.hypot(*(v[:, None] - own for v, own in zip((x, y), places, strict=True)))
    assert np.max(np.min(apart, axis=1)[np.hypot(x, y) < 100.0]) < 17.0


def test_calibration_is_a_rank_and_goes_on_below_the_least():
    calm = np.sort(np.random.default_rng(1).uniform(size=400))
    p = calibrate(calm, np.array([0.0, 1e-4, 0.01, 0.3, 1.0]))
    assert np.all(np.diff(p) > 0)
    assert p[3] == pytest.approx(0.3, abs=0.08)
    assert 1e-5 < p[1] < 1e-3


def test_benjamini_hochberg():
    q = benjamini_hochberg(np.array([0.01, 0.04, 0.03, 0.9]))
    assert q == pytest.approx([0.04, 0.16 / 3, 0.16 / 3, 0.9])
    assert len(benjamini_hochberg(np.zeros(0))) == 0


def test_walks_that_cannot_tell_say_why():
    claim, rng = Claim("c", 0.0, 9.0, 0.0, "test"), np.random.default_rng(0)
    x, y = path("straight", 8)
    options = ClaimOptions(0.05, PRIOR)
    few = verify_cell(observations(x, y, -60.0 - 3.0 * np.arange(8)), claim, options, rng)
    assert few.verdict == "cannot tell"
    assert "locations with a level" in few.reasons[0]
    standing = observations(np.zeros(50), np.zeros(50), np.full(50, -60.0))
    still = verify_cell(standing, claim, options, rng)
    assert still.verdict == "cannot tell"


def test_residuals_at_the_true_place_are_white():
    walk, source = walk_of(9, prior=Prior(), white_db=3.0)
    at, away = (
        claim_test(walk, place[:, None], np.random.default_rng(1)).residuals()
        for place in (source, source + 700.0)
    )
    assert np.std(at) == pytest.approx(3.0, rel=0.3)
    assert np.std(away) > np.std(at)
