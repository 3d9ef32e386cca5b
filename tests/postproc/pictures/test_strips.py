import numpy as np
import pytest

from postproc.pictures.plots import strips_of
from postproc.pictures.survey import Clock, Levels

CLOCK = Clock(np.array([10**9]), (None,))


def levels(name, seconds, level_dbm):
    return Levels(
        name, 10**9 + (np.array(seconds) * 1e9).astype(np.int64), np.array(level_dbm, float)
    )


def test_levels_are_in_their_intervals():
    often = levels("a", np.arange(0, 241), np.linspace(-50, -60, 241))
    strips = strips_of([often, None, levels("b", [121, 121.5, 239], [-70, -90, -75])], CLOCK)
    assert strips.minutes == pytest.approx(4.0)
    assert strips.level_dbm.shape == (3, 120)
    has_reading = np.isfinite(strips.level_dbm)
    assert has_reading.sum(axis=1).tolist() == [120, 0, 2]
    assert strips.level_dbm[0, [0, -1]] == pytest.approx([-50.0, -60.0], abs=0.1)
    assert np.flatnonzero(has_reading[2]).tolist() == [60, 119]
    assert strips.level_dbm[2, [60, 119]].tolist() == [-80.0, -75.0]


def test_intervals_are_no_finer_than_the_scans():
    """A cell that is read every ten seconds has no gap."""
    strips = strips_of([levels("a", np.arange(0, 600, 10), np.full(60, -70.0))], CLOCK)
    assert np.all(np.isfinite(strips.level_dbm))


def test_without_a_level_there_are_no_strips():
    assert strips_of([], CLOCK) is None
    assert strips_of([None], CLOCK) is None
    assert strips_of([levels("a", [], [])], CLOCK) is None
