import numpy as np
import pytest

from logger.core.model.blocks import blocks
from logger.core.model.columns import distances_db, varying_columns
from logger.core.model.noise import covariances, whiteners_of
from logger.core.model.prior import Hypothesis, Prior, Station
from logger.core.places import Places
from postproc.verification.run_sites import calibrate, likelihood_grid, prepare_walk
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import observations, simulate

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


def test_position_error_makes_near_blocks_count_less():
    obs, source = simulate(np.random.default_rng(2), "L")
    at = np.array([[source[0]], [source[1]], [1.0]])
    walks = (blocks(observations(obs.x_m, obs.y_m, obs.level_dbm, s), 40) for s in (0.0, 15.0))
    sure, unsure = (
        likelihood_grid(walk, PRIOR, at, whiteners_of(covariances(walk, PRIOR))) for walk in walks
    )
    level = (sure.blocks.level_dbm - sure.blocks.level_dbm.mean())[:, None]
    assert unsure.evaluate(level)[1][0, 0, 0] < sure.evaluate(level)[1][0, 0, 0]


def test_white_noise_is_known_for_white():
    """The sharper the peak the finer the places it takes to see it: what is left is shadowing that
    nobody had.
    """
    for seed, shape in enumerate(("square", "L", "random", "L")):
        walk, _ = walk_of(200 + seed, shape, Prior())
        assert np.count_nonzero(walk.root) == len(walk.blocks)
        assert walk.probability @ walk.sigma_db == pytest.approx(3.0, rel=0.3)


def test_calibration_is_a_rank_and_goes_on_below_the_least():
    calm = np.sort(np.random.default_rng(1).uniform(size=400))
    p = calibrate(calm, np.array([0.0, 1e-4, 0.01, 0.3, 1.0]))
    assert np.all(np.diff(p) > 0)
    assert p[3] == pytest.approx(0.3, abs=0.08)
    assert 1e-5 < p[1] < 1e-3
