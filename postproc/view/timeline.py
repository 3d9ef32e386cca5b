"""How the answer came about: the posterior and its verdict after each part of the walk."""

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from logger.core.locator.posterior import Posterior
from logger.core.locator.verdict import Verdict
from logger.core.model.prior import Prior
from postproc.cell_estimation import FEWEST_READINGS, locate_cell
from postproc.processes import each
from postproc.result import CellResult

MOST_STEPS = 16
"""Each costs as much as the answer itself."""
_EARLY = 1.6
"""Power by which steps are denser at the beginning, where the region shrinks most."""


class Step(NamedTuple):
    """What the first `n` readings say, the last of them heard at `t_ns`."""

    t_ns: int
    n: int
    verdict: Verdict
    posterior: Posterior


def unfold(result: CellResult, prior: Prior, processes: int = 1) -> Iterator[Step]:
    """A cell's answer step by step, at most `MOST_STEPS`, the last of them the answer; nothing
    without a posterior.
    """
    obs, posterior = result.obs, result.posterior
    if obs is None or posterior is None:
        return
    counts = step_counts(len(obs))[:-1]
    found = each(partial(locate_cell, prior=prior), [obs.part(slice(n)) for n in counts], processes)
    for n, part in zip(counts, found, strict=True):
        if part.posterior is not None:
            yield Step(int(obs.t_ns[n - 1]), n, part.verdict, part.posterior)
    yield Step(int(obs.t_ns[-1]), len(obs), result.verdict, posterior)


def step_counts(count: int) -> list[int]:
    """Numbers of readings after which there is a step; the last is all of them."""
    share = np.linspace(0.0, 1.0, MOST_STEPS + 1)[1:] ** _EARLY
    return [int(n) for n in np.unique(np.ceil(share * count)) if n >= min(FEWEST_READINGS, count)]
