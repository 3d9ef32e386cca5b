import numpy as np
import pytest

from logger.core.model.prior import ENVIRONMENTS
from postproc.cell_estimation import locate_cell
from postproc.result import CellResult
from postproc.view.view_model import MOST_STEPS, answer_steps, step_counts
from tests.kit import walks


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
    steps = list(answer_steps(result, ENVIRONMENTS["any"]))
    assert (steps[-1].verdict, steps[-1].n) == (result.verdict, 80)
    assert steps[-1].posterior is result.posterior
    assert steps[0].posterior.region_area_m2 > steps[-1].posterior.region_area_m2
    middle = steps[len(steps) // 2]
    assert middle.t_ns == obs.t_ns[middle.n - 1]
    again = locate_cell(obs.part(slice(middle.n)), ENVIRONMENTS["any"])
    assert (again.verdict, again.posterior.r95_m) == (middle.verdict, middle.posterior.r95_m)


def test_without_a_posterior_there_is_no_step():
    assert (
        list(answer_steps(CellResult("c", 0, None, "cannot tell", ()), ENVIRONMENTS["any"])) == []
    )
