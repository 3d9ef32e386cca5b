from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from scipy.stats import norm

from logger.core.errors import EstimationError
from logger.core.geo import Utm
from logger.core.observations import CellObservations
from postproc.estimators import least_squares, least_squares_covariance
from postproc.estimators.least_squares_rows import each_reading, group
from postproc.estimators.least_squares_search import Search

SOURCE = np.array([60.0, 90.0, -30.0, 3.0])


def walk(
    rng, *, noise_db=3.0, count=400, shadow_m=0.0, straight=False, source=SOURCE, height_m=0.0
):
    """An L-shaped or straight walk of 2 m steps past a source; noise white or decorrelating over
    `shadow_m`.
    """
    s = 2.0 * np.arange(count)
    x = s - count if straight else np.minimum(s, count)
    y = 0.0 * s if straight else np.maximum(s - count, 0.0)
    noise = rng.normal(size=count)
    kept = np.exp(-2.0 / shadow_m) if shadow_m else 0.0
    for k in range(1, count):
        noise[k] = kept * noise[k - 1] + np.sqrt(1.0 - kept**2) * noise[k]
    distance = np.sqrt((x - source[0]) ** 2 + (y - source[1]) ** 2 + height_m**2)
    level = source[2] - 10.0 * source[3] * np.log10(distance) + noise_db * noise
    at = np.arange(count)
    return CellObservations("c", None, Utm(32), at * 10**9, x, y, np.zeros(count), level, at)


def nees(fit, source=SOURCE):
    error = (fit.state - source)[:2]
    return float(error @ np.linalg.solve(fit.covariance[:2, :2], error))


# --- the minimum ---


def test_linear_part_agrees_with_dense_least_squares():
    obs = walk(np.random.default_rng(1), count=50)
    rows = group(obs, 5.0, robust=False)
    loss_db = rows.log_distance_db(40.0, 70.0)
    root = np.sqrt(rows.weight)
    expected, *_ = scipy.linalg.lstsq(
        root[:, None] * np.column_stack([np.ones(50), -loss_db]), root * obs.level_dbm
    )
    np.testing.assert_allclose(rows.best_at(40.0, 70.0), [40.0, 70.0, *expected], rtol=1e-9)


@pytest.mark.parametrize("height_m", [0.0, 25.0])
def test_jacobian_agrees_with_central_differences(height_m):
    obs = walk(np.random.default_rng(2))
    step = 1e-4
    numeric = [
        (
            least_squares.residuals(SOURCE + d, obs, height_m)
            - least_squares.residuals(SOURCE - d, obs, height_m)
        )
        / (2 * step)
        for d in step * np.eye(4)
    ]
    np.testing.assert_allclose(
        least_squares.jacobian(SOURCE, obs, height_m),
        np.column_stack(numeric),
        rtol=1e-6,
        atol=1e-8,
    )


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy"])
@pytest.mark.parametrize("height_m", [0.0, 20.0])
def test_finds_the_minimum_scipy_finds(loss, height_m):
    obs = walk(np.random.default_rng(3))
    fit = least_squares.fit(obs, [(40.0, 70.0), (300.0, 300.0)], loss=loss, height_m=height_m)
    expected = scipy.optimize.least_squares(
        lambda s: least_squares.residuals(s, obs, height_m),
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


def test_gradient_by_kaufman_is_that_of_the_projected_misfit():
    obs = walk(np.random.default_rng(4))
    search = Search(group(obs, 0.0, robust=False), "linear", 3.0)
    misfit, slope = search.projection()
    place, step = np.array([100.0, 40.0]), 1e-3
    numeric = [
        (np.sum(misfit(place + d) ** 2) - np.sum(misfit(place - d) ** 2)) / (4 * step)
        for d in step * np.eye(2)
    ]
    np.testing.assert_allclose(slope(place).T @ misfit(place), numeric, rtol=1e-6)


def test_deviation_at_a_limit_has_the_derivative_it_says():
    obs = walk(np.random.default_rng(4), noise_db=6.0, count=60)
    rows = each_reading(replace(obs, known_limit=np.arange(60) % 3 - 1), 0.0)
    search, step = Search(rows, "linear", 4.0), np.array([0.0, 0.0, 1e-5, 0.0])
    deviation, rate = search.deviation(SOURCE)
    ahead, behind = (search.deviation(SOURCE + side * step)[0] for side in (1, -1))
    np.testing.assert_allclose(rate, (ahead - behind) / 2e-5, rtol=1e-5, atol=1e-7)
    # the deviation is the root of the log-likelihood that a level lies beyond the limit
    model = least_squares.residuals(SOURCE, obs) + obs.level_dbm
    hidden = np.where(
        rows.limit < 0,
        norm.logcdf(obs.level_dbm, model, 4.0),
        norm.logsf(obs.level_dbm, model, 4.0),
    )
    np.testing.assert_allclose(
        (deviation**2 / 32.0)[rows.limit != 0], -hidden[rows.limit != 0], rtol=1e-9
    )


def test_deviation_at_a_limit_stays_finite_far_away():
    """Where a search goes astray: warnings are errors here."""
    obs = walk(np.random.default_rng(3), count=40)
    obs = replace(
        obs,
        level_dbm=np.maximum(obs.level_dbm, -80.0),
        rat="GSM",
        known_limit=-1 * (obs.level_dbm < -80.0),
    )
    search = Search(group(obs, 0.0, robust=False), "linear", 3.0)
    for p0_dbm in (-1e12, -1e11, 1e11, 1e12):
        assert all(
            np.all(np.isfinite(v)) for v in search.deviation(np.array([0.0, 0.0, p0_dbm, 3.0]))
        )


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
def test_robust_losses_withstand_outliers(loss):
    rng = np.random.default_rng(5)
    obs = walk(rng)
    level = obs.level_dbm.copy()
    level[rng.choice(len(obs), 40, replace=False)] += 25.0
    obs = replace(obs, level_dbm=level)
    fit, plain = (
        least_squares.fit(obs, [(40.0, 70.0)], loss=loss),
        least_squares.fit(obs, [(40.0, 70.0)]),
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
    known, unknown = (least_squares.fit(obs, [(90.0, 20.0)], height_m=h) for h in (30.0, 0.0))
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
        arrays = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
        dropped = replace(
            clipped, rat="LTE", **{name: getattr(clipped, name)[lone] for name in arrays}
        )
        fits = [least_squares.fit(one, [(60.0, 90.0)]) for one in (limited, dropped, obs)]
        errors.append([abs(fit.state[3] - 3.0) for fit in fits] + [nees(fits[0])])
    used, left_out, nothing_hidden, chi2 = np.median(errors, axis=0)
    assert used < 0.6 * left_out
    assert used < 2.0 * nothing_hidden
    assert chi2 < 4.0


# --- the covariance ---


@pytest.mark.parametrize("loss", ["linear", "cauchy"])
@pytest.mark.parametrize("shadow_m", [0.0, 10.0])
def test_covariance_is_true(shadow_m, loss):
    rng = np.random.default_rng(7)
    fits = [
        least_squares.fit(walk(rng, noise_db=1.5, shadow_m=shadow_m), [(60.0, 90.0)], loss=loss)
        for _ in range(24)
    ]
    chi2 = np.array([nees(fit) for fit in fits])
    assert np.mean(chi2 < 5.991) >= 0.9
    assert np.mean(chi2) > 0.3  # and is not cautious beyond reason
    # independent residuals would make it this much smaller
    inflation = np.median([fit.inflation for fit in fits])
    assert 0.8 < inflation < 1.3 if shadow_m == 0.0 else inflation > 5.0


def test_an_axis_is_stretched_to_where_the_misfit_has_risen():
    obs = walk(
        np.random.default_rng(16),
        count=120,
        straight=True,
        source=np.array([30.0, 120.0, -30.0, 3.0]),
    )
    fit = least_squares.fit(obs, [(30.0, 120.0)])
    rows = Search(group(obs, 0.0, robust=False), "linear", 3.0).linearised(fit.state)

    def end_m(begin_m, rise):
        return least_squares_covariance.end_m(rows, fit.state, np.array([0.0, 1.0]), begin_m, rise)

    def risen(away_m):
        lowest, there = (
            least_squares_covariance.profile_misfit(rows, fit.state[0], fit.state[1] + d)
            for d in (0.0, away_m)
        )
        return there - lowest

    for rise in (4.0, 10.0):
        assert risen(end_m(2.0, rise)) >= rise > risen(end_m(2.0, rise) / 1.2)
    assert end_m(400.0, 1.0) == 400.0
    assert end_m(2.0, 1e6) == least_squares_covariance.REACH_M


def test_readings_of_one_place_do_not_outweigh_the_walk():
    obs = walk(np.random.default_rng(8), shadow_m=10.0)
    again = np.concatenate([np.arange(len(obs)), np.full(900, 120)])
    arrays = ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
    long = replace(obs, **{name: getattr(obs, name)[again] for name in arrays})
    short_fit, long_fit = (least_squares.fit(one, [(60.0, 90.0)]) for one in (obs, long))
    assert np.hypot(*(short_fit.state - long_fit.state)[:2]) < 10.0
    shrunk = np.linalg.det(long_fit.covariance[:2, :2]) / np.linalg.det(
        short_fit.covariance[:2, :2]
    )
    assert shrunk > 0.25


@pytest.mark.parametrize("loss", ["linear", "huber"])
def test_a_million_readings(loss):
    rng = np.random.default_rng(9)
    count = 1_000_000
    s = np.linspace(0.0, 800.0, count)
    x, y = np.minimum(s, 400.0), np.maximum(s - 400.0, 0.0)
    level = (
        SOURCE[2]
        - 10.0 * SOURCE[3] * np.log10(np.hypot(x - SOURCE[0], y - SOURCE[1]))
        + 3.0 * rng.normal(size=count)
    )
    at = np.arange(count)
    obs = CellObservations("c", None, Utm(32), at, x, y, np.zeros(count), level, at)
    fit = least_squares.fit(obs, [(40.0, 70.0), (300.0, 300.0)], loss=loss)
    assert fit.n == count
    assert nees(fit) < 9.2
    assert fit.sigma_db == pytest.approx(3.0, abs=0.05)
    assert np.hypot(*(fit.state - SOURCE)[:2]) < 2.0


# --- what least squares cannot say ---


def test_mirror_image_is_a_rival():
    obs = walk(np.random.default_rng(10), straight=True)
    fit = least_squares.fit(obs, [(60.0, 80.0), (60.0, -80.0), (50.0, 85.0)])
    assert len(fit.rivals) == 1
    assert fit.rivals[0][1] == pytest.approx(-fit.state[1], abs=0.1)


def test_a_source_far_off_a_short_walk_is_not_bounded():
    obs = walk(
        np.random.default_rng(11),
        count=40,
        straight=True,
        source=np.array([60.0, 900.0, -30.0, 3.0]),
    )
    fit = least_squares.fit(obs, [(60.0, 900.0)])
    assert not fit.bounded
    assert np.sqrt(np.linalg.eigvalsh(fit.covariance[:2, :2])[-1]) > 1000.0


def test_what_is_not_observed_is_uncertain():
    obs = walk(np.random.default_rng(12))
    still = replace(obs, x_m=np.zeros(len(obs)), y_m=np.zeros(len(obs)))
    fit = least_squares.fit(still, [(50.0, 0.0)])
    assert np.sqrt(fit.covariance[0, 0]) > 1000.0
    assert not fit.bounded


def test_levels_that_rise_with_the_distance_are_no_fit():
    obs = walk(np.random.default_rng(13), source=np.array([60.0, 90.0, -130.0, -2.0]))
    assert not least_squares.fit(obs, [(60.0, 90.0)]).converged


def test_too_few_readings():
    with pytest.raises(EstimationError, match="at least 5"):
        least_squares.fit(walk(np.random.default_rng(14), count=4), [(0.0, 0.0)])


def test_too_few_readings_within_the_limits():
    obs = replace(walk(np.random.default_rng(15), count=40), rat="GSM")
    level = np.full(40, -110.0)
    level[:4] = [-100.0, -90.0, -95.0, -105.0]
    with pytest.raises(EstimationError, match="4 readings"):
        least_squares.fit(replace(obs, level_dbm=level), [(0.0, 0.0)])
