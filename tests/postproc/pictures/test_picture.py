from dataclasses import replace

import numpy as np
import pytest

from logger.core.answer import place_of
from logger.core.locator.region import Squares
from logger.core.places import Places
from postproc.pictures.picture import (
    fit_of,
    focus_of,
    headline,
    mode_labels,
    picture_of,
    region_rings,
)
from postproc.pictures.survey import survey_of
from tests.kit import sample_results as kit


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("picture") / "walk.journal", seconds=120, cells=3)
    return kit.sample_result(run, places=2, verdict="ambiguous")


def test_focus_is_a_located_cell_before_one_with_more_readings(result):
    a, b, c = result.cells
    assert focus_of(result).cell == kit.cell_name(0)
    cells = (a, replace(b, verdict="located", n=9), replace(c, n=10_000))
    assert focus_of(replace(result, cells=cells)).cell == b.cell
    assert focus_of(replace(result, cells=())) is None


def test_headline_states_the_verdict_and_its_extent(result):
    cell = result.cells[0]
    located = headline(replace(cell, verdict="located"))
    assert located == "located: most likely within 14 m, surely within 29 m of the best position"
    radii = "most likely within 14 m, surely within 29 m"
    assert headline(cell) == f"ambiguous: 2 positions fit (50 %, 50 %); {radii} of the first"
    undecided = replace(cell, verdict="cannot tell", warnings=("too few",))
    assert headline(undecided) == "cannot tell: too few"


def test_radii_that_suppose_no_distant_mast_say_so(result):
    distant = kit.as_if_distant(result.cells[0])
    located = headline(replace(distant, verdict="located"))
    assert located.endswith("of the best position, if it is no distant mast")
    assert headline(distant).endswith("of the first, if it is no distant mast")


def test_shares_of_places_are_the_same_in_pictures_and_answers(result):
    """Two of 0.485 and one of 0.03 have 49, 48 and 3 %, not 48, 48 and 3."""
    cell = result.cells[0]
    one, other = cell.posterior.modes
    third = replace(other, probability=0.03, peak=0.01)
    modes = (replace(one, probability=0.485), replace(other, probability=0.485), third)
    posterior = replace(cell.posterior, modes=modes)
    assert mode_labels(posterior) == ["49 %", "48 %", "3 %"]
    assert [mode.share for mode in place_of(posterior).modes] == ["49 %", "48 %", "3 %"]


def test_a_region_far_larger_than_the_walk_leaves_the_walk_visible(result):
    cell = result.cells[0]
    squares = cell.posterior.squares
    x, y = squares.x_m.mean(), squares.y_m.mean()
    far = replace(
        squares,
        x_m=x + 50 * (squares.x_m - x),
        y_m=y + 50 * (squares.y_m - y),
        size_m=squares.size_m * 50,
    )
    huge = replace(cell, posterior=replace(cell.posterior, squares=far))
    box = picture_of(survey_of(result), huge).box
    assert box.contains(np.zeros(2))
    assert box.size < 400.0


def test_estimates_are_local_and_those_that_have_a_picture(result):
    picture = picture_of(survey_of(result), result.cells[0])
    keys = [estimate.estimator.key for estimate in picture.estimates]
    assert keys == ["batch", "ekf", "rts", "reference"]
    ekf = picture.estimates[1]
    x_m, y_m = result.cells[0].ekf.x[-1, :2]
    assert survey_of(result).local(Places.of(x_m, y_m))[0].tolist() == ekf.x[:2].tolist()


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("fit") / "walk.journal", seconds=120, cells=2)
    return kit.sample_result(run).cells[0]


def test_level_is_model_plus_residual(cell):
    fit = fit_of(cell)
    assert len(fit.level_dbm) == len(cell.obs)
    np.testing.assert_allclose(fit.model_dbm(fit.distance_m) + fit.residual_db, fit.level_dbm)
    assert abs(np.mean(fit.residual_db)) < 0.1 * fit.sigma_db
    assert fit.sigma_db**2 == pytest.approx(np.mean(fit.residual_db**2))


def test_distance_is_that_of_the_antenna(cell):
    place, height_m = cell.posterior.place, cell.posterior.prior.height_m
    squared_m2 = (cell.obs.x_m - place.x_m) ** 2 + (cell.obs.y_m - place.y_m) ** 2 + height_m**2
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


def test_rings_are_closed_and_relative_to_the_origin():
    (ring,) = region_rings(
        Squares(*(np.array([v]) for v in (100.0, 200.0, 8.0, 1.0))), 0.95, np.array([90.0, 190.0])
    )
    np.testing.assert_array_equal(ring[0], ring[-1])
    np.testing.assert_allclose(
        [ring.min(axis=0), ring.max(axis=0)], [(6.0, 6.0), (14.0, 14.0)], atol=1e-3
    )
