from dataclasses import replace

import numpy as np
from scipy.stats import norm

from postproc.estimators.least_squares import Search
from postproc.estimators.least_squares_rows import each_reading, group
from tests.kit.bent_walk import SOURCE, walk


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


def test_deviation_at_a_limit_has_the_returned_derivative():
    obs = walk(np.random.default_rng(4), noise_db=6.0, count=60)
    rows = each_reading(replace(obs, known_limit=np.arange(60) % 3 - 1), 0.0)
    search, step = Search(rows, "linear", 4.0), np.array([0.0, 0.0, 1e-5, 0.0])
    deviation, rate = search.deviation(SOURCE)
    ahead, behind = (search.deviation(SOURCE + side * step)[0] for side in (1, -1))
    np.testing.assert_allclose(rate, (ahead - behind) / 2e-5, rtol=1e-5, atol=1e-7)
    # the deviation is the root of the log-likelihood that a level lies beyond the limit
    model = each_reading(obs, 0.0).residuals(SOURCE) + obs.level_dbm
    hidden = np.where(
        rows.limit < 0,
        norm.logcdf(obs.level_dbm, model, 4.0),
        norm.logsf(obs.level_dbm, model, 4.0),
    )
    np.testing.assert_allclose(
        (deviation**2 / 32.0)[rows.limit != 0], -hidden[rows.limit != 0], rtol=1e-6
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
