"""Whether the posterior is as sure as it may be, by statistics over simulated and measured
walks.
"""

import csv
import json

import numpy as np
import pytest
import scipy.stats

from logger.core.locator.pipeline import locate
from logger.core.model.noise import shadowing
from logger.core.model.prior import HEIGHTS_M, NOISE, Prior, Reach, Station
from logger.core.places import Utm
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import observations, path, region_contains, simulate

NEARBY = {"reach_m": 600.0, "reaches": (Reach(0.3, 60.0, 4.0), Reach(0.7, 150.0, 3.0))}
HEIGHTS = tuple(Station(1.0 / len(HEIGHTS_M), one) for one in HEIGHTS_M)
WHITE = Prior(**NEARBY, noise=noise_groups(), stations=HEIGHTS)
EVERY_NOISE = Prior(**NEARBY, noise=tuple(one._replace(trust=1.0) for one in NOISE))

# --- walks from the prior itself: the level of the region that just holds the truth is uniform ---


def place_of_prior(rng, prior, x, y):
    """A place of the searched square, kept with the density of one of the reaches."""
    half = prior.reach_m + 0.5 * max(np.ptp(x), np.ptp(y))
    odds = np.array([one.probability for one in prior.reaches])
    reach = prior.reaches[rng.choice(len(odds), p=odds / odds.sum())]
    while True:
        dx, dy = rng.uniform(-half, half, 2)
        at = 0.5 * (x.min() + x.max()) + dx, 0.5 * (y.min() + y.max()) + dy
        nearest = np.min(np.hypot(x - at[0], y - at[1]))
        if rng.random() < max(nearest / reach.flat_m, 1.0) ** -reach.power:
            return at


def walk_from_prior(rng, prior, shape):
    """A walk, its levels and the source, all unknowns drawn from the prior."""
    x, y = path(shape, 100, 8.4)
    source = place_of_prior(rng, prior, x, y)
    odds = np.exp(prior.noise_table.log_odds)
    number = rng.choice(len(odds), p=odds)
    noise = prior.hypotheses[number]
    station_odds = np.exp(prior.station_log_odds[:, number])
    station = prior.stations[rng.choice(len(station_odds), p=station_odds)]
    apart = np.hypot(x[:, None] - x, y[:, None] - y)
    k = shadowing(apart, noise) + (noise.white_share + 1.0 / 12.0 / prior.sigma_db**2) * np.eye(
        len(x)
    )
    sigma_db = prior.sigma_db * np.exp(prior.sigma_log_sd * rng.normal())
    p0, eta = rng.normal(prior.p0_dbm, prior.p0_sigma_db), rng.normal(prior.eta, prior.eta_sigma)
    east, north = x - source[0], y - source[1]
    d_m = np.sqrt(east**2 + north**2 + station.height_m**2)
    level = (
        p0 - 10.0 * eta * np.log10(d_m) + sigma_db * np.linalg.cholesky(k) @ rng.normal(size=len(x))
    )
    for order, spread_db in enumerate(station.antenna_db, 1):
        cosine_db, sine_db = spread_db * rng.normal(size=2)
        level += np.real((cosine_db - 1j * sine_db) * ((east + 1j * north) / d_m) ** order)
    return observations(x, y, level), source


def level_of(found, point, rng):
    """Mass of all places denser than that of a point; that of its own cell by chance."""
    cells = found.squares
    off = np.maximum(np.abs(cells.x_m - point[0]), np.abs(cells.y_m - point[1])) / cells.size_m
    own = int(np.argmin(off))
    denser = cells.density > cells.density[own]
    return cells.probability[denser].sum() + rng.random() * cells.probability[own]


@pytest.mark.slow
@pytest.mark.parametrize("prior", [WHITE, EVERY_NOISE], ids=["white", "every noise"])
def test_level_of_the_truth_is_uniform(prior, monkeypatch):
    monkeypatch.setattr("logger.core.locator.mixture.GROUP_POWER", 1.0)  # as Bayes has it
    rng = np.random.default_rng(40)
    walks = [
        walk_from_prior(rng, prior, ("L", "square", "random", "spiral")[k % 4]) for k in range(60)
    ]
    levels = [level_of(locate(obs, prior), source, rng) for obs, source in walks]
    print("quartiles of the level:", np.round(np.quantile(levels, [0.25, 0.5, 0.75]), 2))
    assert scipy.stats.kstest(levels, "uniform").pvalue > 0.01


# --- walks of other worlds ---


def coverage_of(rng, shape, runs, **walk):
    simulated = [simulate(rng, shape, **walk) for _ in range(runs)]
    return np.mean([region_contains(locate(obs), source) for obs, source in simulated])


def test_region_holds_the_truth():
    rng = np.random.default_rng(10)
    assert (
        coverage_of(rng, "random", 6, count=150, step=5.6) >= 0.65
    )  # of 0.95: fewer than 4 of 6 in 0.2 %


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["L", "square", "random"])
def test_region_holds_the_truth_white_noise(shape):
    assert coverage_of(np.random.default_rng(11), shape, 60, count=300, step=2.8) >= 0.88


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["L", "square", "spiral"])
def test_region_holds_the_truth_correlated_shadowing(shape):
    rng = np.random.default_rng(13)
    assert coverage_of(rng, shape, 40, white_db=0.0, shadow_db=6.0, count=300, step=2.8) >= 0.85


@pytest.mark.slow
def test_measured_walks(traces):
    """Of every tenth measured walk the region, widened by 10 m, holds the surveyed transmitter."""
    rows = list(csv.DictReader((traces / "reference.csv").read_text().splitlines()))[::10]
    found = []
    for row in rows:
        truth = json.loads((traces / row["dataset"] / "truth.json").read_text())
        info = truth["traces"][row["trace"]]
        source = truth["transmitters"][info["tx"]]
        table = np.genfromtxt(
            traces / row["dataset"] / info["file"], delimiter=",", names=True, usecols=(1, 2, 3)
        )
        utm = Utm.at(source["lat"], source["lon"])
        x, y = utm.to_xy_arrays(table["lat"], table["lon"])
        posterior = locate(observations(x, y, table["rssi_dbm"], 4.0))
        found.append(region_contains(posterior, utm.to_xy(source["lat"], source["lon"]), 10.0))
    print(f"{np.mean(found):.0%} of {len(found)} regions hold the transmitter")
    assert np.mean(found) > 0.8
