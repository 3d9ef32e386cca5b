"""Disturbed walks: what is added to them, and what is counted."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scoreboard.stability import Answer, Disturbed, disturb, disturb_walk, tables
from benchmarks.scoreboard.tables import in_markdown
from benchmarks.scoreboard.traces import traces as measured_traces
from tests.kit.walk_scores import scored_walk
from tests.kit.walks import FLOOR_DBM, censor_at_floor, simulate

BEFORE = Answer(1e4, 60.0, is_covered=True, verdict="located", weights={"noise": (0.2, 0.8)})


def disturbance(seed, **after):
    return Disturbed(scored_walk().trace, seed, BEFORE, replace(BEFORE, **after))


def test_errors_are_small_and_levels_at_the_floor_stay():
    obs, _ = simulate(np.random.default_rng(1), "random")
    obs = censor_at_floor(obs, 0.3)
    changed = disturb(obs, np.random.default_rng(2))
    assert np.std(changed.x_m - obs.x_m) == pytest.approx(1.0, rel=0.1)
    assert np.array_equal(changed.limit, obs.limit)
    is_floor = obs.limit != 0
    assert np.all(changed.level_dbm[is_floor] == FLOOR_DBM)
    change_db = (changed.level_dbm - obs.level_dbm)[~is_floor]
    assert np.std(change_db) == pytest.approx(0.3, rel=0.1)


def test_changes_are_counted():
    found = [
        disturbance(0, area_m2=1.9e4),
        disturbance(1, area_m2=2.1e4, verdict="cannot tell"),
        disturbance(2, area_m2=0.4e4, is_covered=False),
        disturbance(3),
    ]
    text = in_markdown(tables(found))
    assert "| all | 1 | 0.500 | 0.692 | 1 | 1 | 1 |" in text
    assert "| located that become a miss | 1 | 0 | missed |" in text
    assert "noise 0.20 0.80" in text


def test_a_measured_walk_is_disturbed(traces):
    trace = next(one for one in measured_traces() if one.name == "campus_1031_114206_n57")
    one, other = disturb_walk(trace, seeds=2)
    assert one.before == other.before
    assert one.after != other.after
    assert sum(one.before.weights["noise"]) == pytest.approx(1.0)
