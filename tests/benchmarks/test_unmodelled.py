"""Worlds with what the model has not: each effect is there, and regions hold the transmitter."""

import numpy as np
import pytest

from benchmarks.scoreboard.unmodelled import EFFECTS, KINDS, NOISES, Job, Scene, jobs, score, tables
from benchmarks.scoreboard.world import Walk

WHITE, TWO_SCALES = NOISES
EAST_M = np.arange(-200.0, 201.0)
STRAIGHT = Walk(EAST_M, np.zeros(401), np.full(401, -70.0))


def after(effect):
    """A walk east past a transmitter 40 m to the north, with the same level all along."""
    return EFFECTS[effect](Scene(STRAIGHT, (0.0, 40.0), np.random.default_rng(1)))


def test_a_body_takes_what_comes_from_ahead():
    level_dbm = after("body in the way").level_dbm
    assert level_dbm[0] == -80.0
    assert -80.0 < level_dbm[170] < -70.0
    assert np.all(level_dbm[200:] == -70.0)


def test_late_fixes_are_behind_the_receiver():
    walk = after("fixes 5 s late")
    assert np.allclose(EAST_M - walk.x_m, 7.0)
    assert np.all(walk.level_dbm == STRAIGHT.level_dbm)


@pytest.mark.parametrize("effect", ["second slope", "absorption"])
def test_levels_fall_more_than_the_model_has_it(effect):
    level_dbm = after(effect).level_dbm
    assert level_dbm[0] < level_dbm[200] - 3.0
    assert level_dbm[0] == level_dbm[-1]


@pytest.mark.parametrize("effect", ["half shaded", "power changed", "gain drifts"])
def test_one_side_differs(effect):
    assert np.ptp(after(effect).level_dbm) in {6.0, 8.0, 15.0}


def test_a_walk_depends_on_its_numbers_only():
    job = Job("Rayleigh", TWO_SCALES, 3)
    assert np.array_equal(job.world.walk.level_dbm, job.world.walk.level_dbm)
    assert len(set(jobs(2))) == 2 * len(NOISES) * len(KINDS)


def test_the_region_holds_what_the_model_has_not():
    """Of these twelve one may miss; where it is located, none."""
    found = [score(Job(effect, WHITE, run)) for effect in KINDS[1:] for run in range(1)]
    assert sum(one.is_covered for one in found) >= len(found) - 1
    assert not any(one.verdict == "located" and not one.is_covered for one in found)
    assert "Rayleigh" in str(tables(found)[0])
