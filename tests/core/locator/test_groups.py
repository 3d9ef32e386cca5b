from dataclasses import fields, replace

import numpy as np
import pytest
import scipy.integrate
import scipy.stats

from logger.core.locator.offsets import first_look, offsets
from logger.core.locator.pipeline import locate
from logger.core.locator.preparation import COARSE_BLOCKS
from logger.core.locator.quadtree import Tree
from logger.core.model.blocks import blocks
from logger.core.model.evidence import Evidence
from logger.core.model.marginal import marginal, walk_sums
from logger.core.model.noise import matrices_of, whiteners
from logger.core.model.prior import Hypothesis, Prior, Station
from logger.core.places import Places
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import observations, path, region_contains

PRIOR = Prior(noise=noise_groups(Hypothesis(0.3, 30.0)), stations=(Station(1.0, 5.0),))
NOISES = [(1.0, 0.0), (0.3, 30.0)]
PLACE = np.array([[90.0], [40.0]])
SHIFT_DB = 9.0


def levels_at(rng, source, x, y, shift_db=0.0, white_db=3.0):
    level = (
        -35
        - 30 * np.log10(np.hypot(x - source[0], y - source[1]))
        + white_db * rng.normal(size=len(x))
    )
    return observations(x, y, level + shift_db)


def merged_walks(*walks):
    """Walks of modems 0, 1, ... in one."""
    columns = (
        np.concatenate([getattr(walk, name) for walk in walks])
        for name in ("x_m", "y_m", "level_dbm")
    )
    return replace(
        observations(*columns),
        modem=np.repeat(np.arange(len(walks)), [len(walk) for walk in walks]),
    )


def two_walks(seed, shift_db=SHIFT_DB, **noise):
    """An L and a street that crosses it, by two modems past one transmitter, 25 m off at least."""
    rng = np.random.default_rng(seed)
    (x, y), (v, u) = path("L", 150, 3.0), path("straight", 120, 3.0)
    ways = (x - 100.0, y), (u + 60.0, v + 60.0)
    source = (0.0, 0.0)
    while min(np.hypot(x - source[0], y - source[1]).min() for x, y in ways) < 25.0:
        source = rng.uniform(-60, 140), rng.uniform(40, 160)
    return (
        levels_at(rng, source, *ways[0], **noise),
        levels_at(rng, source, *ways[1], shift_db, **noise),
        source,
    )


# --- oracle: the offset as one more unknown, written from the equations ---


def short_walk():
    rng = np.random.default_rng(1)
    x, y = np.arange(16) * 20.0, np.where(np.arange(16) % 2, 0.0, 30.0)
    level = -30 - 28 * np.log10(np.hypot(x - 90, y - 40) + 5.0) + 4 * rng.normal(size=16)
    modem = np.arange(16) % 5 // 3  # 0 0 0 1 1 0 0 0 1 1 ...: both all along the walk
    return blocks(replace(observations(x, y, level + 7.0 * modem), modem=modem), 300)


def noise_covariance(track, white_share, d_c):
    apart = np.hypot(
        track.places.x_m[:, None] - track.places.x_m, track.places.y_m[:, None] - track.places.y_m
    )
    k = (1.0 - white_share) * (np.exp(-apart / d_c) if d_c else np.eye(len(apart)))
    return k + np.diag(white_share / track.readings + 1.0 / 12.0 / PRIOR.sigma_db**2)


def design_of(track):
    d2 = (track.places.x_m - PLACE[0]) ** 2 + (track.places.y_m - PLACE[1]) ** 2 + PRIOR.height_m**2
    return np.column_stack([np.ones(len(d2)), -5.0 * np.log10(d2)])


def log_p_by_net(track, noise, sigma, offset_sigma_db):
    """Of all levels given sigma: the likelihood summed over a net of offsets, normal with twice a
    modem's variance.
    """
    design = design_of(track) * [PRIOR.p0_sigma_db, PRIOR.eta_sigma]
    covariance = sigma**2 * noise_covariance(track, *noise) + design @ design.T
    mean = design_of(track) @ [PRIOR.p0_dbm, PRIOR.eta]
    spread = np.sqrt(2.0) * offset_sigma_db
    net = np.linspace(-8.0, 8.0, 1201) * spread
    log_p = scipy.stats.multivariate_normal.logpdf(
        track.level_dbm - net[:, None] * track.modem, mean, covariance
    )
    log_p += scipy.stats.norm.logpdf(net, 0.0, spread)
    return np.log(scipy.integrate.trapezoid(np.exp(log_p - log_p.max()), net)) + log_p.max()


@pytest.mark.parametrize("row", [0, 1])
def test_random_effect_is_an_offset_integrated_out(row):
    track = short_walk()
    log_sigma = np.linspace(np.log(0.8), np.log(25.0), 81)
    values = [
        log_p_by_net(track, NOISES[row], s, PRIOR.offset_sigma_db * s / PRIOR.sigma_db)
        for s in np.exp(log_sigma)
    ]
    values += scipy.stats.norm.logpdf(log_sigma, np.log(PRIOR.sigma_db), PRIOR.sigma_log_sd)
    expected = (
        np.log(scipy.integrate.trapezoid(np.exp(values - values.max()), log_sigma)) + values.max()
    )
    assert evidence_at_place(track).log_p[row, 0] == pytest.approx(expected, abs=1e-6, rel=0)


def evidence_at_place(track):
    found = whiteners(track, PRIOR)
    log_det = np.array([[w.log_det] for w in found])
    return marginal(
        walk_sums(track, matrices_of(found), PRIOR, Places.of(*PLACE)),
        len(track),
        log_det,
        PRIOR,
        15,
    )


@pytest.mark.parametrize("row", [0, 1])
def test_told_offset_is_that_of_the_joint_normal(row):
    """Condition the joint normal of levels and offset, sigma given, on the levels."""
    track = short_walk()
    leaf = (*PLACE, np.array([1.0]), np.zeros(1))
    seen = evidence_at_place(track)
    one = Evidence(*(values[..., [row], :] for values in seen))
    tree = Tree(*leaf, one, np.array([row]), None)
    found = offsets(track, PRIOR, tree, tree.mixture(PRIOR), np.array([0]), 2)
    sigma = float(one.sigma_db[0, 0])
    variance = 2.0 * (PRIOR.offset_sigma_db / PRIOR.sigma_db * sigma) ** 2
    design = design_of(track) * [PRIOR.p0_sigma_db, PRIOR.eta_sigma]
    of_levels = sigma**2 * noise_covariance(track, *NOISES[row]) + design @ design.T
    of_levels += variance * np.outer(track.modem, track.modem)
    gain = variance * np.linalg.solve(of_levels, track.modem)
    mean = gain @ (track.level_dbm - design_of(track) @ [PRIOR.p0_dbm, PRIOR.eta])
    np.testing.assert_allclose(found.mean_db, [0.0, mean], rtol=1e-9)
    np.testing.assert_allclose(
        found.sigma_db, [0.0, np.sqrt(variance * (1.0 - gain @ track.modem))], rtol=1e-9
    )


# --- one modem is what it was ---


def test_one_modem_changes_no_bit():
    bent, _, _ = two_walks(0)
    alone, numbered = locate(bent), locate(replace(bent, modem=np.zeros(len(bent), np.int64)))
    for field in fields(alone.squares):
        np.testing.assert_array_equal(
            getattr(alone.squares, field.name), getattr(numbered.squares, field.name)
        )
    assert (alone.log_evidence, alone.p0_dbm, alone.offsets) == (
        numbered.log_evidence,
        numbered.p0_dbm,
        None,
    )


def test_no_block_has_readings_of_two_modems():
    bent, crossing, _ = two_walks(0)
    obs = merged_walks(bent, crossing, bent)
    for most in (300, 40):
        gathered = blocks(obs, most)
        assert len(gathered) <= most
        for number, walk in enumerate((bent, crossing, bent)):
            mine = gathered.modem == number
            assert gathered.readings[mine].sum() == len(walk)
            assert gathered.readings[mine] @ gathered.level_dbm[mine] == pytest.approx(
                np.sum(walk.level_dbm)
            )


# --- what several modems say together ---


def test_offset_and_region_are_true():
    held, off = [], []
    for seed in range(10):
        bent, crossing, source = two_walks(seed)
        found = locate(merged_walks(bent, crossing))
        held.append(region_contains(found, source))
        off.append((found.offsets.mean_db[1] - SHIFT_DB) / found.offsets.sigma_db[1])
        assert found.offsets.sigma_db[1] < 1.5
    assert np.mean(held) >= 0.8  # 10 of 0.95: fewer than 8 in 1 %
    assert np.max(np.abs(off)) < 3.5
    assert 0.3 < np.mean(np.square(off)) < 2.2  # chi-square of 10: 2 % beyond


def test_two_walks_leave_less_than_each_alone():
    for seed in (1, 2):
        bent, crossing, _ = two_walks(seed)
        together = locate(merged_walks(bent, crossing))
        assert together.region_area_m2 < 0.8 * min(
            locate(bent).region_area_m2, locate(crossing).region_area_m2
        )
        assert together.prior == Prior()


def test_order_of_modems_hardly_matters():
    bent, crossing, _ = two_walks(3)
    one, other = locate(merged_walks(bent, crossing)), locate(merged_walks(crossing, bent))
    assert np.hypot(one.x_m - other.x_m, one.y_m - other.y_m) < 0.1 * one.r95_m
    assert one.offsets.mean_db[1] == pytest.approx(-other.offsets.mean_db[1], abs=0.1)
    assert other.p0_dbm - one.p0_dbm == pytest.approx(one.offsets.mean_db[1], abs=0.5)


def test_a_large_offset_is_no_noise():
    """The prior of an offset is in dB, though the evidence is in units of the noise."""
    bent, crossing, _ = two_walks(4, shift_db=14.0, white_db=1.0)
    found = locate(merged_walks(bent, crossing))
    assert found.sigma_db < 1.4
    assert found.offsets.mean_db[1] == pytest.approx(14.0, abs=3.5 * found.offsets.sigma_db[1])


def test_a_modem_without_levels_adds_nothing():
    bent, _, _ = two_walks(5)
    deaf = observations(bent.x_m[:3], bent.y_m[:3], np.full(3, -110.0))
    both = replace(merged_walks(bent, deaf), known_limit=np.repeat([0, -1], [len(bent), 3]))
    found, alone = locate(both), locate(bent)
    assert (found.x_m, found.y_m) == pytest.approx((alone.x_m, alone.y_m), abs=0.02 * alone.r95_m)
    assert found.region_area_m2 == pytest.approx(alone.region_area_m2, rel=0.02)
    assert found.offsets.sigma_db[1] > 5.0


# --- ends of the scale ---


def clip_at(obs, floor_dbm):
    return replace(obs, level_dbm=np.maximum(obs.level_dbm, floor_dbm))


def test_each_modem_has_its_own_end_of_scale():
    bent, crossing, _ = two_walks(6)
    floor_dbm = float(np.quantile(crossing.level_dbm, 0.3))
    obs = merged_walks(bent, clip_at(crossing, floor_dbm))
    at_end = (obs.modem == 1) & (obs.level_dbm == floor_dbm)
    np.testing.assert_array_equal(obs.limit, np.where(at_end, -1, 0))
    np.testing.assert_array_equal(obs.on_one_scale(np.array([0.0, 3.3])).limit, obs.limit)
    _, gone = first_look(obs, blocks(obs, COARSE_BLOCKS), Prior())
    assert gone.readings.sum() == at_end.sum()
    np.testing.assert_allclose(gone.limit_dbm, floor_dbm - SHIFT_DB, atol=3.0)


@pytest.mark.slow
def test_ends_of_scale_leave_the_region_true():
    held = []
    for seed in (20, 21, 22):
        bent, crossing, source = two_walks(seed)
        low = [clip_at(walk, np.quantile(walk.level_dbm, 0.3)) for walk in (bent, crossing)]
        found = locate(merged_walks(*low))
        held.append(region_contains(found, source))
        assert found.offsets.mean_db[1] == pytest.approx(
            SHIFT_DB, abs=4.0 * found.offsets.sigma_db[1]
        )
    assert all(held)
