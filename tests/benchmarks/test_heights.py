"""Walks below antennas: where they pass, and what is counted."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scoreboard.heights import (
    COUNT,
    HEIGHTS_M,
    NOISES,
    PASSES_M,
    HeightJob,
    HeightScore,
    groups,
    jobs,
    right_located,
    score,
    tables,
)
from benchmarks.scoreboard.tables import in_markdown

WHITE, TWO_SCALES = NOISES


def score_of(run=0, *, height_m=5.0, covered=True, verdict="located"):
    job = HeightJob(WHITE, height_m, 15.0, run)
    return HeightScore(job, covered, error_m=4.0, r95_m=20.0, area_m2=900.0, verdict=verdict)


@pytest.mark.parametrize("pass_m", PASSES_M)
def test_a_walk_passes_at_the_distance(pass_m):
    world = HeightJob(TWO_SCALES, 30.0, pass_m, 1).world
    (x_m, y_m), walk = world.sources[0], world.walk
    away_m = np.hypot(walk.x_m - x_m, walk.y_m - y_m)
    assert 0.97 * pass_m <= np.min(away_m) <= pass_m
    assert 0.1 * COUNT <= np.argmin(away_m) < 0.9 * COUNT


def test_the_height_is_in_the_levels():
    job = HeightJob(WHITE, 30.0, 5.0, 2)
    world = job.world
    (x_m, y_m), walk = world.sources[0], world.walk
    away_m = np.hypot(walk.x_m - x_m, walk.y_m - y_m)
    noise_db = [
        np.std(walk.level_dbm + 10.0 * world.eta * np.log10(np.hypot(away_m, height_m)))
        for height_m in (30.0, 0.0)
    ]
    assert noise_db[0] == pytest.approx(3.0, rel=0.1)
    assert noise_db[1] > noise_db[0]


def test_a_walk_depends_on_its_numbers_only():
    job = HeightJob(TWO_SCALES, 10.0, 25.0, 3)
    assert np.array_equal(job.world.walk.level_dbm, replace(job).world.walk.level_dbm)
    assert len(set(jobs(2))) == 2 * len(NOISES) * len(HEIGHTS_M) * len(PASSES_M)


def test_a_walk_is_scored():
    found = score(HeightJob(WHITE, 5.0, 15.0, 0))
    assert found.area_m2 > 0.0
    assert found.r95_m > 0.0
    assert found.is_located == (found.verdict == "located")


def test_what_is_wrong_is_counted():
    some = [score_of(run) for run in range(9)]
    some += [score_of(9, covered=False), score_of(10, height_m=30.0, verdict="cannot tell")]
    by_name = dict(groups(some))
    assert len(by_name["height 30 m"]) == 1
    assert right_located(some) == 9
    text = in_markdown(tables(some))
    assert "| height 5 m | 0.900 of 10 | 10 | 1 |" in text
    assert "| of located, share outside their region | 0.1 | <= 0.02 | missed |" in text
