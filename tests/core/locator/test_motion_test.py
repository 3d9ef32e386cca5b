from dataclasses import replace

import numpy as np
import pytest

from logger.core.locator.pipeline import decide, locate, unless_it_moves
from logger.core.locator.quadtree import Effort
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR, MOVES_M, MotionTest
from logger.core.locator.verdict import Decision, assess
from logger.core.model.prior import Prior
from tests.kit.guided_walks import line
from tests.kit.walks import observations

EFFORT = Effort(most_squares=400, split_share=0.02, nodes=1, most_blocks=80)
AROUND = line(
    (0.0, 0.0), (240.0, 0.0), (240.0, 200.0), (0.0, 200.0), (0.0, 0.0), (120.0, 60.0),
    (120.0, 220.0), (60.0, 60.0), (260.0, 120.0),
)  # fmt: skip


def _walk_past(emitter_m, seed=0):
    """Past a transmitter at (2,), or at (n, 2) with the readings."""
    rng = np.random.default_rng(seed)
    x_m, y_m = AROUND.T
    east_m, north_m = (AROUND - emitter_m).T
    away_m = np.hypot(np.hypot(east_m, north_m), 5.0)
    level_dbm = -25.0 - 28.0 * np.log10(away_m) + rng.normal(0.0, 3.0, len(x_m))
    return observations(x_m, y_m, np.round(level_dbm), 4.0)


def _division(emitter_m, seed=0):
    obs, test = _walk_past(emitter_m, seed), MotionTest()
    test.try_moves(obs, locate(obs, Prior(), EFFORT), len(MOVES_M))
    return test.division()


@pytest.mark.parametrize("way_m", [(200.0, 100.0), (-300.0, 500.0)])
def test_one_that_moves_is_told_from_one_that_stands(way_m):
    begin_m = np.array([60.0, 40.0])
    share = np.linspace(0.0, 1.0, len(AROUND))[:, None]
    division = _division(begin_m + share * way_m)
    assert division.is_in_time
    assert division.log_factor > LEAST_LOG_FACTOR
    moved_m = (division.other.xy_m - division.one.xy_m)[:, 0]
    assert moved_m @ np.array(way_m) > 0.8 * np.hypot(*moved_m) * np.hypot(*way_m)


def test_one_that_stands_does_not_move():
    for seed in range(3):
        assert _division(np.array([120.0, 90.0]), seed).log_factor < 0.0


@pytest.mark.parametrize(
    ("way_m", "says"),
    [((0.0, 0.0), "one position holds"), ((250.0, 0.0), "the transmitter seems to have moved")],
)
def test_at_the_desk_one_that_moves_is_not_located(way_m, says):
    share = np.linspace(-0.5, 0.5, len(AROUND))[:, None]
    obs = _walk_past(np.array([60.0, 40.0]) + share * way_m)
    posterior = locate(obs)
    assert assess(posterior, obs, within_m=400.0).verdict == "located"
    found = decide(posterior, obs, within_m=400.0)
    assert says in found.reasons[0]
    assert (found.verdict == "located") == (way_m == (0.0, 0.0))


def test_a_location_stays_unless_one_that_moves_is_likelier():
    located, share = Decision("located", ["why"]), np.linspace(0.0, 1.0, len(AROUND))[:, None]
    stands = _walk_past(np.array([120.0, 90.0]))
    moves = _walk_past(np.array([60.0, 40.0]) + share * (200.0, 100.0))
    assert unless_it_moves(located, locate(stands), stands) is located
    found = unless_it_moves(located, locate(moves), moves)
    assert found.verdict == "cannot tell"
    assert "transmitter that moves" in found.reasons[0]
    two_modems = replace(moves, modem=np.arange(len(moves)) % 2)
    assert unless_it_moves(located, locate(moves), two_modems) is located
    in_order_of_rows = replace(moves, is_timed=False)
    assert unless_it_moves(located, locate(moves), in_order_of_rows) is located


def test_nothing_is_said_before_every_move_has_been_tried():
    obs = observations(*AROUND.T, -60.0 - 0.1 * np.round(AROUND[:, 0]), 4.0)
    posterior = locate(obs, Prior(), EFFORT)
    test = MotionTest()
    test.try_moves(obs, posterior, len(MOVES_M) - 1)
    assert test.division() is None
    test.try_moves(obs, posterior, 1)
    assert test.division() is not None
