from dataclasses import replace

import pytest

from postproc.pictures.picture import focus_of, headline, nice_step, picture_of
from tests.kit import sample_results as kit


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("picture") / "walk.journal", seconds=120, cells=3)
    return kit.sample_result(run, places=2, verdict="ambiguous")


def test_focus_is_located_first_then_heard_most(result):
    a, b, c = result.cells
    assert focus_of(result.cells).cell == kit.cell_name(0)
    chosen = (a, replace(b, verdict="located", n=9), replace(c, n=10_000))
    assert focus_of(chosen).cell == b.cell
    assert focus_of(()) is None


def test_headline_is_honest(result):
    cell = result.cells[0]
    assert headline(replace(cell, verdict="located")).startswith(
        "located: 95 % of the probability lie within 29 m"
    )
    assert (
        headline(replace(cell, verdict="cannot tell", warnings=("too few",)))
        == "cannot tell: too few"
    )


def test_region_out_of_all_proportion_leaves_the_walk_in_sight(result):
    cell = result.cells[0]
    cells = cell.posterior.squares
    x, y = cells.x_m.mean(), cells.y_m.mean()
    far = replace(
        cells, x_m=x + 50 * (cells.x_m - x), y_m=y + 50 * (cells.y_m - y), size_m=cells.size_m * 50
    )
    huge = replace(cell, posterior=replace(cell.posterior, squares=far))
    box = picture_of(result.runs[0], huge).box
    assert box.holds(0.0, 0.0)
    assert box.size < 400.0


@pytest.mark.parametrize(
    ("span", "most", "step"), [(950, 12, 100), (120, 12, 10), (0, 5, 1), (2401, 12, 500)]
)
def test_steps_are_round(span, most, step):
    assert nice_step(span, most) == step
