"""Transmitters at street level: what their world is, and that the region holds them."""

import numpy as np
import pytest

from benchmarks.scoreboard.streets import KINDS, StreetJob, score, tables


@pytest.mark.parametrize("kind", KINDS)
def test_a_walk_passes_at_the_distance(kind):
    world = StreetJob(kind, 1).world
    away_m = np.hypot(world.walk.x_m - world.sources[0][0], world.walk.y_m - world.sources[0][1])
    low_m, high_m = (115.0, 420.0) if kind == "far" else (0.0, 130.0)
    assert low_m < np.min(away_m) < high_m
    assert np.max(world.walk.level_dbm) > np.min(world.walk.level_dbm) >= world.floor_dbm


def test_the_region_holds_what_is_around_a_corner():
    """Where the corner is not thought of, three of these eight are missed by narrow regions."""
    found = [score(StreetJob("street", run)) for run in range(8)]
    assert sum(one.is_covered for one in found) >= 7
    assert not any(one.verdict == "located" and not one.is_covered for one in found)
    assert "street" in str(tables(found)[0])
