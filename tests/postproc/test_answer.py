from dataclasses import replace

import msgspec
import pytest

from logger.core.answer import Position
from postproc.cell_work import failure
from tests.kit import sample_results as kit


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("answer") / "walk.journal"
    return kit.sample_result(kit.write_run(path, seconds=60, cells=2))


def answer_in(result, cell):
    return cell.answer([one.run for one in result.runs])


def test_an_answer_is_that_of_the_json(result):
    for cell, printed in zip(result.cells, kit.json_of(result)["cells"], strict=True):
        answer = answer_in(result, cell)
        assert (answer.cell, answer.verdict) == (printed["cell"], printed["verdict"])
        assert list(answer.reasons) == printed["warnings"]
        assert (answer.place is None) == (printed["best"]["lat"] is None)
        if answer.place is None:
            continue
        shown = {name: printed["best"][name] for name in Position.__struct_fields__}
        assert msgspec.to_builtins(answer.place.position) == shown
        assert msgspec.to_builtins(list(answer.place.modes)) == printed["modes"]
        assert answer.parameters.eta == printed["best"]["eta"]
        assert answer.paths.ends["ekf"].lat == printed["ekf"]["lat"]


def test_the_position_shown_is_that_of_the_first_mode(result):
    place = answer_in(result, result.cells[0]).place
    assert (place.lat, place.lon) == (place.modes[0].lat, place.modes[0].lon)
    assert place.likely_modes[0] == place.modes[0]


def test_an_answer_names_its_run_and_times(result):
    cell = replace(result.cells[0], heard_utc_ns=(1, 2))
    made_from = answer_in(result, cell).provenance
    assert made_from.runs == (result.runs[0].run.path.name,)
    assert made_from.n == cell.n
    assert (made_from.first_utc_ns, made_from.last_utc_ns) == (1, 2)
    failed = cell.after(failure(cell.cell, "its work", "boom"))
    made_from = answer_in(result, failed).provenance
    assert (made_from.runs, made_from.last_utc_ns) == ((result.runs[0].run.path.name,), 2)


def test_a_cell_without_a_posterior_has_an_answer_without_a_place(result):
    unknown = replace(result.cells[0], posterior=None, verdict="cannot tell")
    answer = answer_in(result, unknown)
    assert answer.place is None
    assert answer.parameters is None
