import pickle

import numpy as np
import pytest

from benchmarks.scoreboard import worlds
from benchmarks.scoreboard.cases import CASES, WHITE, generator
from benchmarks.scoreboard.walks import SHAPES, TELLING
from benchmarks.scoreboard.world import Noise

SIMULATED = [name for name in CASES if not name.startswith("real")]


def distance_m(walk, place):
    return np.hypot(walk.x_m - place[0], walk.y_m - place[1])


@pytest.mark.parametrize("shape", SHAPES)
def test_walks_go_at_an_even_pace(shape):
    x_m, y_m = SHAPES[shape](np.random.default_rng(1), 600, 1.4)
    assert len(x_m) == len(y_m) == 600
    steps_m = np.hypot(np.diff(x_m), np.diff(y_m))
    assert np.quantile(steps_m, 0.05) == pytest.approx(1.4, rel=0.01)
    assert np.max(steps_m) < 1.401


@pytest.mark.parametrize("name", SIMULATED)
def test_a_run_is_the_same_for_the_same_numbers(name):
    one, again, other = CASES[name].world(3, 5), CASES[name].world(3, 5), CASES[name].world(3, 9)
    assert pickle.dumps(one) == pickle.dumps(again)
    assert one.sources != other.sources or not np.array_equal(
        one.walk.level_dbm, other.walk.level_dbm
    )


@pytest.mark.parametrize("shape", TELLING)
def test_source_is_beside_the_walk(shape):
    for run in range(20):
        world = worlds.plain(generator("beside", 1, run), shape, WHITE)
        assert 25.0 <= np.min(distance_m(world.walk, world.sources[0])) <= 200.0


@pytest.mark.parametrize("in_plane", [True, False])
def test_noise_has_the_covariance_that_the_oracle_is_told(in_plane):
    noise = Noise(1.0, 6.0, 15.0, in_plane=in_plane, step_db=1.0)
    squared_db2 = []
    # neighbours on the path, and the two ends of the closed walk: those are neighbours in the plane
    # only
    pairs = (
        np.array([(0, 5), (100, 105), (200, 205), (300, 305), (450, 455)]),
        np.array([(3, 597), (5, 595)]),
    )
    for run in range(50):
        world = worlds.plain(generator("noise", 1, run), "square", noise)
        loss_db = 10.0 * np.log10(distance_m(world.walk, world.sources[0]))
        residual_db = world.walk.level_dbm + world.eta * loss_db
        squared_db2.append(
            [np.mean((residual_db[p[:, 0]] - residual_db[p[:, 1]]) ** 2) for p in pairs]
        )
    covariance_db2 = noise.covariance_db2(*SHAPES["square"](np.random.default_rng(0), 600, 1.4))
    expected = [
        np.mean(
            covariance_db2[p[:, 0], p[:, 0]]
            + covariance_db2[p[:, 1], p[:, 1]]
            - 2.0 * covariance_db2[p[:, 0], p[:, 1]]
        )
        for p in pairs
    ]
    np.testing.assert_allclose(np.mean(squared_db2, axis=0), expected, rtol=0.3)
    assert (expected[1] > 1.5 * expected[0]) == (not in_plane)


def test_shadowing_of_two_scales_has_a_short_and_a_long_part():
    noise = Noise(0.0, 7.0, 20.0, in_plane=True, long_share=0.75, long_m=300.0)
    x_m = np.array([0.0, 100.0, 5000.0])
    covariance_db2 = noise.shadowing_db2(x_m, np.zeros(3))
    assert covariance_db2[0, 0] == pytest.approx(49.0)
    expected = 49.0 * (0.25 * np.exp(-5.0) + 0.75 * np.exp(-1.0 / 3.0))
    assert covariance_db2[0, 1] == pytest.approx(expected)
    assert covariance_db2[0, 2] < 1e-3


def test_a_sector_antenna_loses_25_db_at_its_back():
    loss_db = -worlds.sector_pattern_db(np.array([0.0, 32.5, -32.5, 392.5, 180.0]))
    np.testing.assert_allclose(loss_db, [0.0, 3.0, 3.0, 3.0, 25.0])
    world = worlds.plain(generator("sector", 1, 0), "square", Noise(0.0, 1.0, 15.0, step_db=1.0))
    past = worlds.with_sector_antenna(np.random.default_rng(1), world)
    lost_db = world.walk.level_dbm - past.walk.level_dbm
    assert 0.0 <= np.min(lost_db) < np.max(lost_db) <= 25.0
    np.testing.assert_array_equal(lost_db, np.round(lost_db))
    assert past.sources == world.sources


@pytest.mark.parametrize("shape", ["straight", "circle"])
def test_the_twin_fits_equally_well(shape):
    for run in range(5):
        world = worlds.plain(generator("twin", 1, run), shape, WHITE)
        ratio = distance_m(world.walk, world.sources[0]) / distance_m(world.walk, world.mirror)
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
        assert distance_m(world.walk, world.mirror).min() > 1.0


@pytest.mark.parametrize("share", [0.2, 0.45, 0.7])
def test_this_share_is_clipped(share):
    world = worlds.clipped_world(generator("clip", 1, 0), "L", share, WHITE)
    assert np.mean(world.walk.level_dbm == -110.0) == pytest.approx(share, abs=0.01)
    assert np.mean(world.whole.level_dbm <= -110.0) == pytest.approx(share, abs=0.01)
    assert np.min(world.whole.level_dbm) < -112.0
    uncensored = world.walk.level_dbm > -110.0
    np.testing.assert_array_equal(
        world.walk.level_dbm[uncensored], world.whole.level_dbm[uncensored]
    )


@pytest.mark.parametrize(
    ("kind", "memory"), [("white", 0.0), ("slow", np.exp(-1 / 60)), ("constant", 1.0)]
)
def test_position_error(kind, memory):
    runs = [worlds.with_gps_errors(generator("gps", 1, run), "square", kind) for run in range(100)]
    off_m = np.array([world.walk.x_m - world.whole.x_m for world in runs])
    assert np.std(off_m[:, 300]) == pytest.approx(5.0, rel=0.25)
    assert np.mean(off_m[:, 300] * off_m[:, 301]) / np.mean(off_m[:, 300] ** 2) == pytest.approx(
        memory, abs=0.25
    )
    assert all(15.0 <= np.min(distance_m(world.whole, world.sources[0])) <= 40.0 for world in runs)


def test_two_sources_are_both_passed_and_heard():
    for run, shape in enumerate(TELLING):
        world = worlds.shared_identity(generator("two", 1, run), shape)
        one, other = world.sources
        assert 200.0 <= np.hypot(one[0] - other[0], one[1] - other[1]) <= 500.0
        assert all(
            25.0 <= np.min(distance_m(world.walk, source)) <= 60.0 for source in world.sources
        )


def test_the_specifications_circle():
    world = worlds.specified_scenario(generator("spec", 1, 0), 20, spread=False)
    np.testing.assert_allclose(distance_m(world.walk, world.sources[0]), 500.0)
    apart_m = np.hypot(np.diff(world.walk.x_m), np.diff(world.walk.y_m))
    np.testing.assert_allclose(apart_m, 1000.0 * np.sin(np.pi / 50.0))
