"""Whether the posterior is as sure as it may be, by statistics over simulated and measured
walks.
"""

import csv
import json

import numpy as np
import pytest
import scipy.stats

from logger.core.geo import Utm
from logger.core.locator.pipeline import locate
from logger.core.model.noise import shadowing
from logger.core.model.prior import NOISE, Prior
from tests.kit.noise_groups import noise_groups
from tests.kit.walks import observations, path, region_contains, simulate

NEARBY = {"reach_m": 600.0, "near_m": 150.0}
WHITE = Prior(**NEARBY, noise=noise_groups())
EVERY_NOISE = Prior(**NEARBY, noise=tuple(one._replace(trust=1.0) for one in NOISE))

# --- walks from the prior itself: the level of the region that just holds the truth is uniform ---


def place_of_prior(rng, prior, x, y):
    """A place of the searched square, kept with the prior's density."""
    half = prior.reach_m + 0.5 * max(np.ptp(x), np.ptp(y))
    while True:
        dx, dy = rng.uniform(-half, half, 2)
        at = 0.5 * (x.min() + x.max()) + dx, 0.5 * (y.min() + y.max()) + dy
        nearest = np.min(np.hypot(x - at[0], y - at[1]))
        if rng.random() < max(nearest / prior.near_m, 1.0) ** -prior.far_power:
            return at


def walk_from_prior(rng, prior, shape):
    """A walk, its levels and the source, all unknowns drawn from the prior."""
    x, y = path(shape, 100, 8.4)
    source = place_of_prior(rng, prior, x, y)
    odds = np.exp(prior.noise_table.log_odds)
    noise = prior.hypotheses[rng.choice(len(odds), p=odds)]
    apart = np.hypot(x[:, None] - x, y[:, None] - y)
    k = shadowing(apart, noise) + (noise.white_share + 1.0 / 12.0 / prior.sigma_db**2) * np.eye(
        len(x)
    )
    sigma_db = prior.sigma_db * np.exp(prior.sigma_log_sd * rng.normal())
    p0, eta = rng.normal(prior.p0_dbm, prior.p0_sigma_db), rng.normal(prior.eta, prior.eta_sigma)
    distance_db = 5.0 * np.log10((x - source[0]) ** 2 + (y - source[1]) ** 2 + prior.height_m**2)
    level = p0 - eta * distance_db + sigma_db * np.linalg.cholesky(k) @ rng.normal(size=len(x))
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
def test_level_of_the_truth_is_uniform(prior):
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
