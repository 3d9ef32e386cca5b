import numpy as np
import pytest
import shapely

from benchmarks.scoreboard import facts
from benchmarks.scoreboard.answer import Answer, Ellipse95, Mode, Squares, gaussian
from benchmarks.scoreboard.world import Walk, World


def test_ellipse_holds_95_percent():
    covariance = np.array([[40.0, 12.0], [12.0, 9.0]])
    region = Ellipse95((5.0, -2.0), covariance)
    drawn = np.random.default_rng(1).multivariate_normal((5.0, -2.0), covariance, 2000)
    assert np.mean([region.holds(tuple(place), 0.0) for place in drawn]) == pytest.approx(
        0.95, abs=0.02
    )


def test_slack_of_an_ellipse_is_a_distance():
    region = Ellipse95((0.0, 0.0), np.diag([16.0, 1.0]))
    east_m = 4.0 * np.sqrt(5.991)
    assert region.holds((east_m + 4.9, 0.0), 5.0)
    assert not region.holds((east_m + 5.1, 0.0), 5.0)


def test_squares_agree_with_shapely():
    rng = np.random.default_rng(2)
    x_m, y_m, size_m = rng.uniform(0, 50, 30), rng.uniform(0, 50, 30), rng.uniform(1, 8, 30)
    whole = shapely.union_all(
        shapely.box(x_m - size_m / 2, y_m - size_m / 2, x_m + size_m / 2, y_m + size_m / 2)
    )
    region = Squares(x_m, y_m, size_m)
    for place in rng.uniform(-10, 60, (200, 2)):
        assert region.holds(tuple(place), 3.0) == (whole.distance(shapely.Point(place)) <= 3.0)


def test_a_common_corner_of_squares_is_in_them():
    corner = 691_600.1, 5_333_000.7
    offset_m = 14.892578065686848 / 2.0
    x_m, y_m = corner[0] - offset_m * np.ones(1), corner[1] - offset_m * np.ones(1)
    region = Squares(x_m, y_m, np.full(1, 2.0 * offset_m - 1e-9))
    assert region.holds(corner, 0.0)
    assert not region.holds((corner[0] + 1e-3, corner[1]), 0.0)


def test_no_covariance_no_answer():
    with pytest.raises(ValueError, match="not positive"):
        gaussian(np.zeros(4), np.diag([1.0, -1.0, 1.0, 1.0]))
    with pytest.raises(ValueError, match="diverged"):
        gaussian(np.array([np.nan, 0.0, 0.0, 0.0]), np.eye(4))


# --- facts ---


def round_(x_m, y_m, sigma_m):
    return Mode(x_m, y_m, sigma_m**2 * np.eye(2), 0.5)


def answer_with(modes, verdict="ambiguous", radius_m=10.0, fits=True):
    region = Squares(*np.array([(mode.x_m, mode.y_m, radius_m) for mode in modes]).T)
    return Answer(modes[0].x_m, modes[0].y_m, tuple(modes), region, verdict, fits)


def world_with(**about):
    walk = Walk(np.linspace(-100.0, 100.0, 50), np.zeros(50), np.full(50, -80.0))
    return World(walk, walk, **{"sources": ((0.0, 50.0),)} | about)


def test_twin_has_to_be_told():
    world = world_with(mirror=(0.0, -50.0))
    good = facts.facts_of(world, answer_with([round_(0, 49, 5), round_(0, -51, 5)]))
    assert all(good.values())
    assert len(good) == 4
    lone = facts.facts_of(world, answer_with([round_(0, -48, 5)], "located"))
    assert lone[facts.MIRROR_INSIDE]
    assert not lone[facts.BOTH_LISTED]
    assert not lone[facts.PAIRED]
    assert not lone[facts.NOT_ONE_PLACE]
    one_wide_place = [round_(0, 0, 60)]
    assert facts.facts_of(world, answer_with(one_wide_place, "cannot tell", radius_m=200.0))[
        facts.NOT_ONE_PLACE
    ]
    assert not facts.facts_of(world, answer_with(one_wide_place, "located", radius_m=200.0))[
        facts.NOT_ONE_PLACE
    ]
    assert not facts.facts_of(world, answer_with(one_wide_place, "cannot tell", radius_m=60.0))[
        facts.NOT_ONE_PLACE
    ]


def test_places_that_noise_has_moved_are_a_pair_still():
    transformed = [round_(60, 40, 5), round_(60, -41, 5)]
    found = facts.facts_of(world_with(mirror=(0.0, -50.0)), answer_with(transformed))
    assert found[facts.PAIRED]
    assert not found[facts.BOTH_LISTED]
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    walk = Walk(100.0 * np.cos(angle), 100.0 * np.sin(angle), np.full(60, -80.0))
    ring = World(walk, walk, ((0.0, 50.0),), mirror=(0.0, 200.0))
    assert facts.facts_of(ring, answer_with([round_(25, 0, 5), round_(400, 0, 5)]))[facts.PAIRED]
    assert not facts.facts_of(ring, answer_with([round_(25, 0, 5), round_(0, 400, 5)]))[
        facts.PAIRED
    ]


def test_two_sources():
    world = world_with(sources=((-100.0, 50.0), (100.0, 50.0)))
    between = facts.facts_of(world, answer_with([round_(0, 50, 5)], "located"))
    assert not between[facts.REPORTED_NOT_TO_FIT]
    assert not between[facts.NOT_BETWEEN]
    assert all(
        facts.facts_of(world, answer_with([round_(0, 50, 5)], "does not fit", fits=False)).values()
    )
