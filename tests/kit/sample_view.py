"""Views to draw, without estimating: the posterior of each step is a Gaussian that shrinks."""

import numpy as np

from postproc.result import Result
from postproc.view.view_model import CellDetail, Step, ViewModel, view_model
from tests.kit import sample_results as kit

SIGMAS_M = (40.0, 25.0, 16.0)
"""Of the posteriors of the steps before the last."""


def sample_steps(result) -> tuple[Step, ...]:
    obs = result.obs
    ends = np.linspace(0, len(obs), len(SIGMAS_M) + 2)[1:-1].astype(int).tolist()
    early = [
        Step(int(obs.t_ns[n - 1]), n, "cannot tell", kit.sample_posterior(obs, sigma_m=sigma_m))
        for n, sigma_m in zip(ends, SIGMAS_M, strict=True)
    ]
    return (*early, Step(int(obs.t_ns[-1]), len(obs), result.verdict, result.posterior))


def sample_view(result: Result, claims=()) -> ViewModel:
    """The first cell in detail."""
    located = next((cell for cell in result.cells if cell.posterior), None)
    if located is None:
        return view_model(result, [CellDetail(cell) for cell in result.cells[:1]])
    return view_model(result, [CellDetail(located, sample_steps(located), tuple(claims))])
