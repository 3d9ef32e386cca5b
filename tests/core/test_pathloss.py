import numpy as np
import pytest

from logger.core.pathloss import log_distance_db


def test_decades_and_the_clamp():
    dx_m = np.array([10.0, 60.0, 0.0, 0.3, 1.0])
    dy_m = np.array([0.0, 80.0, 0.0, 0.4, 0.0])
    assert log_distance_db(dx_m, dy_m) == pytest.approx([10.0, 20.0, 0.0, 0.0, 0.0])


def test_offsets_are_broadcast():
    assert log_distance_db(np.ones((3, 1)), np.ones(4)).shape == (3, 4)
