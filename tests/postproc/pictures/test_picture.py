from dataclasses import replace

import pytest

from postproc.pictures.picture import focus_of, headline, picture_of
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
    assert headline(cell) == f"ambiguous: 2 positions fit (50%, 50%); {radii} of the first"
    undecided = replace(cell, verdict="cannot tell", warnings=("too few",))
    assert headline(undecided) == "cannot tell: too few"


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
    assert box.contains(0.0, 0.0)
    assert box.size < 400.0


def test_estimates_are_local_and_those_that_have_a_picture(result):
    picture = picture_of(survey_of(result), result.cells[0])
    keys = [estimate.estimator.key for estimate in picture.estimates]
    assert keys == ["batch", "ekf", "rts", "reference"]
    ekf = picture.estimates[1]
    x_m, y_m = result.cells[0].ekf.x[-1, :2]
    assert survey_of(result).local(x_m, y_m)[0].tolist() == ekf.x[:2].tolist()
