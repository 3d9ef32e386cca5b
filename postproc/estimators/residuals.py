"""What an estimate leaves unexplained: the readings against the model.

A residual is level minus model, positive where the cell is stronger than the model expects. A trend
against log-distance means that the exponent changes on the way, one against azimuth that the
antenna has a direction. In 1200 simulated walks through honest worlds (3 dB white; 6 dB
decorrelating over 15 or 60 m, with and without white noise) outliers were named in 1 to 4 %, a
changing exponent in 0 to 3 % and a sector in 0 to 1 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.model import path_loss
from logger.core.readings import Readings, SpikeLevel
from postproc.estimators import least_squares, residual_trends
from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import Consistency, consistency, lag1
from postproc.estimators.residual_covariance import ResidualNoise
from postproc.estimators.residual_trends import Bins, ExponentChange, Ground, Sector

_FEWEST = 20  # levels; fewer show no distribution
_DISTANCE_BINS = 8
_AZIMUTH_BINS = 12
_ROUNDING_DB = 12.0**-0.5  # of levels in whole dB
_SIGMA_PER_MEDIAN = 1.0 / 0.6745  # of the absolute value, of a normal law
_MOST_STEPS = 2000  # of the autocorrelation along the walk
_OUTLIER_CHANCE = 0.02  # that any level of normal noise is named


class Outlier(NamedTuple):
    """A reading too far from the model; `sigmas` is its residual divided by the robust sigma."""

    scan_seq: int
    t_ns: int
    residual_db: float
    sigmas: float


@dataclass(frozen=True, kw_only=True)
class Residuals:
    """Residuals of a state (n,) and their statistics; NaN for readings at the modem's limit.

    `sigma_db` is robust; of normal noise `skewness` and `excess_kurtosis` are 0 and
    `beyond_3_sigma` is 0.0027. `lag1` is the correlation of neighbours, `correlated` the
    probability that it is real, `decorrelation_m` the way along the walk after which it falls below
    1/e, `independent` how many independent readings these are worth at most. `exponent_change` and
    `sector` are the likeliest trends, None where the walk cannot tell; `innovations` are a
    filter's.
    """

    residual_db: FloatArray
    sigma_db: float
    skewness: float = nan
    excess_kurtosis: float = nan
    beyond_3_sigma: float = nan
    lag1: float = nan
    correlated: float = nan
    decorrelation_m: float = nan
    independent: float
    by_distance: Bins | None = None
    by_azimuth: Bins | None = None
    exponent_change: ExponentChange | None = None
    sector: Sector | None = None
    innovations: Consistency | None = None
    outliers: tuple[Outlier, ...] = ()


def diagnose(
    state: FloatArray,
    obs: Readings,
    filtered: FilterPath | None = None,
    *,
    height_m: float = 0.0,
    spikes: Sequence[SpikeLevel] | None = None,
) -> Residuals:
    """Residuals of an estimate [x, y, P0, eta] over the readings of its cell.

    `filtered` adds the innovations of its filter. Of fewer than 20 levels, or levels that fit to
    their rounding, only residuals and sigma are given. A level that those around it do not share is
    named where it is an outlier, and counts in nothing else; `spikes` are these, where known. A
    repeated level counts in nothing.
    """
    residual_db = np.where(obs.limit == 0, -least_squares.residuals(state, obs, height_m), np.nan)
    shared_db = residual_db.copy()
    shared_db[[spike.k for spike in (obs.spikes() if spikes is None else spikes)]] = np.nan
    shared_db[obs.repeats()] = np.nan
    ground = _ground(state, obs, shared_db, height_m)
    e = ground.e_db
    sigma_db = nan
    if len(e):
        sigma_db = max(float(np.median(np.abs(e))) * _SIGMA_PER_MEDIAN, _ROUNDING_DB)
    innovations = _innovations(filtered)
    if len(e) < _FEWEST or float(np.std(e)) < _ROUNDING_DB:
        return Residuals(
            residual_db=residual_db,
            sigma_db=sigma_db,
            independent=float(len(e)),
            innovations=innovations,
        )
    noise = residual_trends.noise_of(ground)
    decorrelation_m, way_m = _correlation_lengths_m(ground)
    return Residuals(
        residual_db=residual_db,
        sigma_db=sigma_db,
        skewness=_standard_moment(e, 3),
        excess_kurtosis=_standard_moment(e, 4) - 3.0,
        beyond_3_sigma=float(np.mean(np.abs(e) > 3.0 * sigma_db)),
        lag1=lag1(e),
        correlated=1.0 - noise.white,
        decorrelation_m=decorrelation_m,
        independent=float(np.clip(0.5 * way_m / max(decorrelation_m, 1e-9), 1.0, len(e))),
        by_distance=_by_distance(ground, noise),
        by_azimuth=_by_azimuth(ground, noise),
        exponent_change=residual_trends.exponent_change(ground),
        sector=residual_trends.sector(ground),
        innovations=innovations,
        outliers=_outliers(residual_db, sigma_db, obs),
    )


def _standard_moment(values: FloatArray, order: int) -> float:
    """Central moment in units of the standard deviation."""
    off = values - np.mean(values)
    return float(np.mean(off**order) / np.mean(off**2) ** (0.5 * order))


def _ground(state: FloatArray, obs: Readings, residual_db: FloatArray, height_m: float) -> Ground:
    level = np.isfinite(residual_db)
    azimuth = np.arctan2(obs.x_m - state[0], obs.y_m - state[1])
    design = least_squares.jacobian(state, obs, height_m)
    columns = (obs.x_m, obs.y_m, residual_db, -design[:, 3], azimuth, design)
    return Ground(*(column[level] for column in columns))


def _correlation_lengths_m(ground: Ground) -> tuple[float, float]:
    """Way over which the autocorrelation of residuals falls to 1/e, and the length of the walk.

    The former is the latter where it never falls so far.
    """
    way_m = np.cumsum(np.hypot(*(np.diff(v, prepend=v[0]) for v in (ground.x_m, ground.y_m))))
    length_m, steps = float(way_m[-1]), min(len(way_m), _MOST_STEPS)
    number = np.minimum((way_m / max(length_m, 1e-9) * steps).astype(np.int64), steps - 1)
    count = np.bincount(number, minlength=steps)
    mean = np.bincount(number, ground.e_db - np.mean(ground.e_db), steps) / np.maximum(count, 1)
    products, pairs = (_autocorrelation_sums(v) for v in (mean, (count > 0).astype(float)))
    lag = np.flatnonzero(pairs >= 0.5)
    correlation = products[lag] / pairs[lag] / max(float(products[0] / pairs[0]), 1e-12)
    below = int(np.argmax(correlation < np.exp(-1.0)))
    if below == 0:
        return length_m, length_m
    around = [below, below - 1]
    fall = np.interp(np.exp(-1.0), correlation[around], lag[around])
    return float(fall) * length_m / steps, length_m


def _autocorrelation_sums(values: FloatArray) -> FloatArray:
    """Sums of products at lags 0 to n - 1."""
    return np.asarray(np.correlate(values, values, "full")[len(values) - 1 :], float)


def _by_distance(ground: Ground, noise: ResidualNoise) -> Bins:
    low, high = np.min(ground.distance_db), np.max(ground.distance_db)
    edges = np.linspace(low, high + 1e-9, _DISTANCE_BINS + 1)
    centre_m = path_loss.distance_m(0.5 * (edges[1:] + edges[:-1]))
    return residual_trends.bin_means(ground, noise, _bin(ground.distance_db, edges), centre_m)


def _by_azimuth(ground: Ground, noise: ResidualNoise) -> Bins:
    edges = np.linspace(0.0, 360.0, _AZIMUTH_BINS + 1)
    number = _bin(np.degrees(ground.azimuth) % 360.0, edges)
    return residual_trends.bin_means(ground, noise, number, 0.5 * (edges[1:] + edges[:-1]))


def _bin(values: FloatArray, edges: FloatArray) -> IntArray:
    """Number of the bin of each value."""
    number = np.searchsorted(edges, values, side="right") - 1
    return np.clip(number, 0, len(edges) - 2)


def _innovations(filtered: FilterPath | None) -> Consistency | None:
    if filtered is None:
        return None
    return filtered.consistency or consistency(filtered.innovation_db, filtered.innovation_var_db2)


def _outliers(residual_db: FloatArray, sigma_db: float, obs: Readings) -> tuple[Outlier, ...]:
    """Readings beyond all that as many normal ones would have, the largest first."""
    sigmas = np.abs(residual_db) / sigma_db
    limit = -NormalDist().inv_cdf(0.5 * _OUTLIER_CHANCE / len(residual_db))
    beyond = np.flatnonzero(sigmas > limit)
    return tuple(
        Outlier(int(obs.scan_seq[k]), int(obs.t_ns[k]), float(residual_db[k]), float(sigmas[k]))
        for k in beyond[np.argsort(-sigmas[beyond])]
    )
