"""The advice in one sentence."""

import numpy as np
import pytest

from logger.core.guidance.sentence import direction


@pytest.mark.parametrize(
    ("east", "north", "text"),
    [
        (0, 1, "north"),
        (1, 1, "north-east"),
        (1, 0.3, "east"),
        (0, -1, "south"),
        (-1, 0, "west"),
        (-1, 1, "north-west"),
    ],
)
def test_directions_are_those_of_a_compass(east, north, text):
    assert direction(np.array([east, north])) == text
