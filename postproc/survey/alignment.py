"""Many modems on one scale, by the ground that they share.

The locator gives each modem blocks of its own (`logger.core.model.blocks`), at most 300 in all:
with 20 modems a block is hundreds of metres wide. But modems that share places show their offsets
directly: in a place p with level s_p, modem m reads s_p + b_m + e. Least squares over all places,
with Huber's weights against wrong ones, gives b and its covariance. The error of positions that a
whole walk has in common shows only between the walks of one modem: sigmas are enlarged by their
excess. A modem whose offset is then certain to a decibel counts as the same modem; the offsets that
remain are the locator's.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from logger.core.arrays import FloatArray, IntArray
from logger.core.model.blocks import squares
from logger.core.readings import Readings
from postproc.estimators.metrics import SIGMA_PER_MAD

MOST_MODEMS = 4
"""Up to this many, nothing is aligned: estimates are those of `postproc smooth` to the last bit."""
PLACE_M = 20.0
"""Side of a place: about the median decorrelation distance of measured walks."""
CERTAIN_DB = 1.0
"""An offset that is more certain is known: noise of one reading is several times as large."""
_LEAST_SIGMA_DB = 1.0
_MARGIN_DB = 7.0
"""Above the lowest mean level of a modem.

In a synthetic city the NEES of offsets was 2.1 with 3 dB, 1.2 with 5 dB and 1.0 with 7 dB.
"""
_TURNS = 8
_RANK = 1e-9
"""Of the largest eigenvalue: below, a direction is that of a common shift, which nothing shows."""
_HUBER = 1.345
"""Standard deviations from which a place counts less: 95 % efficient for Gaussian errors."""
_USUAL_EXCESS, _USUAL_WEIGHT = 1.4, 5.0
"""Variance of the walks of a modem in units of what the places say, and the degrees of freedom that
this counts as: in eight synthetic cities the mean was 1.34."""
_MOST_WALKS = 60
"""Walks of the first modems: as many say how much walks differ, and more take long."""
_ANY_NUMBER = 1 << 40


class Alignment(NamedTuple):
    """Readings with fewer modems; what was subtracted from each modem, with its sigma, (m,) dB.

    The sigma is NaN for a modem that is not on the scale of the first one.
    """

    obs: Readings
    offset_db: FloatArray
    sigma_db: FloatArray


class PlaceLevels(NamedTuple):
    """Mean levels of modems in places, shape (n,) each."""

    place: IntArray
    modem: IntArray
    level_dbm: FloatArray


class OffsetFit(NamedTuple):
    """Pseudo-inverse of the normal matrix (n, n), offsets (n,) and variance of a place."""

    inverse: FloatArray
    offset_db: FloatArray
    error_db2: float


def align(obs: Readings) -> Alignment:
    """Readings of modems that share ground on the scale of one of them; all usable ones."""
    n = obs.n_modems
    if n <= MOST_MODEMS or obs.modem is None:
        return Alignment(obs, np.zeros(n), np.zeros(n))
    levels = levels_by_place(obs, obs.modem, PLACE_M)
    common = on_common_ground(clear_of_floor(levels, np.arange(n)))
    part = _part_numbers(common, n)
    fit = robust_fit(common, n)
    first = np.array([int(np.flatnonzero(part == own)[0]) for own in part])
    offset_db = fit.offset_db - fit.offset_db[first]  # against the first of its part
    inverse = fit.inverse
    spread = np.diag(inverse) + inverse[first, first] - 2.0 * inverse[np.arange(n), first]
    sigma_db = np.sqrt(fit.error_db2 * np.maximum(spread, 0.0))
    sigma_db *= np.sqrt(_excess(obs, obs.modem, n))
    is_certain = sigma_db <= CERTAIN_DB
    offset_db = np.where(is_certain, offset_db, 0.0)
    # a modem that is not certain stays one of its own
    scale = np.where(is_certain, part, n + np.arange(n))
    moved = obs.on_one_scale(offset_db)
    modem = _number_by_appearance(scale[obs.modem])
    moved = replace(moved, modem=modem if np.any(modem) else None)
    is_first_scale = is_certain & (part == part[0])
    return Alignment(moved, offset_db, np.where(is_first_scale, sigma_db, np.nan))


def levels_by_place(obs: Readings, modem: IntArray, side_m: float) -> PlaceLevels:
    """Mean levels within the scale of each modem in squares of ground."""
    inside = obs.limit == 0
    place, _ = squares(obs.places.part(inside), _ANY_NUMBER, finest_m=side_m)
    n = int(np.max(modem, initial=0)) + 1
    key, which = np.unique(place * n + modem[inside], return_inverse=True)
    level_dbm = np.bincount(which, obs.level_dbm[inside]) / np.bincount(which)
    return PlaceLevels(key // n, key % n, np.asarray(level_dbm, float))


def _excess(obs: Readings, modem: IntArray, n: int) -> float:
    """How much more the walks of a modem differ than the places say, as a ratio of variances.

    Walks are distinguished by falling times; two that are taken for one only say less.
    """
    begins = np.ones(len(obs), np.bool_)
    begins[1:] = (np.diff(obs.t_ns) < 0) | (np.diff(modem) != 0)
    modem_of_walk, walk_of = modem[begins], np.cumsum(begins) - 1
    few = np.argsort(modem_of_walk, kind="stable")[:_MOST_WALKS]
    number = np.full(len(modem_of_walk), -1)
    number[few] = np.arange(len(few))
    chosen = number[walk_of] >= 0
    modem_of_walk = modem_of_walk[few]
    levels = levels_by_place(obs.part(chosen), number[walk_of[chosen]], PLACE_M)
    common = on_common_ground(clear_of_floor(levels, modem_of_walk))
    if not len(common.place):
        return _USUAL_EXCESS
    fit = robust_fit(common, len(modem_of_walk))
    precision = np.linalg.pinv(fit.inverse, hermitian=True, rcond=_RANK)
    of_modem = np.zeros((len(modem_of_walk), n))
    of_modem[np.arange(len(modem_of_walk)), modem_of_walk] = 1.0
    between = of_modem.T @ precision @ of_modem
    mean_db = np.linalg.pinv(between, hermitian=True, rcond=_RANK) @ of_modem.T @ precision
    away_db = fit.offset_db - of_modem @ (mean_db @ fit.offset_db)
    free = int(np.linalg.matrix_rank(precision, rtol=_RANK, hermitian=True)) - int(
        np.linalg.matrix_rank(between, rtol=_RANK, hermitian=True)
    )
    chi2 = float(away_db @ precision @ away_db) / fit.error_db2
    return max((chi2 + _USUAL_EXCESS * _USUAL_WEIGHT) / (free + _USUAL_WEIGHT), 1.0)


def clear_of_floor(levels: PlaceLevels, modem_of: IntArray) -> PlaceLevels:
    """Places where every modem of those there would have heard the cell.

    Near its floor a modem reports the high levels only, and seems to read high. `levels` are of
    walks or modems, `modem_of` (n,) says whose each is.
    """
    modem = modem_of[levels.modem]
    floor_dbm = np.full(int(np.max(modem_of)) + 1, np.inf)
    np.minimum.at(floor_dbm, modem, levels.level_dbm)
    margin_db = levels.level_dbm - floor_dbm[modem]
    least_db = np.full(int(np.max(levels.place, initial=-1)) + 1, np.inf)
    np.minimum.at(least_db, levels.place, margin_db)
    is_clear = least_db[levels.place] > _MARGIN_DB
    return PlaceLevels(levels.place[is_clear], levels.modem[is_clear], levels.level_dbm[is_clear])


def _part_numbers(levels: PlaceLevels, n: int) -> IntArray:
    """Number of the part of each of `n` modems: those that places connect are in one."""
    n_places = int(np.max(levels.place, initial=-1)) + 1
    ends = levels.modem, n + levels.place
    links = coo_array((np.ones(len(levels.place)), ends), shape=(n + n_places,) * 2)
    return np.asarray(connected_components(links, directed=False)[1][:n], np.int64)


def on_common_ground(levels: PlaceLevels, least: int = 2) -> PlaceLevels:
    """Levels in places that have at least so many of them; places are numbered anew from 0."""
    shared = np.bincount(levels.place)[levels.place] >= least
    place = np.unique(levels.place[shared], return_inverse=True)[1]
    return PlaceLevels(place, levels.modem[shared], levels.level_dbm[shared])


def robust_fit(levels: PlaceLevels, n: int) -> OffsetFit:
    """Offsets of `n` modems by least squares with Huber's weights."""
    place = levels.place
    weight, error_db2 = np.ones(len(place)), _LEAST_SIGMA_DB**2
    offset_db: FloatArray = np.zeros(n)
    inverse: FloatArray = np.zeros((n, n))
    for _ in range(_TURNS if len(place) else 0):
        inverse, offset_db = _solve(levels, weight, n)
        free_dbm = levels.level_dbm - offset_db[levels.modem]
        of_place_dbm = np.bincount(place, weight * free_dbm) / np.bincount(place, weight)
        residual_db = free_dbm - of_place_dbm[place]
        # a place of two has half of its variance in its own mean
        count = np.bincount(place)[place]
        free_db = residual_db * np.sqrt(count / (count - 1.0))
        error_db2 = max(SIGMA_PER_MAD * float(np.median(np.abs(free_db))), _LEAST_SIGMA_DB) ** 2
        away = np.abs(free_db) / np.sqrt(error_db2)
        weight = np.minimum(1.0, _HUBER / np.maximum(away, 1e-9))
    return OffsetFit(inverse, offset_db, error_db2)


def _solve(levels: PlaceLevels, weight: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Weighted least squares without the levels of the places: pseudo-inverse and offsets."""
    place, modem, level_dbm = levels
    total = np.bincount(place, weight)
    mean_dbm = np.bincount(place, weight * level_dbm) / total
    of_place = np.zeros((len(total), n))
    of_place[place, modem] = weight
    normal = np.diag(np.bincount(modem, weight, n)) - of_place.T @ (of_place / total[:, None])
    right = np.bincount(modem, weight * (level_dbm - mean_dbm[place]), n)
    inverse = np.linalg.pinv(normal, hermitian=True, rcond=_RANK)
    return np.asarray(inverse, float), np.asarray(inverse @ right, float)


def _number_by_appearance(numbers: IntArray) -> IntArray:
    values, first, which = np.unique(numbers, return_index=True, return_inverse=True)
    rank = np.empty(len(values), np.int64)
    rank[np.argsort(first)] = np.arange(len(values))
    return rank[which]
