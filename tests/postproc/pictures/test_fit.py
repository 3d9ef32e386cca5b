from dataclasses import replace

import numpy as np
import pytest

from postproc.pictures.picture import fit_of
from tests.kit import sample_results as kit


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("fit") / "walk.journal", seconds=120, cells=2)
    return kit.sample_result(run).cells[0]


def test_level_is_model_plus_residual(cell):
    fit = fit_of(cell)
    assert len(fit.level_dbm) == len(cell.obs)
    np.testing.assert_allclose(fit.model_dbm(fit.distance_m) + fit.residual_db, fit.level_dbm)
    assert (fit.p0_dbm, fit.eta) == (kit.P0_DBM, kit.ETA)
    assert fit.sigma_db == pytest.approx(np.std(fit.residual_db))


def test_distance_is_that_of_the_antenna(cell):
    state, height_m = cell.posterior.modes[0].state, cell.posterior.prior.height_m
    squared_m2 = (cell.obs.x_m - state[0]) ** 2 + (cell.obs.y_m - state[1]) ** 2 + height_m**2
    squared_m2 += 2.0 * cell.obs.position_sigma_m**2  # the expected square of the distance
    np.testing.assert_allclose(fit_of(cell).distance_m, np.sqrt(squared_m2))


def test_a_censored_reading_has_no_residual(cell):
    limit = np.zeros(len(cell.obs), np.int64)
    limit[:7] = -1
    fit = fit_of(replace(cell, obs=replace(cell.obs, known_limit=limit)))
    assert np.count_nonzero(~fit.uncensored) == 7
    assert np.all(np.isnan(fit.residual_db[:7]))
    assert np.isfinite(fit.sigma_db)


def test_without_a_position_there_is_no_fit(cell):
    assert fit_of(replace(cell, posterior=None)) is None
