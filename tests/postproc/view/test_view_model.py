from dataclasses import replace

import pytest

from postproc.pictures import colours
from postproc.view.view_model import select_cells
from tests.kit import sample_results as kit
from tests.kit.sample_view import sample_view


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return kit.sample_result(
        kit.write_run(tmp_path_factory.mktemp("view") / "walk.journal", seconds=120, cells=3)
    )


def test_cells_in_detail_are_in_the_order_they_are_named(result):
    names = [cell.cell for cell in result.cells]
    selected = select_cells(result, [names[2], names[0], names[2]])
    assert [cell.cell for cell in selected] == [names[2], names[0]]
    assert [cell.cell for cell in select_cells(result, None)] == [names[0]]
    assert select_cells(replace(result, cells=()), None) == []


def test_each_cell_has_its_own_colour(result):
    view = sample_view(result)
    assert view.cell_colours[view.cell_views[0].name] == colours.WALKER
    assert len(set(view.cell_colours.values())) == 3
