import numpy as np
import pytest

from logger.core.certainty import OnMap
from logger.sim.walk import BLOCK_M, SHAPES, GuidedWalk, Walk, waypoints
from logger.sim.world import Radio, World

RNG = np.random.default_rng(0)
LENGTHS_M = {
    "straight": 200.0,
    "L": 400.0,
    "square": 800.0,
    "circle": 200.0 * np.pi,
    "random": 6 * 200.0,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_begin_at_the_origin_and_have_the_length_of_their_size(shape):
    walk = Walk(waypoints(shape, 200.0, RNG))

    assert walk.position(0.0) == (0.0, 0.0)
    assert walk.length_m == pytest.approx(LENGTHS_M[shape], rel=0.002)


def test_position_at_a_time_goes_round_the_corner_and_stops_at_the_end():
    walk = Walk(waypoints("L", 130.0, RNG), speed_mps=1.3)

    assert walk.duration_s == pytest.approx(200.0)
    assert walk.position(50.0) == pytest.approx((0.0, 65.0))
    assert walk.position(150.0) == pytest.approx((65.0, 130.0))
    assert walk.position(1e6) == pytest.approx((130.0, 130.0))
    assert walk.position(-1.0) == (0.0, 0.0)


def test_arrays_and_scalars_agree():
    walk = Walk(waypoints("circle", 100.0, RNG))
    t_s = np.linspace(-5.0, walk.duration_s + 5.0, 60).reshape(3, 20)

    east_m, north_m = walk.positions(t_s)

    assert east_m.shape == (3, 20)
    assert [walk.position(t) for t in t_s.flat] == list(zip(east_m.flat, north_m.flat, strict=True))


def test_speed_and_course_are_those_of_the_leg():
    walk = Walk(waypoints("square", 13.0, RNG), speed_mps=1.3)

    assert [walk.motion(t_s)[1] for t_s in (1.0, 11.0, 21.0, 31.0)] == [0.0, 90.0, 180.0, 270.0]
    assert [walk.motion(t_s)[0] for t_s in (-1.0, 0.0, 39.0, 41.0)] == [0.0, 1.3, 1.3, 0.0]


def test_circle_stays_on_its_radius():
    corners = np.array(waypoints("circle", 100.0, RNG))

    assert np.hypot(corners[:, 0] - 50.0, corners[:, 1]) == pytest.approx(50.0)


def test_random_walk_keeps_to_the_streets_of_its_quarter_and_never_turns_back():
    path = np.array(waypoints("random", 4 * BLOCK_M, np.random.default_rng(5)))

    assert np.abs(np.diff(path, axis=0)).sum(axis=1) == pytest.approx(BLOCK_M)
    assert path.min() >= 0.0
    assert path.max() <= 4 * BLOCK_M
    assert (path[2:] != path[:-2]).any(axis=1).all()


def test_random_walk_is_decided_by_its_generator():
    paths = [waypoints("random", 800.0, np.random.default_rng(seed)) for seed in (1, 1, 2)]

    assert paths[0] == paths[1]
    assert paths[0] != paths[2]


def test_unknown_shape_is_named():
    with pytest.raises(ValueError, match="'spiral'"):
        waypoints("spiral", 1.0, RNG)


def test_a_walk_that_is_led_goes_to_the_goal_and_else_along_its_waypoints():
    goals = {"now": None}
    corners = ((0.0, 0.0), (0.0, 13.0), (13.0, 13.0))
    world = World((), 47.0, 15.0, Radio(), ())
    walk = GuidedWalk(corners, world, lambda: goals["now"])
    assert walk.position(5.0) == pytest.approx((0.0, 6.5))
    assert walk.position(15.0) == pytest.approx((6.5, 13.0))  # round the corner
    lat_deg, lon_deg = world.to_latlon(6.5, 113.0)
    goals["now"] = OnMap(lat=lat_deg, lon=lon_deg)
    assert walk.position(36.0)[1] == pytest.approx(39.0, abs=2.7)
    assert walk.motion(36.0)[0] == 1.3
    assert walk.position(15.0) == pytest.approx((6.5, 13.0))  # what was, stays
    assert walk.position(200.0)[1] > 200.0  # past the goal it goes straight on


def test_every_leg_is_on_a_street_which_goes_on_beyond_the_walk():
    walk = Walk(((0.0, 0.0), (0.0, 100.0), (200.0, 100.0), (200.0, 0.0), (0.0, 0.0), (30.0, 40.0)))
    beyond_m = 5 * BLOCK_M
    assert walk.streets == (
        ((0.0, -beyond_m), (0.0, 100.0 + beyond_m)),
        ((-beyond_m, 100.0), (200.0 + beyond_m, 100.0)),
        ((200.0, -beyond_m), (200.0, 100.0 + beyond_m)),
        ((-beyond_m, 0.0), (200.0 + beyond_m, 0.0)),
        ((0.0, 0.0), (30.0, 40.0)),
    )
