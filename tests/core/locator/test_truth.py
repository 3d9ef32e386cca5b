"""What the locator states is true for transmitters that it was not made for, and does not waver.

Small simulated twins of `benchmarks/height.py`, `stability.py`, `agreement.py` and of measured
walks past distant sites.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from logger.core.locator.online import OnlineLocator
from logger.core.locator.pipeline import decide, locate
from logger.core.locator.region import highest_density
from logger.core.locator.summary import summarise
from logger.core.model.prior import Prior
from tests.kit.walks import observations, with_places

STREET_M, TURN_DEG = 60.0, 70.0
WHITE_DB = 3.0


class Station(NamedTuple):
    """A transmitter: where it stands, its level at 1 m and its exponent."""

    x_m: float
    y_m: float
    height_m: float
    p0_dbm: float
    eta: float


def streets(rng, count, step_m):
    """A walk that turns every 60 m."""
    heading = np.cumsum(np.radians(TURN_DEG) * rng.normal(size=int(count * step_m / STREET_M) + 1))
    at_step = heading[(np.arange(count) * step_m // STREET_M).astype(int)]
    return np.cumsum(step_m * np.cos(at_step)), np.cumsum(step_m * np.sin(at_step))


def beside(rng, x_m, y_m, away_m):
    """A place whose closest distance to the walk is within these limits, off none of its ends."""
    count = len(x_m)
    while True:
        k, bearing = rng.integers(count), rng.uniform(0.0, 2.0 * np.pi)
        away = rng.uniform(*away_m)
        place = x_m[k] + away * np.cos(bearing), y_m[k] + away * np.sin(bearing)
        distance_m = np.hypot(x_m - place[0], y_m - place[1])
        closest = int(np.argmin(distance_m))
        if distance_m[closest] >= away_m[0] and 0.1 * count <= closest < 0.9 * count:
            return float(place[0]), float(place[1])


def white_db(rng, x_m, _y_m):
    return WHITE_DB * rng.normal(size=len(x_m))


def one_scale_db(rng, x_m, y_m):
    """6 dB over 15 m."""
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    root = np.linalg.cholesky(36.0 * np.exp(-apart_m / 15.0))
    return root @ rng.normal(size=len(x_m))


def two_scales_db(rng, x_m, y_m):
    """7 dB, three quarters of the variance over 300 m, the rest over 20 m; white noise of 1 dB."""
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    covariance = 49.0 * (0.75 * np.exp(-apart_m / 300.0) + 0.25 * np.exp(-apart_m / 20.0))
    root = np.linalg.cholesky(covariance + np.eye(len(x_m)))
    return root @ rng.normal(size=len(x_m))


NOISES = {"white": white_db, "two scales": two_scales_db}


def receive(rng, noise_db, x_m, y_m, station, position_sigma_m=0.0, pattern_db=0.0):
    """The readings along a walk past a station."""
    distance_m = np.sqrt((x_m - station.x_m) ** 2 + (y_m - station.y_m) ** 2 + station.height_m**2)
    level_dbm = station.p0_dbm - 10.0 * station.eta * np.log10(distance_m)
    level_dbm += pattern_db + noise_db(rng, x_m, y_m)
    return observations(x_m, y_m, np.round(level_dbm), position_sigma_m)


def past_antenna(noise, height_m, pass_m, run):
    """A walk of 560 m that passes a weak transmitter at this horizontal distance."""
    rng = np.random.default_rng([37, list(NOISES).index(noise), int(height_m), int(pass_m), run])
    x_m, y_m = streets(rng, 400, 1.4)
    place = beside(rng, x_m, y_m, (0.98 * pass_m, pass_m))
    station = Station(*place, height_m, rng.uniform(-45.0, -15.0), rng.uniform(2.3, 3.9))
    return receive(rng, NOISES[noise], x_m, y_m, station), station


def past_site(run):
    """A walk of 1 km past a site of 50 to 60 dBm at 1800 MHz, 300 to 1500 m off."""
    rng = np.random.default_rng([41, run])
    x_m, y_m = streets(rng, 200, 5.0)
    place = beside(rng, x_m, y_m, (300.0, 1500.0))
    loss_at_1_m_db = 37.6
    p0_dbm = rng.uniform(50.0, 60.0) - loss_at_1_m_db
    station = Station(*place, 25.0, p0_dbm, rng.uniform(2.6, 3.6))
    return receive(rng, two_scales_db, x_m, y_m, station, 3.0), station


def past_house(run):
    """A walk of 840 m with a reading every 6 m, which passes a weak transmitter at 10 to 150 m."""
    rng = np.random.default_rng([43, run])
    x_m, y_m = streets(rng, 140, 6.0)
    place = beside(rng, x_m, y_m, (10.0, 150.0))
    station = Station(*place, 5.0, rng.uniform(-45.0, -15.0), rng.uniform(2.3, 3.9))
    return receive(rng, two_scales_db, x_m, y_m, station, 3.0), station


def holds(posterior, station, level):
    """Whether the region with this share of the probability holds the station."""
    squares = posterior.squares
    chosen = highest_density(squares, level)
    off_m = np.maximum(
        np.abs(squares.x_m[chosen] - station.x_m), np.abs(squares.y_m[chosen] - station.y_m)
    )
    return bool(np.any(off_m <= 0.5 * squares.size_m[chosen]))


def score(obs, station):
    """Whether the 95 % region holds the station, and whether it is *located*."""
    posterior = locate(obs)
    is_located = decide(posterior, obs).verdict == "located"
    return holds(posterior, station, 0.95), is_located


@pytest.mark.parametrize("noise", NOISES)
def test_a_region_holds_an_antenna_of_any_height(noise):
    """Of 36 walks past antennas 2, 20 and 30 m up one in twenty may miss: more than 5 in 3 %."""
    held, right, wrong, low = 0, 0, 0, 0
    for height_m in (2.0, 20.0, 30.0):
        for pass_m in (5.0, 15.0, 25.0):
            for run in range(4):
                obs, station = past_antenna(noise, height_m, pass_m, run)
                is_inside, is_located = score(obs, station)
                held += is_inside
                wrong += is_located and not is_inside
                right += is_located and is_inside and height_m == 2.0
                low += height_m == 2.0
    print(f"{noise}: held {held} of 36, wrongly located {wrong}, {right} of {low} low ones located")
    assert held >= 31
    assert wrong <= 1
    if noise == "white":
        assert right >= low // 2


def test_regions_hold_distant_sites():
    """Sites 300 to 1500 m off: the shape of the posterior is true, not only its edge."""
    found = []
    for run in range(30):
        obs, station = past_site(run)
        posterior = locate(obs)
        found.append([holds(posterior, station, level) for level in (0.5, 0.8, 0.95)])
    half, most, nearly_all = np.mean(found, axis=0)
    print(f"50, 80, 95 % regions hold {half:.2f}, {most:.2f}, {nearly_all:.2f} of 30 sites")
    assert nearly_all >= 0.9
    assert most >= 0.5


@pytest.mark.parametrize("noise", NOISES)
def test_regions_hold_what_a_modem_averages(noise):
    """Levels of 10 s; those of twelve walks under noise of two scales missed four."""
    held, wrong = 0, 0
    for run in range(12):
        obs, station = past_antenna(noise, 5.0, 60.0, run)
        total_db = np.concatenate([np.zeros(10), np.cumsum(obs.level_dbm)])
        count = np.minimum(np.arange(1, len(obs) + 1), 10)
        level_dbm = np.round((total_db[10:] - total_db[:-10]) / count)
        is_inside, is_located = score(replace(obs, level_dbm=level_dbm), station)
        held += is_inside
        wrong += is_located and not is_inside
    print(f"{noise}: held {held} of 12, wrongly located {wrong}")
    assert held >= 11
    assert wrong == 0


def past_sector(run):
    """Two legs of 420 m that pass a sector antenna at 25 to 200 m (3GPP TR 36.942, 4.2.1)."""
    rng, way_m = np.random.default_rng([47, run]), 1.4 * np.arange(600)
    x_m, y_m = np.minimum(way_m, 420.0), np.maximum(way_m - 420.0, 0.0)
    place = beside(rng, x_m, y_m, (25.0, 200.0))
    station = Station(*place, 5.0, rng.uniform(-45.0, -15.0), rng.uniform(2.3, 3.9))
    azimuth_deg = np.degrees(np.arctan2(x_m - station.x_m, y_m - station.y_m))
    off_deg = (azimuth_deg - rng.uniform(0.0, 360.0) + 180.0) % 360.0 - 180.0
    pattern_db = -np.minimum(12.0 * (off_deg / 65.0) ** 2, 25.0)
    return receive(rng, one_scale_db, x_m, y_m, station, pattern_db=pattern_db), station


def test_regions_hold_sector_antennas_among_houses():
    """With patterns under noise of two scales only, five of 24 walks missed."""
    held, wrong = 0, 0
    for run in range(24):
        is_inside, is_located = score(*past_sector(run))
        held += is_inside
        wrong += is_located and not is_inside
    print(f"held {held} of 24, wrongly located {wrong}")
    assert held >= 21
    assert wrong <= 1


def disturb(obs, rng):
    """Errors of 1 m and .3 dB, far below those that the readings have."""
    x_m, y_m = obs.places.xy_m + rng.normal(size=(2, len(obs)))
    level_dbm = obs.level_dbm + 0.3 * rng.normal(size=len(obs))
    return replace(with_places(obs, x_m=x_m, y_m=y_m), level_dbm=level_dbm)


def turn(obs, degrees):
    """The same walk in a country whose north is elsewhere: nothing that is true of it changes."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return with_places(
        obs, x_m=cosine * obs.x_m - sine * obs.y_m, y_m=sine * obs.x_m + cosine * obs.y_m
    )


def test_small_errors_do_not_change_the_answer():
    """Of 20 walks, disturbed or turned, the area of the region changes twofold in a few at most."""
    log_ratio = np.zeros((2, 20))
    for run in range(20):
        obs, _ = past_house(run)
        changed = disturb(obs, np.random.default_rng([47, run])), turn(obs, 20.0 + 7.0 * run)
        before, *after = (locate(one).region_area_m2 for one in (obs, *changed))
        log_ratio[:, run] = np.log(np.divide(after, before))
    is_twofold = np.abs(log_ratio) > np.log(2.0)
    print("changes twofold:", np.mean(is_twofold, axis=1), np.round(log_ratio, 2))
    assert np.all(np.sum(is_twofold, axis=1) <= 2)


def on_device(obs):
    """The posterior of the device after all readings, one by one."""
    locator = OnlineLocator(Prior())
    for reading in obs:
        locator.take(reading)
        if locator.stale > 1.0:
            locator.search()
    return summarise(*locator.last_search())


def test_device_and_desktop_state_the_same():
    """The device has fewer blocks: of 12 walks five at most end with radii that differ by half."""
    walks = [past_house(run)[0] for run in range(8)]
    walks += [past_antenna(noise, 5.0, 25.0, run)[0] for noise in NOISES for run in range(2)]
    apart, steps = [], ["located", "ambiguous", "cannot tell"]
    for obs in walks:
        both = on_device(obs), locate(obs)
        verdicts = [steps.index(decide(one, obs, within_m=60.0).verdict) for one in both]
        log_ratio = np.log(both[0].r95_m / both[1].r95_m)
        apart.append((abs(log_ratio) > np.log(1.5), abs(verdicts[0] - verdicts[1]) > 1))
    print("apart:", apart)
    assert sum(by_radius for by_radius, _ in apart) <= 5
    assert not any(by_verdict for _, by_verdict in apart)
