"""The advice in one sentence."""

import numpy as np
import pytest

from logger.core.guidance.planner import Plan
from logger.core.guidance.routes import Route
from logger.core.guidance.sample import PositionSample
from logger.core.guidance.sentence import direction, sentence
from logger.core.places import Places


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


@pytest.mark.parametrize(
    ("away_m", "spread_m", "why"),
    [(200.0, 60.0, "passing it says most"), (50.0, 10.0, "hear it from another side")],
)
def test_the_radius_is_said_by_the_answer_alone(away_m, spread_m, why):
    """That of the advice is of the device's own posterior, and would stand beside another one."""
    likely = Places.of(away_m + np.array([0.0, spread_m, -spread_m]), np.full(3, 5.2e6))
    sample = PositionSample(likely, np.array([0.4, 0.3, 0.3]), *[None] * 6)
    best = Plan(Route(np.array([[0.0, 5.2e6], [100.0, 5.2e6]])), 5.0, None, None)
    there = Places.of(away_m, 5.2e6)
    text, _ = sentence(best, sample, [there], 90.0, 100.0, -80.0)
    assert text == f"straight on, east, 100 m: the likeliest place is {away_m:.0f} m east; {why}"
