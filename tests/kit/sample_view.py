"""Stories to draw, without the time that estimating takes: each step's posterior is a Gaussian that
shrinks.
"""

import numpy as np

from postproc.result import Result
from postproc.view.timeline import Step
from postproc.view.view_model import Story, estimated, story_of
from tests.kit import sample_results as kit

SIGMAS_M = (40.0, 25.0, 16.0)
"""Of the posteriors of the steps before the last."""


def sample_steps(result) -> tuple[Step, ...]:
    obs = result.obs
    ends = np.linspace(0, len(obs), len(SIGMAS_M) + 2)[1:-1].astype(int).tolist()
    found = [
        Step(int(obs.t_ns[n - 1]), n, "cannot tell", kit.sample_posterior(obs, sigma_m=sigma_m))
        for n, sigma_m in zip(ends, SIGMAS_M, strict=True)
    ]
    return (*found, Step(int(obs.t_ns[-1]), len(obs), result.verdict, result.posterior))


def sample_story(smoothed: Result, claims=()) -> Story:
    """The first cell told in full."""
    result = next((cell for cell in smoothed.cells if cell.posterior), None)
    told = (
        [(result, sample_steps(result), tuple(claims))]
        if result
        else [(cell, (), ()) for cell in smoothed.cells[:1]]
    )
    return story_of(estimated(smoothed), told)
