from dataclasses import replace

import numpy as np
import pytest

from logger.core.locator.pipeline import locate
from logger.core.locator.preparation import (
    COARSE_BLOCKS,
    MOST_MODEMS,
    of_most_heard_modems,
    prepare,
)
from logger.core.locator.quadtree import Effort
from logger.core.model.prior import Prior
from tests.kit.walks import censor_at_floor, observations, simulate


@pytest.mark.parametrize("n_modems", [1, 2])
@pytest.mark.parametrize("count", [COARSE_BLOCKS - 20, COARSE_BLOCKS + 20])
def test_a_walk_in_few_blocks_is_searched_once_whatever_the_modems(count, n_modems):
    x = 10.0 * np.arange(count)
    obs = observations(x, 0.0 * x, -70.0 - 0.1 * np.arange(count))
    if n_modems == 2:
        obs = replace(obs, modem=np.arange(count) % 2)
    walk = prepare(obs, Prior(reach_m=2000.0), Effort()).walk
    assert walk.is_searched_twice == (count > COARSE_BLOCKS)


@pytest.mark.parametrize("more", [0, 3])
def test_the_coarse_blocks_are_of_as_many_grids_as_the_effort_says(more):
    x = 10.0 * np.arange(100)
    obs = observations(x, 0.0 * x, -70.0 - 0.1 * np.arange(100))
    walk = prepare(obs, Prior(), Effort(more_grids=more)).walk
    assert len(walk.shifted) == more
    assert not walk.fine_shifted  # each reading has a block of its own


@pytest.mark.parametrize(("more", "grids"), [(0, 0), (3, 1)])
def test_blocks_of_several_readings_are_of_another_grid_too(more, grids):
    x = 2.0 * np.arange(900)
    obs = observations(x, 0.0 * x, np.maximum(-70.0 - 0.1 * np.arange(900), -110.0))
    obs = replace(obs, known_limit=-1 * (obs.level_dbm <= -110.0), modem=np.arange(900) % 2)
    walk = prepare(obs, Prior(reach_m=2000.0), Effort(more_grids=more)).walk
    assert len(walk.fine_shifted) == grids
    for one in walk.fine_shifted:
        assert one.censored is walk.blocks.censored
        assert not np.array_equal(one.places.x_m, walk.blocks.places.x_m)


@pytest.mark.parametrize("spike_db", [30.0, -30.0])
@pytest.mark.parametrize("seed", [3, 5, 6])
def test_one_gross_error_moves_nothing(seed, spike_db):
    obs, source = simulate(np.random.default_rng(seed), "random", count=400)
    at = int(np.argmax(np.hypot(obs.x_m - source[0], obs.y_m - source[1])))
    level_dbm = obs.level_dbm.copy()
    level_dbm[at] += spike_db
    wrong = replace(obs, level_dbm=level_dbm)
    plain, found = locate(obs), locate(wrong)
    assert [spike.k for spike in wrong.spikes] == [at]
    assert np.hypot(found.x_m - plain.x_m, found.y_m - plain.y_m) < 3.0
    assert found.region_area_m2 < 2.0 * plain.region_area_m2
    assert found.r95_m < 1.4 * plain.r95_m


def test_an_error_does_not_hide_the_floor_of_the_scale():
    obs, _ = simulate(np.random.default_rng(2), "square", count=400)
    obs = censor_at_floor(replace(obs, rat=None), 0.5)
    level_dbm = obs.level_dbm.copy()
    level_dbm[100] -= 60.0
    assert np.count_nonzero(replace(obs, level_dbm=level_dbm).usable().limit == -1) >= 190


def test_spikes_are_sought_in_the_walk_of_each_modem():
    obs, _ = simulate(np.random.default_rng(1), "L", count=400)
    modem = np.arange(400) % 2
    level_dbm = obs.level_dbm + 30.0 * modem
    assert replace(obs, level_dbm=level_dbm, modem=modem).spikes == ()
    level_dbm[101] += 30.0
    (spike,) = replace(obs, level_dbm=level_dbm, modem=modem).spikes
    assert (spike.k, spike.scan_seq, spike.t_ns) == (101, 101, 101 * 10**9)
    assert spike.above_db == pytest.approx(30.0, abs=9.0)


@pytest.mark.parametrize("clipped", [0.0, 0.4])
def test_more_modems_than_blocks_are_located_by_those_heard_most(clipped):
    obs, source = simulate(np.random.default_rng(4), "square", count=1200)
    obs = censor_at_floor(obs, clipped)
    modem = np.repeat(np.arange(120), 10)
    rng = np.random.default_rng(5)
    level_dbm = obs.level_dbm + np.where(obs.limit == 0, rng.normal(0.0, 2.0, 120)[modem], 0.0)
    many = replace(obs, level_dbm=level_dbm, modem=modem, known_limit=obs.limit)
    posterior = locate(many)
    heard_least = ~np.isin(np.arange(120), of_most_heard_modems(many).modem)
    heard_least[0] = False  # offsets are against the first
    assert posterior.offsets.mean_db[heard_least] == pytest.approx(0.0)
    usual_db = 2.0**0.5 * Prior().offset_sigma_db
    assert posterior.offsets.sigma_db[heard_least] == pytest.approx(usual_db, rel=0.25)
    assert np.hypot(posterior.x_m - source[0], posterior.y_m - source[1]) < posterior.r95_m


def test_modems_heard_most_have_the_most_levels_within_their_scale():
    obs, _ = simulate(np.random.default_rng(4), "square", count=1200)
    modem = np.concatenate([np.repeat(np.arange(30), 20), np.full(600, 30)])
    at_floor = np.where(modem == 30, -1, 0)
    kept = of_most_heard_modems(replace(obs, modem=modem, known_limit=at_floor))
    assert np.unique(kept.modem).tolist() == list(range(MOST_MODEMS))
    few = replace(obs, modem=modem % MOST_MODEMS)
    assert of_most_heard_modems(few) is few
