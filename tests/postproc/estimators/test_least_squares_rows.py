from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from logger.core.places import Places, Utm
from logger.core.readings import Readings
from postproc.estimators import least_squares
from postproc.estimators.least_squares_rows import each_reading, group
from tests.kit.bent_walk import SOURCE, nees, walk
from tests.kit.walks import with_places


def test_linear_part_agrees_with_dense_least_squares():
    obs = walk(np.random.default_rng(1), count=50)
    rows = group(obs, 5.0, robust=False)
    loss_db = rows.log_distance_db(np.array([40.0, 70.0]))
    root = np.sqrt(rows.weight)
    expected, *_ = scipy.linalg.lstsq(
        root[:, None] * np.column_stack([np.ones(50), -loss_db]), root * obs.level_dbm
    )
    np.testing.assert_allclose(
        rows.best_at(np.array([40.0, 70.0])), [40.0, 70.0, *expected], rtol=1e-9
    )


def test_rows_equally_far_away_determine_no_exponent():
    obs = walk(np.random.default_rng(1), count=50)
    rows = group(with_places(obs, x_m=np.full(50, 12.3), y_m=np.full(50, 4.5)), 5.0, robust=False)
    x_m, y_m, p0_dbm, eta = rows.best_at(np.array([40.0, 70.0]))
    assert (x_m, y_m, eta) == pytest.approx((40.0, 70.0, 0.0), abs=1e-9)
    assert p0_dbm == pytest.approx(np.average(rows.level_dbm, weights=rows.weight))


@pytest.mark.parametrize("height_m", [0.0, 25.0])
def test_jacobian_agrees_with_central_differences(height_m):
    obs = walk(np.random.default_rng(2))
    step = 1e-4
    numeric = [
        (
            each_reading(obs, height_m).residuals(SOURCE + d)
            - each_reading(obs, height_m).residuals(SOURCE - d)
        )
        / (2 * step)
        for d in step * np.eye(4)
    ]
    np.testing.assert_allclose(
        each_reading(obs, height_m).jacobian(SOURCE),
        np.column_stack(numeric),
        rtol=1e-6,
        atol=1e-8,
    )


def test_readings_of_one_point_do_not_outweigh_the_walk():
    obs = walk(np.random.default_rng(8), shadow_m=10.0)
    again = np.concatenate([np.arange(len(obs)), np.full(900, 120)])
    long = replace(obs.part(again), known_limit=None)
    short_fit, long_fit = (least_squares.fit(one, Places.of(60.0, 90.0)) for one in (obs, long))
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
    obs = Readings(
        "c", None, Places.of(x, y, utm=Utm(32), sigma_m=np.zeros(count), t_ns=at), level, at
    )
    fit = least_squares.fit(obs, Places.of([40.0, 300.0], [70.0, 300.0]), loss=loss)
    assert fit.n == count
    assert nees(fit) < 9.2
    assert fit.sigma_db == pytest.approx(3.0, abs=0.05)
    assert np.hypot(*(fit.state - SOURCE)[:2]) < 2.0
