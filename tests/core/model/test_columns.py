from itertools import pairwise

import numpy as np
import pytest

from logger.core.model.blocks import Censored, blocks
from logger.core.model.columns import (
    censored_columns,
    distances_db,
    receiver_variance,
    varying_columns,
)
from logger.core.model.prior import SECTOR_DB, Prior, Station
from logger.core.places import Places
from tests.kit.walks import observations

MOST = 300
PLACES = np.array([[90.0, 200.0, -400.0], [40.0, -50.0, 300.0]])
PRIOR = Prior().of_station(Station(1.0, 5.0, (9.3, 3.3)))


def bent_walk(position_sigma):
    x, y = np.arange(14) * 20.0, np.where(np.arange(14) < 7, 0.0, 60.0)
    return blocks(observations(x, y, -60.0 - np.arange(14), position_sigma), MOST)


def test_distance_of_a_large_block_is_that_of_its_points():
    """Where a block is gathered from points wider apart, L is the mean over them and not that of
    their middle.
    """
    rng = np.random.default_rng(5)
    x, y = rng.uniform(0, 400, (2, 600))
    track = blocks(observations(x, y, rng.normal(-80, 4, 600)), 30)
    assert len(track) <= 30
    (distance_db,) = distances_db(track, 5.0, Places.of(np.array([130.0]), np.array([210.0]))).T
    each = 5.0 * np.log10((track.points.x_m - 130.0) ** 2 + (track.points.y_m - 210.0) ** 2 + 25.0)
    ends = np.append(track.first, len(each))
    expected = [np.average(each[i:j], weights=track.weight[i:j]) for i, j in pairwise(ends)]
    np.testing.assert_allclose(distance_db, expected, rtol=1e-12)


# --- the receiver's error ---


def test_an_error_of_the_receiver_adds_variance_close_by():
    track = bent_walk(5.0)
    distance_db = distances_db(track, PRIOR.height_m, Places.of(*PLACES))
    ratio = receiver_variance(track, PRIOR, distance_db)
    d_m = np.sqrt(
        (track.places.x_m[:, None] - PLACES[0]) ** 2
        + (track.places.y_m[:, None] - PLACES[1]) ** 2
        + 5.0**2
        + 2 * 5.0**2
    )
    by_geometry = (10 / np.log(10) * PRIOR.eta * 5.0 / d_m / PRIOR.sigma_db) ** 2
    np.testing.assert_allclose(ratio, by_geometry, rtol=1e-9)


def test_the_variance_of_the_receiver_is_that_of_simulated_errors():
    rng = np.random.default_rng(5)
    d_m, sigma_m = 60.0, 3.0
    moved = np.hypot(d_m + sigma_m * rng.normal(size=200_000), sigma_m * rng.normal(size=200_000))
    track = blocks(observations([0.0], [0.0], [-70.0], sigma_m), MOST)
    prior = Prior().of_station(Station(1.0, 0.0))
    at = distances_db(track, 0.0, Places.of(np.array([d_m]), np.array([0.0])))
    ratio = receiver_variance(track, prior, at)
    assert ratio[0, 0] * prior.sigma_db**2 == pytest.approx(
        np.var(prior.eta * 10 * np.log10(moved)), rel=0.03
    )


def test_no_error_of_the_receiver_adds_none():
    track = bent_walk(0.0)
    assert receiver_variance(track, PRIOR, distances_db(track, 5.0, Places.of(*PLACES))) is None


# --- the antenna pattern ---


def test_columns_are_the_distance_and_the_harmonics_of_the_azimuth():
    track = bent_walk(0.0)
    columns = varying_columns(track, PRIOR, Places.of(*PLACES))
    east_m, north_m = (
        (track.places.x_m[:, None] - PLACES[0]),
        (track.places.y_m[:, None] - PLACES[1]),
    )
    azimuth, d_m = np.arctan2(north_m, east_m), np.sqrt(east_m**2 + north_m**2 + 25.0)
    fading = np.hypot(east_m, north_m) / d_m
    expected = [-10.0 * np.log10(d_m), fading * np.cos(azimuth), fading * np.sin(azimuth)]
    expected += [fading**2 * np.cos(2.0 * azimuth), fading**2 * np.sin(2.0 * azimuth)]
    np.testing.assert_allclose(columns, expected, atol=1e-12)


def test_censored_points_have_the_columns_of_blocks():
    track = bent_walk(4.0)
    nothing = np.zeros(len(track))
    gone = Censored(track.places, nothing, nothing, nothing)
    np.testing.assert_allclose(
        censored_columns(gone, PRIOR, Places.of(*PLACES)),
        varying_columns(track, PRIOR, Places.of(*PLACES)),
    )


def test_the_prior_of_a_sector_is_that_of_the_pattern_of_3gpp():
    """Harmonics of -min(12 (b / 65)^2, 25) dB; the azimuth of the beam is uniform.

    What the prior leaves out counts as noise.
    """
    b = np.linspace(-180.0, 180.0, 20_000, endpoint=False)
    pattern_db = -np.minimum(12.0 * (b / 65.0) ** 2, 25.0)
    size_db = [2.0 * np.mean(pattern_db * np.cos(np.radians(k * b))) for k in (1, 2)]
    kept = len(SECTOR_DB)
    assert np.abs(size_db[:kept]) / 2**0.5 == pytest.approx(SECTOR_DB, abs=0.05)
    rest_db = pattern_db - np.mean(pattern_db)
    rest_db -= sum(a * np.cos(np.radians(k * b)) for k, a in enumerate(size_db[:kept], 1))
    assert np.std(rest_db) == pytest.approx(3.5, abs=0.05)
