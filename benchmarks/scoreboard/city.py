"""A city of cells, and a modem on a walk that reports only the strongest of them.

The walk follows a grid of streets. The modem reports the serving cell and the `NEIGHBOURS`
strongest of the others in whole decibels, as GSM modems do.
"""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.model.path_loss import log_distance_db
from logger.sim.world import Shadowing

SCANS, STEP_M = 1000, 2.0
FLOOR_DBM = -113.0
NEIGHBOURS = 6

_STREET_M = 80.0
_CITY_M, _WALK_M = 1000.0, 700.0
"""Half the sides of the squares with the cells and with the walk."""
_HEIGHT_M = 20.0
_HYSTERESIS_DB = 4.0
_LIST_LENGTH = 14
"""Cells nearest to the serving one, which alone its list lets a modem measure."""
_OUTAGE = 30
"""Scans of a stretch without the target, on average."""

NOISES: dict[str, tuple[float, tuple[tuple[float, float], ...]]] = {
    "white 3 dB": (3.0, ()),
    "6 dB / 15 m": (1.0, ((6.0, 15.0),)),
    "two scales": (2.0, ((7.0 * 0.75**0.5, 300.0), (7.0 * 0.25**0.5, 15.0))),
}
"""White noise in dB, and shadowing as (standard deviation in dB, decorrelation distance in m)."""


class City(NamedTuple):
    """Cells (c,), and the level of each at the scans (n,) of a walk; `serving` (n,) are cells."""

    cell_m: FloatArray
    p0_dbm: FloatArray
    eta: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    level_dbm: FloatArray
    serving: IntArray


class Report(NamedTuple):
    """Which cell is in which scan (c, n), and what the level of any other is at most (n,)."""

    is_there: BoolArray
    limit_dbm: FloatArray


def city(rng: np.random.Generator, noise: str) -> City:
    """20 to 40 cells at random positions, and a walk from the middle."""
    n = int(rng.integers(20, 41))
    cell_m = rng.uniform(-_CITY_M, _CITY_M, (n, 2))
    p0_dbm, eta = rng.normal(-12.0, 6.0, n), rng.normal(3.2, 0.2, n)
    x_m, y_m = streets(rng)
    white_db, shadows = NOISES[noise]
    flat_m = np.hypot(x_m - cell_m[:, :1], y_m - cell_m[:, 1:])
    height_m = np.full_like(flat_m, _HEIGHT_M)
    mean_dbm = p0_dbm[:, None] - eta[:, None] * log_distance_db(flat_m, height_m)
    for sigma_db, decorrelation_m in shadows:
        fields = (Shadowing.draw(sigma_db, decorrelation_m, rng) for _ in range(n))
        mean_dbm += np.stack([field.at_db(x_m, y_m) for field in fields])
    level_dbm = np.round(mean_dbm + rng.normal(0.0, white_db, mean_dbm.shape))
    return City(cell_m, p0_dbm, eta, x_m, y_m, level_dbm, _serving(mean_dbm))


def streets(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """A walk of `SCANS` steps that goes straight on at half of the crossings."""
    corner_m, heading = [np.zeros(2)], 0
    east_north = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    for _ in range(int(np.ceil(SCANS * STEP_M / _STREET_M))):
        while True:
            heading = (heading + rng.choice([0, 1, -1], p=[0.5, 0.25, 0.25])) % 4
            ahead_m = corner_m[-1] + _STREET_M * east_north[heading]
            if np.max(np.abs(ahead_m)) <= _WALK_M:
                break
        corner_m.append(ahead_m)
    along_m, corners_at_m = STEP_M * np.arange(SCANS), _STREET_M * np.arange(len(corner_m))
    x_m, y_m = (np.interp(along_m, corners_at_m, axis) for axis in np.transpose(corner_m))
    return x_m, y_m


def report(made: City, *, from_lists: bool = False) -> Report:
    """What the modem reports; `from_lists`: only neighbours on the list of the serving cell."""
    apart_m = np.hypot(*(made.cell_m[:, None] - made.cell_m).transpose(2, 0, 1))
    rank = np.argsort(np.argsort(apart_m, axis=1), axis=1)
    on_list = rank <= _LIST_LENGTH if from_lists else np.ones_like(rank, np.bool_)
    is_there = np.zeros(made.level_dbm.shape, np.bool_)
    limit_dbm = np.full(SCANS, FLOOR_DBM)
    for k, serving in enumerate(made.serving):
        measurable = (made.level_dbm[:, k] >= FLOOR_DBM) & on_list[serving]
        measurable[serving] = False
        cells = np.flatnonzero(measurable)
        best = cells[np.argsort(-made.level_dbm[cells, k], kind="stable")[:NEIGHBOURS]]
        is_there[best, k] = True
        is_there[serving, k] = True
        if len(best) == NEIGHBOURS:
            limit_dbm[k] = np.min(made.level_dbm[best, k])
    return Report(is_there, limit_dbm)


def outages(rng: np.random.Generator, share: float) -> BoolArray:
    """Scans (n,) in stretches that have about this share of all."""
    is_out, out = np.zeros(SCANS, np.bool_), bool(rng.random() < share)
    for k in range(SCANS):
        odds = 1.0 if out else share / (1.0 - share)
        if rng.random() < odds / _OUTAGE:
            out = not out
        is_out[k] = out
    return is_out


def _serving(mean_dbm: FloatArray) -> IntArray:
    """The strongest cell, once it is stronger than the last one by the hysteresis."""
    cell, serving = int(np.argmax(mean_dbm[:, 0])), []
    for of_scan in mean_dbm.T:
        if np.max(of_scan) > of_scan[cell] + _HYSTERESIS_DB:
            cell = int(np.argmax(of_scan))
        serving.append(cell)
    return np.array(serving)
