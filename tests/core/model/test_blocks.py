from dataclasses import replace

import numpy as np
import pytest

from logger.core.model.blocks import FINEST_BLOCK_M, Censored, blocks, in_fewer_places, squares
from logger.core.places import Places
from tests.kit.walks import FLOOR_DBM, observations

MOST = 300


def street(count=100, step=3.0):
    x = np.arange(count) * step
    return observations(x, 0 * x, -80 - x / 10)


@pytest.mark.parametrize("most", [1, 30, 300])
def test_blocks_are_bounded_and_keep_every_reading(most):
    rng = np.random.default_rng(3)
    x, y = np.cumsum(rng.normal(size=(2, 200_000)), axis=1)
    level = rng.normal(-80, 5, 200_000)
    track = blocks(observations(x, y, level), most)
    assert 0.4 * most <= len(track) <= most
    assert track.readings.sum() == 200_000
    for ours, each in ((track.places.x_m, x), (track.places.y_m, y), (track.level_dbm, level)):
        assert ours @ track.readings / 200_000 == pytest.approx(each.mean(), abs=1e-6)


def test_a_block_is_no_larger_than_its_side():
    rng = np.random.default_rng(4)
    x, y = rng.uniform(0, 500, (2, 5000))
    track = blocks(observations(x, y, rng.normal(-80, 5, 5000)), MOST)
    counts = np.diff(np.append(track.first, len(track.points.x_m)))
    which = np.repeat(np.arange(len(track)), counts)
    for points in (track.points.x_m, track.points.y_m):
        spans = [np.ptp(points[which == k]) for k in range(len(track))]
        assert max(spans) <= track.size_m
    np.testing.assert_allclose(np.bincount(which, track.weight), 1.0)


def test_blocks_are_as_fine_as_their_number_allows():
    assert blocks(street(), MOST).size_m == FINEST_BLOCK_M
    assert len(blocks(street(), MOST)) == 100
    assert blocks(street(400), MOST).size_m > FINEST_BLOCK_M


def test_walking_a_street_twice_adds_no_block():
    there = street()
    x, level = there.x_m, there.level_dbm
    back = observations(np.append(x, x[-2::-1]), np.zeros(199), np.append(level, level[-2::-1]))
    once, twice = blocks(there, MOST), blocks(back, MOST)
    np.testing.assert_allclose(twice.places.x_m, once.places.x_m)
    np.testing.assert_allclose(twice.level_dbm, once.level_dbm)
    np.testing.assert_array_equal(twice.readings[:-1], 2 * once.readings[:-1])


def test_a_level_that_is_repeated_in_one_square_counts_once():
    level = np.array([-80.0, -80.0, -80.0, -81.0, -80.0, -70.0, -70.0])
    x = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 500.0, 500.0])
    track = blocks(observations(x, 0 * x, level), MOST)
    assert track.readings.tolist() == [3.0, 1.0]
    by_modem = replace(observations(0 * x, 0 * x, level), modem=np.arange(7) % 2)
    assert blocks(by_modem, MOST).readings.tolist() == [2.0, 3.0]


def test_standing_still_is_one_block():
    """Also where the receiver trembles by a few decimetres."""
    rng = np.random.default_rng(5)
    x, y = 0.1 * rng.normal(size=(2, 1000))
    assert len(blocks(observations(x, y, rng.normal(-80, 5, 1000)), MOST)) == 1


def test_a_straight_street_is_one_row_of_blocks():
    """Also where the receiver trembles by a few decimetres across the street."""
    rng = np.random.default_rng(6)
    x = np.arange(100) * 6.0
    assert (
        len(blocks(observations(x, 0.1 * rng.normal(size=100), rng.normal(-80, 5, 100)), MOST))
        == 100
    )
    assert (
        len(
            blocks(
                observations(np.repeat(x, 2), 0.1 * rng.normal(size=200), np.full(200, -80.0)), MOST
            )
        )
        == 100
    )


def test_the_error_of_the_receiver_is_the_root_mean_square_of_a_block():
    obs = observations([0.0, 0.0, 50.0], [0.0, 0.0, 0.0], [-80.0, -82.0, -84.0])
    obs.position_sigma_m[:] = [3.0, 4.0, 5.0]
    assert blocks(obs, MOST).places.sigma_m.tolist() == pytest.approx([np.sqrt(12.5), 5.0])


def test_readings_at_the_end_of_the_scale_are_gathered_apart():
    x = np.repeat(np.arange(30) * 10.0, 4)
    level = np.where(x < 150.0, -90.0 + x / 20.0 + 0.1 * (np.arange(120) % 2), FLOOR_DBM)
    level[0] = -47.0
    track = blocks(observations(x, 0 * x, level), MOST)
    assert len(track) == 15
    assert track.readings.sum() == 59
    gone = track.censored
    assert sorted(
        zip(gone.side.tolist(), gone.limit_dbm.tolist(), gone.readings.tolist(), strict=True)
    ) == [
        *[(-1.0, FLOOR_DBM, 4.0)] * 15,
        (1.0, -47.0, 1.0),
    ]
    assert gone.places.x_m[gone.side > 0].tolist() == [0.0]


def test_readings_at_the_end_of_the_scale_are_bounded_too():
    rng = np.random.default_rng(7)
    x, y = rng.uniform(0, 5000, (2, 20_000))
    level = np.where(rng.random(20_000) < 0.5, FLOOR_DBM, np.round(rng.normal(-80, 3, 20_000)))
    gone = blocks(observations(x, y, level), MOST).censored
    assert len(gone.places.x_m) <= 100
    assert gone.readings.sum() == np.count_nonzero(level == FLOOR_DBM)


def test_without_an_end_of_the_scale_nothing_is_apart():
    assert len(blocks(street(), MOST).censored.places) == 0


def test_neighbours_at_the_end_of_the_scale_become_one_place_and_none_is_lost():
    x = np.concatenate([np.arange(60) * 5.0, np.arange(20) * 5.0])
    side = np.where(np.arange(80) < 60, -1.0, 1.0)
    gone = Censored(
        Places.of(x, 0 * x), np.where(side < 0, FLOOR_DBM, -47.0), side, np.arange(80) % 3 + 1.0
    )
    fewer = in_fewer_places(gone, 15)
    for end in (-1.0, 1.0):
        before, after = gone.side == end, fewer.side == end
        assert np.count_nonzero(after) <= 15
        assert fewer.readings[after].sum() == gone.readings[before].sum()
        middle = np.average(gone.places.x_m[before], weights=gone.readings[before])
        assert np.average(fewer.places.x_m[after], weights=fewer.readings[after]) == pytest.approx(
            middle
        )
        assert np.unique(fewer.limit_dbm[after]) == gone.limit_dbm[before][0]


def test_more_modems_than_squares_have_one_each():
    x_m, y_m = np.random.default_rng(1).uniform(0.0, 500.0, (2, 300))
    modem = np.arange(300) % 30
    number, side_m = squares(Places.of(x_m, y_m), 20, modem)
    assert len(np.unique(number)) == 30
    assert all(len(np.unique(modem[number == k])) == 1 for k in range(30))
    assert side_m > 500.0
