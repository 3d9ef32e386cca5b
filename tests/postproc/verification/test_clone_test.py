from dataclasses import replace

import numpy as np
import pytest

from logger.core.locator.pipeline import locate
from logger.core.model.prior import Prior
from logger.core.places import Places
from postproc.multi_run import merge
from postproc.verification.run_sites import DRAWS, between_two, within_one
from tests.kit.walks import observations, path

PRIOR = Prior()


def levels_at(rng, place, start=(0.0, 0.0), white_db=2.0):
    x, y = path("square", 200, 3.0)
    x, y = x + start[0], y + start[1]
    level = (
        -30.0
        - 30.0 * np.log10(np.hypot(x - place[0], y - place[1]))
        + white_db * rng.normal(size=len(x))
    )
    return x, y, level


def two_runs(rng, second):
    """The square twice, moved a little; the second run has its transmitter there."""
    runs = [levels_at(rng, (80.0, 40.0)), levels_at(rng, second, (60.0, -30.0))]
    parts = [replace(observations(*run), run=np.full(200, k)) for k, run in enumerate(runs)]
    return merge(dict(enumerate(parts)), [0, 0])


def test_two_runs_past_one_place_and_past_two():
    rng = np.random.default_rng(1)
    calm, cloned = (
        between_two(obs, locate(obs, PRIOR), rng)
        for obs in (two_runs(rng, (80.0, 40.0)), two_runs(rng, (-10.0, 200.0)))
    )
    assert calm.p > 0.05
    assert cloned.p == 1.0 / (DRAWS + 1)
    assert cloned.log_factor > max(calm.log_factor, 6.9)
    assert cloned.one.away_m(Places.of(80.0, 40.0)) < 40.0
    assert cloned.other.away_m(Places.of(-10.0, 200.0)) < 40.0


def test_one_run_past_one_place_leaves_nothing_to_explain():
    obs = observations(*levels_at(np.random.default_rng(2), (80.0, 40.0)))
    assert within_one(obs, locate(obs, PRIOR), np.random.default_rng(0)) is None


@pytest.mark.slow
def test_one_run_past_two_places():
    rng = np.random.default_rng(3)
    x, y = np.linspace(0.0, 700.0, 350), 40.0 * np.sin(np.linspace(0.0, 9.0, 350))
    levels = [
        -30.0 - 30.0 * np.log10(np.hypot(x - a, y - 60.0)) + 2.0 * rng.normal(size=350)
        for a in (100.0, 600.0)
    ]
    obs = observations(x, y, np.maximum(*levels))
    found = within_one(obs, locate(obs, PRIOR), rng, draws=19)
    assert found.log_factor > 6.9
    assert found.p <= 0.05
