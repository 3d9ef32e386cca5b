"""Which readings count where a modem names a cell in some of the scans only."""

import numpy as np

from logger.core.readings import FEWEST_LEVELS, LEAST_SHARE, regularly_named

N = 200


def _levels():
    """A walk away from a cell: it is named less and less often."""
    level_dbm = -60.0 - np.arange(N) / 4.0
    return level_dbm, np.ones(N, np.bool_), np.linspace(1.0, 0.1, N)


def test_readings_count_where_nearly_all_scans_name_the_cell():
    level_dbm, is_level, share = _levels()
    np.testing.assert_array_equal(regularly_named(level_dbm, is_level, share), share >= LEAST_SHARE)


def test_all_count_where_the_cell_is_absent_near_its_strongest_readings_too():
    """Then the modem has another reason, such as the list that the network gives it."""
    level_dbm, is_level, share = _levels()
    assert np.all(regularly_named(level_dbm, is_level, share[::-1]))


def test_all_count_where_too_few_would_remain():
    level_dbm, is_level, share = _levels()
    share = np.where(np.arange(N) < FEWEST_LEVELS - 1, 1.0, 0.3)
    assert np.all(regularly_named(level_dbm, is_level, share))
    share[FEWEST_LEVELS - 1] = 1.0
    assert np.count_nonzero(regularly_named(level_dbm, is_level, share)) == FEWEST_LEVELS
    is_level[0] = False  # at a limit of the scale, which is no level
    assert np.all(regularly_named(level_dbm, is_level, share))


def test_no_readings_are_none():
    assert len(regularly_named(np.zeros(0), np.zeros(0, np.bool_), np.zeros(0))) == 0
