"""The answer step by step: the posterior and its verdict after each part of the walk."""

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from logger.core.locator.posterior import Posterior
from logger.core.model.prior import Prior
from logger.core.readings import Readings
from logger.core.types import Verdict
from postproc.cell_estimation import FEWEST_READINGS, locate_cell
from postproc.cell_work import PROCESS_ENDED, failure
from postproc.processes import each
from postproc.result import CellResult

MOST_STEPS = 16
"""Each takes as long as the answer itself."""
_EARLY_POWER = 1.6
"""Steps are denser at the beginning, where the region shrinks most."""


class Step(NamedTuple):
    """Answer from the first `n` readings, the last of them at `t_ns`."""

    t_ns: int
    n: int
    verdict: Verdict
    posterior: Posterior


def answer_steps(result: CellResult, prior: Prior, processes: int = 1) -> Iterator[Step]:
    """A cell's answer in at most `MOST_STEPS` steps, the last of them the answer itself.

    There is none without a posterior.
    """
    obs, posterior = result.obs, result.posterior
    if obs is None or posterior is None:
        return
    counts = step_counts(len(obs))[:-1]
    parts = [obs.part(slice(n)) for n in counts]
    answers = each(partial(locate_cell, prior=prior), parts, processes, _cell_without_result)
    for n, part in zip(counts, answers, strict=True):
        if part.posterior is not None:
            yield Step(int(obs.t_ns[n - 1]), n, part.verdict, part.posterior)
    yield Step(int(obs.t_ns[-1]), len(obs), result.verdict, posterior)


def _cell_without_result(part: Readings) -> CellResult:
    """The answer of a step that ended a process."""
    why = failure(part.cell, "a step of its answer", PROCESS_ENDED)
    return CellResult(part.cell, len(part), part, "cannot tell", ()).after(why)


def step_counts(count: int) -> list[int]:
    """Numbers of readings after which there is a step; the last is `count`."""
    share = np.linspace(0.0, 1.0, MOST_STEPS + 1)[1:] ** _EARLY_POWER
    return [int(n) for n in np.unique(np.ceil(share * count)) if n >= min(FEWEST_READINGS, count)]
