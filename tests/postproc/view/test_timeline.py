import numpy as np
import pytest

from logger.core.model.prior import ENVIRONMENTS
from postproc.cell_estimation import locate_cell
from postproc.result import CellResult
from postproc.view.timeline import MOST_STEPS, answer_steps, step_counts
from tests.kit import walks


@pytest.mark.parametrize("count", [1, 4, 5, 6, 30, 1000, 50_000])
def test_steps_end_with_everything_and_are_denser_at_the_beginning(count):
    found = step_counts(count)
    assert found[-1] == count
    assert len(found) <= MOST_STEPS
    assert np.all(np.diff(found) > 0)
    if count >= 1000:
        assert found[1] - found[0] < found[-1] - found[-2]


def test_each_step_is_the_answer_of_the_readings_so_far(monkeypatch):
    monkeypatch.setattr("postproc.view.timeline.MOST_STEPS", 4)
    obs, _ = walks.simulate(np.random.default_rng(3), "square", count=80, step=8.0)
    result = locate_cell(obs, ENVIRONMENTS["any"])
    found = list(answer_steps(result, ENVIRONMENTS["any"]))
    assert (found[-1].verdict, found[-1].n) == (result.verdict, 80)
    assert found[-1].posterior is result.posterior
    assert found[0].posterior.region_area_m2 > found[-1].posterior.region_area_m2
    some = found[len(found) // 2]
    assert some.t_ns == obs.t_ns[some.n - 1]
    again = locate_cell(obs.part(slice(some.n)), ENVIRONMENTS["any"])
    assert (again.verdict, again.posterior.r95_m) == (some.verdict, some.posterior.r95_m)


def test_without_a_posterior_there_is_no_step():
    assert (
        list(answer_steps(CellResult("c", 0, None, "cannot tell", ()), ENVIRONMENTS["any"])) == []
    )
