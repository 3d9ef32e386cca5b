from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.special
import scipy.stats

from logger.core.locator.mixture import mixture
from logger.core.locator.position_evidence import (
    BlocksEvidence,
    PositionEvidence,
    with_possible_exponent,
)
from logger.core.locator.quadtree import Effort, PositionPrior, first_squares
from logger.core.locator.region import Squares, area_m2, highest_density
from logger.core.locator.search import Walk, coarse_search, refine, search_once, weigh_noise
from logger.core.locator.timing_advance import STEP_M, timing_of
from logger.core.model.blocks import blocks
from logger.core.model.evidence import Evidence
from logger.core.model.marginal import NODES, marginal, walk_sums
from logger.core.model.noise import matrices_of, whiteners
from logger.core.model.prior import REACHES, WHITE, Hypothesis, NoiseGroup, Prior, Reach, Station
from logger.core.places import Places
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import observations, simulate

SMALL = Prior(
    noise=noise_groups(Hypothesis(0.3, 30.0), trust=0.5),
    reach_m=400.0,
    reaches=(Reach(0.3, 40.0, 4.0), Reach(0.7, 100.0, 3.0)),
    stations=(Station(0.5, 5.0), Station(0.3, 20.0), Station(0.2, 2.0)),
)


def search_twice(fine, coarse, prior):
    task = Walk(fine, coarse, prior, Effort())
    tree = coarse_search(task)
    return refine(task, tree, weigh_noise(task, tree))


def walk(count=24, noise_db=3.0, seed=1):
    """A bend of 180 by 120 m; the transmitter is beside it."""
    s = np.linspace(0.0, 300.0, count)
    x, y = np.minimum(s, 180.0), np.maximum(s - 180.0, 0.0)
    level = (
        -35
        - 27 * np.log10(np.hypot(x - 110, y - 60))
        + noise_db * np.random.default_rng(seed).normal(size=count)
    )
    return observations(x, y, level, 3.0)


def log_p_of_exponent(found):
    """Of Phi((eta - 1) / .1) for eta of these means and variances."""
    return scipy.stats.norm.logcdf(found.theta[1] - 1.0, scale=np.sqrt(found.theta_cov[2] + 0.01))


def by_grid(obs, prior, most, step=5.0):
    """The same posterior on an even grid over the whole area; its middle points and their
    probability. Each station and each reach is evaluated everywhere, and mixed by its probability.
    """
    track = blocks(obs, most)
    found = whiteners(track, prior)
    log_det = np.array([[w.log_det] for w in found])
    middle = [0.5 * (np.min(v) + np.max(v)) for v in (track.places.x_m, track.places.y_m)]
    half = prior.reach_m + 0.5 * max(np.ptp(track.places.x_m), np.ptp(track.places.y_m))
    at = np.arange(-half + 0.5 * step, half, step)
    x, y = (v.ravel() for v in np.meshgrid(middle[0] + at, middle[1] + at))
    parts = []
    for i in range(0, len(x), 2000):
        of_stations = []
        for station in prior.stations:
            alone, places = prior.of_station(station), (x[i : i + 2000], y[i : i + 2000])
            total = walk_sums(track, matrices_of(found), alone, Places.of(*places))
            one = marginal(total, len(track), log_det, alone)
            of_stations.append(one.log_p + log_p_of_exponent(one))
        odds = np.array([one.probability for one in prior.stations])[:, None, None]
        parts.append(scipy.special.logsumexp(of_stations, axis=0, b=odds))
    nearest = np.min(np.hypot(x[:, None] - track.places.x_m, y[:, None] - track.places.y_m), axis=1)
    density = np.zeros(len(x))
    for one in prior.reaches:
        of_reach = np.maximum(nearest / one.flat_m, 1.0) ** -one.power
        density += one.probability * of_reach / np.sum(of_reach)
    log_prior = np.log(density)
    numbers = np.arange(len(found))
    return (
        x,
        y,
        mixture(np.concatenate(parts, axis=1), log_prior + 2.0 * np.log(step), numbers, prior),
    )


@cache
def both(count, most):
    """Tree and grid of one walk."""
    obs = walk(count, 0.6 * np.sqrt(count))
    fine = blocks(obs, 300)
    coarse = fine if most is None else blocks(obs, most)
    return search_twice(fine, coarse, SMALL), by_grid(obs, SMALL, 300)


def cells_of(tree, prior=SMALL):
    return Squares(tree.x_m, tree.y_m, tree.size_m, tree.mixture(prior).probability)


def held_by(cells, inside, parts=6):
    """Mass inside a region, cells across its border by the part of them that is inside."""
    off = (np.arange(parts) + 0.5) / parts - 0.5
    dx, dy = (v.ravel() for v in np.meshgrid(off, off))
    x, y = (v[:, None] + cells.size_m[:, None] * d for v, d in ((cells.x_m, dx), (cells.y_m, dy)))
    return float(np.sum(cells.probability * np.mean(inside(x, y), axis=1)))


WALKS = pytest.mark.parametrize(
    ("count", "most"), [(24, None), (120, 40)], ids=["small", "begun with fewer blocks"]
)


@WALKS
def test_mass_of_every_region_is_that_of_a_fine_grid(count, most):
    tree, (x, y, exact) = both(count, most)
    cells, p = cells_of(tree), exact.probability
    regions = {
        "west": lambda x, y: x < 100.0,
        "south": lambda x, y: y < 60.0,
        "around the truth": lambda x, y: np.hypot(x - 110.0, y - 60.0) < 30.0,
        "wider": lambda x, y: np.hypot(x - 110.0, y - 60.0) < 100.0,
        "far": lambda x, y: np.hypot(x - 110.0, y - 60.0) > 250.0,
    }
    for name, inside in regions.items():
        assert held_by(cells, inside) == pytest.approx(float(p[inside(x, y)].sum()), abs=0.02), name


@WALKS
def test_mean_spread_and_noise_are_those_of_a_fine_grid(count, most):
    tree, (x, y, exact) = both(count, most)
    p, q = tree.mixture(SMALL).probability, exact.probability
    spread_m = np.sqrt(q @ (x - q @ x) ** 2)
    assert (p @ tree.x_m, p @ tree.y_m) == pytest.approx((q @ x, q @ y), abs=0.05 * spread_m)
    assert np.sqrt(p @ (tree.x_m - p @ tree.x_m) ** 2) == pytest.approx(spread_m, rel=0.05)
    by_hypothesis = np.zeros(len(SMALL.hypotheses))
    by_hypothesis[tree.numbers] = tree.mixture(SMALL).by_hypothesis
    np.testing.assert_allclose(by_hypothesis, exact.by_hypothesis, atol=0.02)
    if most is None:
        assert tree.mixture(SMALL).log_evidence == pytest.approx(exact.log_evidence, abs=0.05)


@WALKS
def test_region_is_that_of_a_fine_grid(count, most):
    tree, (x, y, exact) = both(count, most)
    grid = Squares(x, y, np.full(len(x), 5.0), exact.probability)
    for level in (0.5, 0.95):
        assert area_m2(cells_of(tree), level) == pytest.approx(area_m2(grid, level), rel=0.1)


@WALKS
def test_leaves_tile_the_searched_area(count, most):
    tree, _ = both(count, most)
    side = np.sqrt(np.sum(tree.size_m**2))
    assert side == pytest.approx(2.0 * SMALL.reach_m + 180.0, abs=3.0)
    x_m, y_m = np.random.default_rng(2).uniform(-0.49 * side, 0.49 * side, (2, 200))
    for x, y in zip(x_m + 90.0, y_m + 60.0, strict=True):
        holds = (np.abs(tree.x_m - x) <= 0.5 * tree.size_m) & (
            np.abs(tree.y_m - y) <= 0.5 * tree.size_m
        )
        assert np.count_nonzero(holds) == 1


@pytest.mark.parametrize("shape", ["straight", "L", "random"])
@pytest.mark.parametrize("shadow_db", [0.0, 6.0])
def test_cells_are_at_most_half_the_posterior_sigma(shape, shadow_db):
    """Sigma of a round Gaussian whose densest half has the same area."""
    obs, _ = simulate(
        np.random.default_rng(5), shape, white_db=2.0, shadow_db=shadow_db, count=150, step=5.6
    )
    prior = Prior()
    tree = search_twice(blocks(obs, 300), blocks(obs, 80), prior)
    cells = cells_of(tree, prior)
    sigma_m = np.sqrt(area_m2(cells, 0.5) / (np.pi * 2.0 * np.log(2.0)))
    assert np.max(cells.size_m[highest_density(cells, 0.5)]) <= 0.5 * sigma_m


def test_no_plausible_noise_is_left_out_for_the_fewer_blocks_of_the_beginning():
    obs, _ = simulate(np.random.default_rng(7), "L", shadow_db=3.0, count=150, step=5.6)
    track, prior = blocks(obs, 300), Prior()
    shares = np.zeros((2, len(prior.hypotheses)))
    for share, coarse in zip(shares, (track, blocks(obs, 80)), strict=True):
        tree = search_twice(track, coarse, prior)
        share[tree.numbers] = tree.mixture(prior).by_hypothesis
    assert np.max(shares) < 0.9
    np.testing.assert_allclose(shares[1], shares[0], atol=0.06)


# --- the first cells ---


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_first_squares_are_small_near_the_walk_and_reach_the_end(share):
    track = blocks(walk(), 300)
    x, y, size = first_squares(track, Prior(), share)
    away = np.min(np.hypot(x[:, None] - track.places.x_m, y[:, None] - track.places.y_m), axis=1)
    assert np.all(size <= np.maximum(10.0, share * away) + 1e-9)
    assert np.sum(size**2) == pytest.approx((2.0 * Prior().reach_m + 180.0) ** 2, rel=1e-9)
    assert np.max(x + 0.5 * size) == pytest.approx(90.0 + 90.0 + Prior().reach_m)
    assert len(x) < 3000


def test_first_squares_on_a_ring_of_the_timing_advance_are_no_larger_than_its_step():
    track, with_ta = blocks(walk(), 300), replace(walk(), ta=np.full(24, 20))
    plain = first_squares(track, Prior(), 0.5)
    x, y, size = first_squares(track, Prior(), 0.5, timing_of(with_ta))
    away = np.hypot(x - 90.0, y - 60.0)
    ring = (away > 19.0 * STEP_M) & (away < 21.0 * STEP_M)
    assert np.max(size[ring]) <= STEP_M < np.max(plain[2])
    assert np.sum(size**2) == pytest.approx(np.sum(plain[2] ** 2))
    far = away > 24_000.0
    assert np.max(size[far]) > 4.0 * STEP_M


def test_the_prior_is_flat_nearby_and_falls_beyond():
    """The tree of one reach has its density: flat nearby, by the third power beyond."""
    prior = Prior(reaches=(Reach(1.0, 100.0, 3.0),), reach_m=2000.0)
    tree = search_once(blocks(observations([0.0], [0.0], [-70.0]), 300), prior)
    away = np.hypot(tree.x_m, tree.y_m)
    expected = -3.0 * np.log(np.maximum(away / 100.0, 1.0))
    np.testing.assert_allclose(
        tree.log_prior - tree.log_prior.max(), expected - expected.max(), atol=1e-9
    )


def test_each_reach_holds_its_probability():
    """Beside a single reading, by quadrature over the distance; the searched area has an end."""
    track = blocks(observations([0.0], [0.0], [-70.0]), 300)
    prior = Prior(reaches=REACHES["any"])
    squares = first_squares(track, prior, 0.1)
    position_prior = PositionPrior(track, prior, squares)
    mass = np.exp(position_prior.log_by_reach(squares) + 2.0 * np.log(squares[2]))
    odds = np.array([one.probability for one in prior.reaches])
    np.testing.assert_allclose(mass.sum(axis=1), odds, rtol=1e-9)
    total = np.exp(position_prior.log_density(squares)) @ squares[2] ** 2
    assert total == pytest.approx(odds.sum())
    away = np.hypot(*squares[:2])
    for one, share in zip(prior.reaches, mass, strict=True):
        alone = replace(prior, reaches=(one,))
        for level in (0.3, 0.6, 0.9):
            held = share[away < alone.radius_m(level)].sum() / share.sum()
            assert held == pytest.approx(level, abs=0.02), one


def test_the_density_hardly_depends_on_the_tiling():
    """Coarse squares and fine ones normalise a reach alike."""
    track = blocks(walk(), 300)
    at = np.array([[90.0, 300.0, -2000.0], [60.0, -80.0, 900.0], [1.0, 1.0, 1.0]])
    coarse, fine = (
        PositionPrior(track, Prior(), first_squares(track, Prior(), share)).log_by_reach(at)
        for share in (0.7, 0.1)
    )
    np.testing.assert_allclose(coarse, fine, atol=0.1, rtol=0.0)


# --- stations far from the walk, and those that the noise excludes ---

LONG = NoiseGroup(0.5, (Hypothesis(0.3, 10.0, 0.75, 350.0),), is_coarse=True)


def every_station(obs, prior, places):
    """Evidence of a walk at places (2, h), and each station's alone, everywhere."""
    track = blocks(obs, 300)
    noise = whiteners(track, prior)
    squares = np.vstack([places, np.ones(places.shape[1])])
    found, *alone = (
        BlocksEvidence.of(track, one, noise).evaluate(one, NODES, squares[:2], None)
        for one in (prior, *map(prior.of_station, prior.stations))
    )
    return found, np.stack([one.log_p for one in alone])


@pytest.mark.parametrize(
    ("eta", "sigma"), [(2.6, 0.2), (1.1, 0.3), (0.4, 0.25), (-1.0, 1.0), (0.9, 0.02)]
)
def test_probability_and_moments_of_a_possible_exponent_are_those_of_a_sum(eta, sigma):
    """Over P0 and eta that are normal together with a correlation of .7."""
    mean, sd = np.array([-40.0, eta]), np.array([8.0, sigma])
    covariance = np.outer(sd, sd) * np.array([[1.0, 0.7], [0.7, 1.0]])
    spread = covariance[[0, 0, 1], [0, 1, 1]]
    one = np.zeros((1, 1))
    found = with_possible_exponent(
        Evidence(one - 5.0, mean[:, None, None], spread[:, None, None], one + 4.0, one[None] + 1.0),
        1.0,
    )
    steps = np.linspace(-9.0, 9.0, 1201)
    p0, exponent = np.meshgrid(mean[0] + sd[0] * steps, mean[1] + sd[1] * steps)
    at = np.stack([p0.ravel(), exponent.ravel()])
    weight = scipy.stats.multivariate_normal(mean, covariance).pdf(at.T)
    weight /= np.sum(weight)
    weight *= scipy.stats.norm.cdf(at[1], 1.0, 0.1)
    np.testing.assert_allclose(found.log_p, -5.0 + np.log(np.sum(weight)), atol=1e-4)
    weight /= np.sum(weight)
    np.testing.assert_allclose(found.theta[:, 0, 0], at @ weight, rtol=1e-4)
    off = at - (at @ weight)[:, None]
    expected = (weight * off) @ off.T
    np.testing.assert_allclose(found.theta_cov[:, 0, 0], expected[[0, 0, 1], [0, 1, 1]], rtol=2e-3)


def test_far_from_the_walk_all_heights_share_the_evidence_of_the_first():
    """What this neglects decides nothing."""
    prior = replace(Prior(), noise=(*noise_groups(Hypothesis(0.3, 30.0)), LONG))
    places = np.random.default_rng(3).uniform(-400.0, 600.0, (2, 400))
    found, alone = every_station(walk(120), prior, places)
    with np.errstate(divide="ignore"):
        full = scipy.special.logsumexp(alone + prior.station_log_odds[..., None], axis=0)
    off = found.log_p - full
    print("largest difference of the shared evidence in nats:", np.abs(off).max().round(3))
    best = full.max(axis=1, keepdims=True)
    assert np.max(np.abs(off)[full > best - 6.0]) < 0.07
    np.testing.assert_allclose(found.station.sum(axis=0), 1.0)


def test_a_pattern_has_no_part_where_the_noise_has_none():
    prior = Prior(
        noise=(*noise_groups(Hypothesis(0.3, 30.0)), LONG),
        stations=(Station(0.7, 5.0), Station(0.3, 5.0, (9.3,))),
    )
    places = np.array([[110.0, 20.0], [60.0, -50.0]])
    found, alone = every_station(walk(60), prior, places)
    assert prior.hypotheses[0] == WHITE
    np.testing.assert_allclose(found.log_p[0], alone[0, 0], rtol=1e-12)
    np.testing.assert_array_equal(found.station[1, 0], 0.0)
    for k in (1, 2):
        mixed = scipy.special.logsumexp(alone[:, k], axis=0, b=[[0.7], [0.3]])
        np.testing.assert_allclose(found.log_p[k], mixed, rtol=1e-12)
        odds = np.exp(alone[1, k] + np.log(0.3) - mixed)
        np.testing.assert_allclose(found.station[1, k], odds, rtol=1e-9)


# --- effort ---


def test_less_effort_is_fewer_cells_and_much_the_same_answer():
    obs = walk(60)
    full = search_once(blocks(obs, 300), SMALL)
    effort = Effort(most_squares=500, split_share=0.02, nodes=3, first_share=1.0, densest=0)
    little = search_once(blocks(obs, 300), SMALL, effort)
    assert len(little.x_m) < 0.5 * len(full.x_m)
    p, q = (tree.mixture(SMALL).probability for tree in (little, full))
    spread_m = np.sqrt(q @ (full.x_m - q @ full.x_m) ** 2)
    assert p @ little.x_m == pytest.approx(q @ full.x_m, abs=0.2 * spread_m)
    assert p @ little.y_m == pytest.approx(q @ full.y_m, abs=0.2 * spread_m)


def test_cells_are_bounded():
    obs, _ = simulate(np.random.default_rng(6), "square", white_db=0.5, count=150, step=5.6)
    effort = Effort(most_squares=800)
    tree = search_once(blocks(obs, 300), Prior(), effort)
    first = first_squares(blocks(obs, 300), Prior(), effort.first_share).shape[1]
    assert len(tree.x_m) < first + 4 * effort.most_squares


def test_refining_keeps_what_the_coarse_search_has_computed(monkeypatch):
    """Long noise stays in the coarse blocks: its evidence at the same squares is the same."""
    obs, prior = walk(count=60), Prior(reach_m=400.0)
    fine, coarse = blocks(obs, 60), blocks(obs, 20)
    task = Walk(fine, coarse, prior, Effort(most_squares=500, nodes=7))
    tree = coarse_search(task)
    noise = weigh_noise(task, tree)
    assert [part.blocks for part in noise.parts] == [fine, coarse]
    where = PositionPrior(fine, prior, tree.squares)
    evidence = PositionEvidence(where, noise.parts, prior, task.effort.nodes, None, None)
    anew = evidence.leaves(tree.squares)
    evaluated = []

    def evaluate(part, *arguments):
        evaluated.append(part.blocks)
        return original(part, *arguments)

    original = BlocksEvidence.evaluate
    monkeypatch.setattr(BlocksEvidence, "evaluate", evaluate)
    kept = evidence.refine(tree, coarse)
    assert evaluated == [fine]
    np.testing.assert_array_equal(kept.numbers, anew.numbers)
    for one, other in zip(kept.evidence, anew.evidence, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
