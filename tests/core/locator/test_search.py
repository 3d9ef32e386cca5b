"""The search in coarse and fine blocks."""

import numpy as np
import pytest

from logger.core.locator.pipeline import search
from logger.core.locator.preparation import prepare
from logger.core.locator.quadtree import Effort
from logger.core.locator.summary import summarise
from logger.core.model.prior import Prior
from tests.kit.walks import observations, path, shadowing


def past_sector(seed):
    """Readings 12 m apart past a sector antenna: 65 degrees wide, 25 dB from front to back."""
    rng = np.random.default_rng(seed)
    x, y = path("random", 110, 12.0)
    k = rng.choice(len(x))
    east, north = x - x[k] - rng.uniform(-60, 60), y - y[k] - rng.uniform(-60, 60)
    off = np.angle(np.exp(1j * (np.arctan2(north, east) - rng.uniform(0, 2 * np.pi))))
    level = -25.0 - 28.0 * np.log10(np.hypot(np.hypot(east, north), 5.0))
    level -= np.minimum(12.0 * (np.degrees(off) / 65.0) ** 2, 25.0)
    level += shadowing(rng, x, y, 4.0, 100.0) + rng.normal(0.0, 1.5, len(x))
    return observations(x, y, np.round(level), 4.0)


@pytest.mark.parametrize("seed", [0, 2])
def test_which_grid_of_blocks_is_the_first_decides_nothing(seed):
    task = prepare(past_sector(seed), Prior(), Effort())
    grids, log_area = (task.walk.coarse, *task.walk.shifted), []
    for first in grids:
        others = tuple(grid for grid in grids if grid is not first)
        turned = task._replace(walk=task.walk._replace(coarse=first, shifted=others))
        posterior = summarise(turned, search(turned))
        log_area.append(np.log(posterior.region_area_m2))
    is_sector = [bool(station.antenna_db) for station in posterior.prior.stations]
    assert np.sum(posterior.station_probability[is_sector]) > 0.5
    print("log areas", np.round(log_area, 3))
    assert np.std(log_area) < 0.05


def among_houses(seed):
    """900 readings 150 m from an antenna, with shadowing over 25 m and over 200 m."""
    rng = np.random.default_rng(seed)
    x, y = path("random", 900, 2.5)
    k = rng.choice(len(x))
    level = -25.0 - 27.0 * np.log10(np.maximum(np.hypot(x - x[k], y - y[k] - 150.0), 1.0))
    level += shadowing(rng, x, y, 4.5, 25.0) + shadowing(rng, x, y, 3.0, 200.0)
    return observations(x, y, np.round(level + rng.normal(0.0, 2.0, len(x))), 4.0)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_which_grid_of_all_blocks_is_the_first_decides_little(seed):
    """With one grid only, which of the two it is changes the area by 32 to 105 %."""
    task = prepare(among_houses(seed), Prior(), Effort())
    (other,) = task.walk.fine_shifted
    turned = task._replace(walk=task.walk._replace(blocks=other, fine_shifted=(task.walk.blocks,)))
    areas_m2 = [summarise(one, search(one)).region_area_m2 for one in (task, turned)]
    print("areas in m2", np.round(areas_m2))
    assert abs(np.log(areas_m2[1] / areas_m2[0])) < 0.2
