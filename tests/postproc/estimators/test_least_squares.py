from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

from logger.core.errors import EstimationError
from logger.core.places import Places
from postproc.estimators import least_squares
from postproc.estimators.least_squares_rows import each_reading
from tests.kit.bent_walk import SOURCE, nees, walk


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy"])
@pytest.mark.parametrize("height_m", [0.0, 20.0])
def test_finds_the_minimum_scipy_finds(loss, height_m):
    obs = walk(np.random.default_rng(3))
    fit = least_squares.fit(
        obs, Places.of([40.0, 300.0], [70.0, 300.0]), loss=loss, height_m=height_m
    )
    expected = scipy.optimize.least_squares(
        lambda s: each_reading(obs, height_m).residuals(s),
        SOURCE,
        x_scale=(10, 10, 3, 0.3),
        xtol=1e-12,
        loss=loss,
        f_scale=fit.sigma_db,
    )
    assert fit.converged
    # the scale of a robust loss follows a first fit and differs a little
    rtol = 1e-4 if loss == "linear" else 0.02
    np.testing.assert_allclose(fit.state, expected.x, rtol=rtol)
    assert loss != "linear" or fit.cost == pytest.approx(expected.cost, rel=1e-9)
    assert fit.sigma_db == pytest.approx(3.0, abs=0.4)
    assert fit.bounded


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
def test_robust_losses_withstand_outliers(loss):
    rng = np.random.default_rng(5)
    obs = walk(rng)
    level = obs.level_dbm.copy()
    level[rng.choice(len(obs), 40, replace=False)] += 25.0
    obs = replace(obs, level_dbm=level)
    fit, plain = (
        least_squares.fit(obs, Places.of(40.0, 70.0), loss=loss),
        least_squares.fit(obs, Places.of(40.0, 70.0)),
    )
    assert np.hypot(*(fit.state[:2] - SOURCE[:2])) < 30.0
    assert nees(fit) < 9.2
    assert np.linalg.det(fit.covariance[:2, :2]) < 0.5 * np.linalg.det(plain.covariance[:2, :2])


def test_height_of_the_antenna_is_an_argument():
    obs = walk(
        np.random.default_rng(6),
        noise_db=0.5,
        source=np.array([100.0, 8.0, -30.0, 3.0]),
        height_m=30.0,
    )
    known, unknown = (
        least_squares.fit(obs, Places.of(90.0, 20.0), height_m=h) for h in (30.0, 0.0)
    )
    errors_m = [np.hypot(*(fit.state[:2] - [100.0, 8.0])) for fit in (known, unknown)]
    assert errors_m[0] < 15.0 < errors_m[1]
    assert known.cost < 0.9 * unknown.cost
    assert known.state[3] == pytest.approx(3.0, abs=0.2)


def test_what_the_floor_hides_is_not_taken_for_a_level():
    errors = []
    for seed in range(8):
        obs = walk(np.random.default_rng(seed), source=np.array([60.0, 90.0, -36.0, 3.0]))
        clipped = replace(obs, level_dbm=np.maximum(np.round(obs.level_dbm), -110.0))
        limited = replace(clipped, rat="GSM")
        assert 0.2 < np.mean(limited.limit == -1) < 0.6
        lone = np.flatnonzero(limited.limit == 0)
        dropped = replace(clipped.part(lone), rat="LTE", known_limit=None)
        fits = [least_squares.fit(one, Places.of(60.0, 90.0)) for one in (limited, dropped, obs)]
        errors.append([abs(fit.state[3] - 3.0) for fit in fits] + [nees(fits[0])])
    used, left_out, nothing_hidden, chi2 = np.median(errors, axis=0)
    assert used < 0.6 * left_out
    assert used < 2.0 * nothing_hidden
    assert chi2 < 4.0


def test_mirror_image_is_a_rival():
    obs = walk(np.random.default_rng(10), straight=True)
    fit = least_squares.fit(obs, Places.of([60.0, 60.0, 50.0], [80.0, -80.0, 85.0]))
    assert len(fit.rivals) == 1
    assert fit.rivals[0][1] == pytest.approx(-fit.state[1], abs=0.1)


def test_levels_that_rise_with_the_distance_are_no_fit():
    obs = walk(np.random.default_rng(13), source=np.array([60.0, 90.0, -130.0, -2.0]))
    assert not least_squares.fit(obs, Places.of(60.0, 90.0)).converged


def test_too_few_readings():
    with pytest.raises(EstimationError, match="at least 5"):
        least_squares.fit(walk(np.random.default_rng(14), count=4), Places.of(0.0, 0.0))


def test_too_few_readings_within_the_limits():
    obs = replace(walk(np.random.default_rng(15), count=40), rat="GSM")
    level = np.full(40, -110.0)
    level[:4] = [-100.0, -90.0, -95.0, -105.0]
    with pytest.raises(EstimationError, match="4 readings"):
        least_squares.fit(replace(obs, level_dbm=level), Places.of(0.0, 0.0))
