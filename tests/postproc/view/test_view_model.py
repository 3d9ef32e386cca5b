from dataclasses import replace

import numpy as np
import pytest

from logger.core.model.prior import ENVIRONMENTS
from logger.core.runfile import RunWriter, read_run
from logger.core.types import UNKNOWN_TIME, CellReading, Fix, Record, Scan
from postproc.multi_run import merge
from postproc.pictures import colours
from postproc.pictures.survey import clock_of
from postproc.result import CellResult, Options
from postproc.smoothing import locate_cell
from postproc.view.view_model import (
    MOST_STEPS,
    PAUSE_NS,
    answer_steps,
    end_to_end,
    select_cells,
    step_counts,
)
from tests.kit import sample_results as kit
from tests.kit import walks
from tests.kit.runs import UTC0_NS, meta
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


S = 10**9


def write(path, started_ns, utc_ns, *, seconds=5):
    """A fix and a scan a second, of a machine that was switched on `started_ns` ago."""
    writer = RunWriter(path, meta(started_ns=started_ns, run_id=path.stem * 8))
    for i in range(seconds):
        t_ns = started_ns + i * S
        utc = None if utc_ns is None else utc_ns + i * S
        writer.append(Record(t_ns, "gnss", Fix(True, utc, 52.0, 13.0 + i * 1e-4)))
        reading = CellReading("scan", "GSM", "262", "01", 1, 1, rssi_dbm=-70.0)
        writer.append(Record(t_ns + 9, "modem", Scan(t_ns + 5, (reading,), None)))
    writer.close(started_ns + seconds * S, "test")
    return read_run(path)


@pytest.fixture
def runs(tmp_path):
    """The first in the list was walked a day later."""
    late = write(tmp_path / "late.journal", 7 * S, UTC0_NS + 86_400 * S)
    early = write(tmp_path / "earl.journal", 900 * S, UTC0_NS)
    return [late, early]


def test_runs_follow_each_other_in_the_order_they_were_walked(runs):
    first, second = end_to_end(runs)
    assert (first.path.stem, second.path.stem) == ("earl", "late")
    assert first.meta.started_ns == 0
    last_ns = first.tables["readings"]["t_ns"][-1]
    assert second.meta.started_ns == last_ns + PAUSE_NS
    np.testing.assert_array_equal(np.diff(second.tables["fixes"]["t_ns"]), S)
    np.testing.assert_array_equal(
        first.tables["readings"]["t_start_ns"], first.tables["scans"]["t_start_ns"]
    )
    assert first.tables["scans"]["t_start_ns"][0] == 5


def test_utc_is_that_of_each_run(runs):
    laid = end_to_end(runs)
    clock = clock_of(laid)
    for run, expected in zip(laid, (UTC0_NS, UTC0_NS + 86_400 * S), strict=True):
        utc_ns = clock.utc_ns(run.tables["fixes"]["t_ns"])
        np.testing.assert_array_equal(utc_ns, expected + np.arange(5) * S)
    assert clock.elapsed_ns(laid[1].tables["fixes"]["t_ns"])[0] == laid[1].meta.started_ns


def test_where_one_run_has_no_date_there_is_none_and_the_order_is_the_given_one(runs, tmp_path):
    undated = write(tmp_path / "none.journal", 3 * S, None)
    laid = end_to_end([*runs, undated])
    assert [run.path.stem for run in laid] == ["late", "earl", "none"]
    clock = clock_of(laid)
    assert not clock.has_utc
    assert clock.utc_ns(np.array([0])) is None


def test_unknown_times_stay_unknown(runs):
    runs[1].tables["readings"]["t_start_ns"][2] = UNKNOWN_TIME
    first, _ = end_to_end(runs)
    assert first.tables["readings"]["t_start_ns"][2] == UNKNOWN_TIME


def test_the_runs_themselves_stay_as_they_are(runs):
    before = runs[1].tables["fixes"]["t_ns"].copy()
    end_to_end(runs)
    np.testing.assert_array_equal(runs[1].tables["fixes"]["t_ns"], before)


@pytest.mark.parametrize("count", [1, 4, 5, 6, 30, 1000, 50_000])
def test_steps_end_with_all_readings_and_are_denser_at_the_beginning(count):
    counts = step_counts(count)
    assert counts[-1] == count
    assert len(counts) <= MOST_STEPS
    assert np.all(np.diff(counts) > 0)
    if count >= 1000:
        assert counts[1] - counts[0] < counts[-1] - counts[-2]


def test_each_step_is_the_answer_from_the_readings_until_then(monkeypatch):
    monkeypatch.setattr("postproc.view.view_model.MOST_STEPS", 4)
    obs, _ = walks.simulate(np.random.default_rng(3), "square", count=80, step=8.0)
    result = locate_cell(obs, ENVIRONMENTS["any"])
    steps = list(answer_steps(result, Options()))
    assert (steps[-1].verdict, steps[-1].n) == (result.verdict, 80)
    assert steps[-1].posterior is result.posterior
    assert steps[0].posterior.region_area_m2 > steps[-1].posterior.region_area_m2
    middle = steps[len(steps) // 2]
    assert middle.t_ns == obs.t_ns[middle.n - 1]
    again = locate_cell(obs.part(slice(middle.n)), ENVIRONMENTS["any"])
    assert (again.verdict, again.posterior.r95_m) == (middle.verdict, middle.posterior.r95_m)


def test_steps_are_in_the_order_of_time_though_the_later_of_two_runs_has_most_readings(
    monkeypatch,
):
    monkeypatch.setattr("postproc.view.view_model.MOST_STEPS", 4)
    obs, _ = walks.simulate(np.random.default_rng(3), "square", count=80, step=8.0)
    two = np.arange(80) < 30, np.arange(80) >= 30
    parts = {run: replace(obs.part(two[run]), known_limit=None) for run in (1, 0)}
    both = merge(parts, modems=(0, 1))
    result = locate_cell(both, ENVIRONMENTS["any"])
    steps = list(answer_steps(result, Options()))
    times_ns = [step.t_ns for step in steps]
    assert times_ns == sorted(times_ns)
    assert times_ns[-1] == obs.t_ns[-1]
    first = steps[0]
    assert first.n < 30
    again = locate_cell(obs.part(slice(first.n)), ENVIRONMENTS["any"])
    assert first.posterior.r95_m == pytest.approx(again.posterior.r95_m, rel=0.05)


def test_each_step_has_the_radius_of_a_location_that_the_user_chose():
    obs, _ = walks.simulate(np.random.default_rng(3), "square", count=80, step=8.0)
    strict, wide = (
        [step.verdict for step in answer_steps(locate_cell(obs, one.prior, one.within_m), one)]
        for one in (Options(within_m=1.0), Options(within_m=5000.0))
    )
    assert set(strict) == {"cannot tell"}
    assert wide[:-1].count("located") > 0


def test_without_a_posterior_there_is_no_step():
    assert list(answer_steps(CellResult("c", 0, None, "cannot tell", ()), Options())) == []
