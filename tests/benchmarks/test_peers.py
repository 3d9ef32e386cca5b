from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scoreboard import filters, model_free, peers, worlds
from benchmarks.scoreboard.cases import WHITE, generator
from benchmarks.scoreboard.score import EXACT, LEAST_SQUARES, OURS, STRONGEST, score
from benchmarks.scoreboard.world import Noise, Walk

EASY = worlds.plain(generator("easy", 1, 4), "square", Noise(0.2))
START_BESIDE = worlds.plain(generator("easy", 1, 4), "square", WHITE)


def test_least_squares_finds_an_easy_source():
    found = peers.least_squares_fit(EASY.walk)
    assert EASY.error_m((found.x_m, found.y_m)) < 3.0
    assert found.region.area_m2 < 100.0


def test_least_squares_is_as_sure_as_it_is_good():
    nees = []
    for run in range(16):
        world = worlds.plain(generator("honest", 1, run), "square", Noise(0.5))
        nees.append(peers.least_squares_fit(world.walk).modes[0].nees(world.sources[0]))
    assert 0.4 < np.mean(nees) / 2.0 < 1.9  # 16 runs: 99.9 %


def test_jacobian_agrees_with_central_differences():
    state = np.array([*np.add(EASY.sources[0], (5.0, -3.0)), -30.0, 3.0])
    step = 1e-3 * np.eye(4)
    slope = [
        (peers._residuals(state + d, EASY.walk, 3.0) - peers._residuals(state - d, EASY.walk, 3.0))
        / 2e-3
        for d in step
    ]
    np.testing.assert_allclose(
        peers._jacobian(state, EASY.walk, 3.0), np.column_stack(slope), rtol=1e-4, atol=1e-6
    )


@pytest.mark.parametrize("peer", [filters.extended_kalman_filter, filters.unscented_kalman_filter])
def test_filters_agree_with_least_squares_from_a_good_start(monkeypatch, peer):
    expected = peers.least_squares_fit(EASY.walk)
    start = np.array([expected.x_m + 5.0, expected.y_m - 5.0, -40.0, 2.6])
    monkeypatch.setattr(filters, "_start", lambda _: (start, np.diag([100.0, 100.0, 900.0, 0.81])))
    found = peer(EASY)
    sigma_m = np.sqrt(np.trace(expected.modes[0].covariance))
    assert np.hypot(found.x_m - expected.x_m, found.y_m - expected.y_m) < 2.0 * sigma_m
    assert found.region.area_m2 == pytest.approx(expected.region.area_m2, rel=0.5)


def test_reference_stays_where_it_starts():
    found = filters.reference(START_BESIDE)
    assert START_BESIDE.error_m((found.x_m, found.y_m)) > 50.0


def test_model_free_peers():
    walk = Walk(
        np.array([0.0, 10.0, 20.0]), np.array([0.0, 0.0, 5.0]), np.array([-90.0, -60.0, -60.0])
    )
    strongest = model_free.strongest_sample(walk)
    centroid = model_free.weighted_centroid(walk)
    assert (strongest.x_m, strongest.y_m) == (15.0, 2.5)
    assert (centroid.x_m, centroid.y_m) == pytest.approx((15.0, 2.5), abs=0.02)


def test_what_fails_is_counted():
    few = Walk(np.zeros(3), np.zeros(3), np.full(3, -80.0))
    found = score(replace(EASY, walk=few, whole=few), LEAST_SQUARES, 7)
    assert (found.run, found.error_m, found.covered) == (7, np.inf, False)
    assert found.failure


def test_scores_of_one_world():
    ours, limit, strongest = (score(EASY, method, 0) for method in (OURS, EXACT, STRONGEST))
    assert max(ours.error_m, limit.error_m) < 15.0 < strongest.error_m
    assert ours.covered
    assert limit.nees < 20.0
    assert limit.area_m2 < ours.area_m2
    assert ours.verdict
    assert ours.places >= 1
    assert strongest.covered is strongest.area_m2 is strongest.nees is strongest.places is None
