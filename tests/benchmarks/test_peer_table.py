from math import inf

import numpy as np
import pytest

from benchmarks.scoreboard.answer import Disc, Ellipse95, Squares
from benchmarks.scoreboard.peer_table import peer_table
from benchmarks.scoreboard.peers import disc_of_observables
from benchmarks.scoreboard.score import DISC, LEAST_SQUARES, OURS, STRONGEST, Score
from benchmarks.scoreboard.traces import SUNLAB
from benchmarks.scoreboard.world import Walk, World
from tests.kit.walk_scores import scored_walk


def score(method, world, error_m, **more):
    return Score(method, 0, error_m, world=world, extent_m=400.0, seconds=0.25, **more)


def test_one_line_for_each_method_of_a_group():
    flight, street = "aerpaw_afar_uav/day_1_walk", "powder_frs462/day_1_walk"
    scores = {
        "real-A": {
            STRONGEST: [score(STRONGEST, flight, 50.0), score(STRONGEST, street, 10.0)],
            LEAST_SQUARES: [
                score(LEAST_SQUARES, flight, inf, covered=False, failure="diverged"),
                score(LEAST_SQUARES, street, 30.0, covered=True, r95_m=150.0),
            ],
            SUNLAB: [Score(SUNLAB, 0, 57.0, world=flight)],
        }
    }
    measured = [
        scored_walk(campaign="aerpaw_afar_uav", error_m=90.0, r95_m=150.0),
        scored_walk(campaign="powder_frs462", error_m=20.0, r95_m=201.0, covered=False),
        scored_walk("not_tried"),
    ]
    table, _ = peer_table(measured, scores)
    lines = {line[:2]: line[2:] for line in table.lines}
    assert lines["all", STRONGEST] == ("2", "30.0", "-", "-", "0.250")
    assert lines["all", LEAST_SQUARES] == ("2", "inf", "0.50", "0.50", "0.250")
    assert lines["all", OURS] == ("2", "55.0", "0.50", "0.50", "0.100")
    assert lines["powder_frs462", OURS][3] == "0.00"  # its radius is more than half of 400 m
    assert lines[flight, SUNLAB] == ("1", "57.0", "-", "-", "-")
    assert ("all", SUNLAB) not in lines
    assert [line[0] for line in table.lines][-1] == "powder_frs462"


def test_without_other_methods_there_is_no_table():
    assert peer_table([scored_walk()], {}) == []


def test_radii_reach_the_farthest_point():
    assert Disc((0.0, 0.0), 10.0).radius_m((3.0, 4.0)) == 15.0
    ellipse = Ellipse95((0.0, 0.0), np.diag([4.0, 1.0]))
    assert ellipse.radius_m((0.0, 0.0)) == pytest.approx(2.0 * 2.4477, abs=0.001)
    assert Squares(np.array([3.0]), np.array([4.0]), np.array([2.0])).radius_m(
        (0.0, 0.0)
    ) == pytest.approx(5.0 + 2.0**0.5)


def test_the_disc_holds_what_the_observables_hold():
    x_m = np.linspace(-300.0, 300.0, 100)
    walk = Walk(x_m, np.zeros(100), -40.0 - 30.0 * np.log10(np.hypot(x_m, 30.0)))
    answer = disc_of_observables(World(walk, walk, ((0.0, 30.0),), position_sigma_m=0.0))
    assert abs(answer.x_m) < 4.0
    # the log of the distance is normal about a line: exp(2.80 + .68 ln spread - .022 dB, .94)
    top = np.abs(x_m[walk.level_dbm > walk.level_dbm.max() - 10.0])
    spread_m = np.sqrt(np.mean(top**2))
    above_db = walk.level_dbm.max() - np.median(walk.level_dbm)
    middle = 2.80 + 0.68 * np.log(spread_m) - 0.022 * above_db
    assert answer.region.within_m == pytest.approx(np.exp(middle + 1.645 * 0.94), rel=0.05)
    assert DISC == "disc of the observables"
