"""What an estimate leaves unexplained: the readings against the model, and in plain words what that
tells.

A residual is level minus model, positive where the cell is stronger than the model says. A trend
against log-distance means that the exponent changes on the way, one against azimuth that the
antenna has a direction. In 1200 simulated walks through honest worlds (3 dB white; 6 dB
decorrelating over 15 or 60 m, with and without white noise) outliers were named in 1 to 4 %, a
changing exponent in 0 to 3 % and a sector in 0 to 1 %.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import kurtosis, norm, skew

from logger.core.arrays import FloatArray
from logger.core.observations import CellObservations
from postproc.estimators import least_squares, residual_trends
from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import Consistency, consistency, lag1, mean_bounds
from postproc.estimators.residual_covariance import ResidualNoise
from postproc.estimators.residual_trends import Bend, Bins, Ground, Sector

_FEWEST = 20
_DISTANCE_BINS = 8
_AZIMUTH_BINS = 12
_ROUNDING_DB = 12.0**-0.5
_MOST_STEPS = 2000

_BEND_SIGMAS = 2.6
_SECTOR_CHI2 = 9.2
_OUTLIER_CHANCE = 0.02
_SURELY_CORRELATED = 0.01


class Outlier(NamedTuple):
    """A reading too far from the model; `sigmas` is its residual by the robust sigma."""

    scan_seq: int
    t_ns: int
    residual_db: float
    sigmas: float


@dataclass(frozen=True)
class Residuals:
    """Residuals of a state (n,) and what they look like; NaN for readings at the modem's limit.

    `sigma_db` is robust; of normal noise `skewness` and `excess_kurtosis` are 0 and
    `beyond_3_sigma` is 0.0027. `lag1` is the correlation of neighbours, `correlated` the
    probability that it is real, `decorrelation_m` the way along the walk after which it falls below
    1/e, `independent` how many independent readings these are worth at most. `bend` and `sector`
    are the likeliest trends, None where the walk cannot tell; `innovations` are a filter's, None
    without.
    """

    residual_db: FloatArray
    sigma_db: float
    skewness: float
    excess_kurtosis: float
    beyond_3_sigma: float
    lag1: float
    correlated: float
    decorrelation_m: float
    independent: float
    by_distance: Bins | None
    by_azimuth: Bins | None
    bend: Bend | None
    sector: Sector | None
    innovations: Consistency | None
    outliers: tuple[Outlier, ...]

    @property
    def findings(self) -> list[str]:
        """What stands out, in plain words; empty for an honest world."""
        return [*_trend_findings(self), *_noise_findings(self), *_filter_findings(self)]


def diagnose(
    state: FloatArray,
    obs: CellObservations,
    filtered: FilterPath | None = None,
    *,
    height_m: float = 0.0,
) -> Residuals:
    """Residuals of any estimate [x, y, P0, eta] over the readings of its cell, and the innovations
    of its filter.

    Fewer than 20 levels, or levels that fit to their rounding, are listed and not judged. A level
    that those around it do not share is named where it is an outlier, and has no part in what is
    said of the others.
    """
    residual = np.where(obs.limit == 0, -least_squares.residuals(state, obs, height_m), np.nan)
    shared = residual.copy()
    shared[[spike.k for spike in obs.spikes()]] = np.nan
    ground = _ground(state, obs, shared, height_m)
    e = ground.e_db
    sigma_db = max(float(np.median(np.abs(e))) / 0.6745, _ROUNDING_DB) if len(e) else np.nan
    innovations = _innovations(filtered)
    if len(e) < _FEWEST or float(np.std(e)) < _ROUNDING_DB:
        nan = float("nan")
        return Residuals(
            residual,
            sigma_db,
            nan,
            nan,
            nan,
            nan,
            nan,
            nan,
            float(len(e)),
            None,
            None,
            None,
            None,
            innovations,
            (),
        )
    noise = residual_trends.noise_of(ground)
    decorrelation_m, way_m = _correlation_lengths_m(ground)
    return Residuals(
        residual,
        sigma_db,
        skewness=float(skew(e)),
        excess_kurtosis=float(kurtosis(e)),
        beyond_3_sigma=float(np.mean(np.abs(e) > 3.0 * sigma_db)),
        lag1=lag1(e),
        correlated=1.0 - noise.white,
        decorrelation_m=decorrelation_m,
        independent=float(np.clip(0.5 * way_m / max(decorrelation_m, 1e-9), 1.0, len(e))),
        by_distance=_by_distance(ground, noise),
        by_azimuth=_by_azimuth(ground, noise),
        bend=residual_trends.bend(ground),
        sector=residual_trends.sector(ground),
        innovations=innovations,
        outliers=_outliers(residual, sigma_db, obs),
    )


def _ground(
    state: FloatArray, obs: CellObservations, residual: FloatArray, height_m: float
) -> Ground:
    level = np.isfinite(residual)
    dx, dy = obs.x_m - state[0], obs.y_m - state[1]
    design = least_squares.jacobian(state, obs, height_m)
    columns = (obs.x_m, obs.y_m, residual, -design[:, 3], np.arctan2(dx, dy), design)
    return Ground(*(column[level] for column in columns))


def _correlation_lengths_m(ground: Ground) -> tuple[float, float]:
    """Way over which the autocorrelation of residuals falls to 1/e, or the whole way; and the whole
    way.
    """
    way_m = np.cumsum(
        np.hypot(
            np.diff(ground.x_m, prepend=ground.x_m[0]), np.diff(ground.y_m, prepend=ground.y_m[0])
        )
    )
    whole_m, steps = float(way_m[-1]), min(len(way_m), _MOST_STEPS)
    number = np.minimum((way_m / max(whole_m, 1e-9) * steps).astype(np.int64), steps - 1)
    there = np.bincount(number, minlength=steps)
    mean = np.bincount(number, ground.e_db - np.mean(ground.e_db), steps) / np.maximum(there, 1)
    products, pairs = (
        np.correlate(v, v, "full")[steps - 1 :] for v in (mean, (there > 0).astype(float))
    )
    lag = np.flatnonzero(pairs >= 0.5)
    correlation = products[lag] / pairs[lag] / max(float(products[0] / pairs[0]), 1e-12)
    below = int(np.argmax(correlation < np.exp(-1.0)))
    if below == 0:
        return whole_m, whole_m
    fallen = np.interp(np.exp(-1.0), correlation[[below, below - 1]], lag[[below, below - 1]])
    return float(fallen) * whole_m / steps, whole_m


def _by_distance(ground: Ground, noise: ResidualNoise) -> Bins:
    edges = np.linspace(
        np.min(ground.distance_db), np.max(ground.distance_db) + 1e-9, _DISTANCE_BINS + 1
    )
    number = np.clip(
        np.searchsorted(edges, ground.distance_db, side="right") - 1, 0, _DISTANCE_BINS - 1
    )
    return residual_trends.binned(ground, noise, number, 10.0 ** (0.05 * (edges[1:] + edges[:-1])))


def _by_azimuth(ground: Ground, noise: ResidualNoise) -> Bins:
    edges = np.linspace(0.0, 360.0, _AZIMUTH_BINS + 1)
    number = (np.degrees(ground.azimuth) % 360.0 / edges[1]).astype(np.int64) % _AZIMUTH_BINS
    return residual_trends.binned(ground, noise, number, 0.5 * (edges[1:] + edges[:-1]))


def _innovations(filtered: FilterPath | None) -> Consistency | None:
    if filtered is None:
        return None
    return filtered.consistency or consistency(filtered.innovation_db, filtered.innovation_var_db2)


def _outliers(residual: FloatArray, sigma_db: float, obs: CellObservations) -> tuple[Outlier, ...]:
    """Readings further out than the furthest of as many normal ones nearly ever is, the largest
    first.
    """
    sigmas = np.abs(residual) / sigma_db
    limit = norm.isf(0.5 * _OUTLIER_CHANCE / len(residual))
    found = np.flatnonzero(sigmas > limit)
    return tuple(
        Outlier(int(obs.scan_seq[k]), int(obs.t_ns[k]), float(residual[k]), float(sigmas[k]))
        for k in found[np.argsort(-sigmas[found])]
    )


def _trend_findings(found: Residuals) -> list[str]:
    said = []
    bend, sector = found.bend, found.sector
    if bend is not None and abs(bend.eta_change) > _BEND_SIGMAS * bend.eta_sigma:
        how = "faster" if bend.eta_change > 0.0 else "more slowly"
        said.append(
            f"levels fall {how} beyond {bend.distance_m:.0f} m: the exponent changes by {bend.eta_change:+.1f}"
            f" +- {bend.eta_sigma:.1f}"
        )
    if sector is not None and sector.chi2 > _SECTOR_CHI2:
        said.append(
            f"sector antenna suspected: {sector.difference_db:.0f} +- {sector.difference_sigma_db:.0f} dB stronger"
            f" towards {sector.azimuth_deg:.0f} deg than to the other side"
        )
    return said


def _noise_findings(found: Residuals) -> list[str]:
    said = []
    if found.correlated > 1.0 - _SURELY_CORRELATED:
        said.append(
            f"residuals stay alike for about {found.decorrelation_m:.0f} m: {np.sum(np.isfinite(found.residual_db))}"
            f" readings count for {found.independent:.0f} at most"
        )
    if found.outliers:
        worst = found.outliers[0]
        how = "stronger" if worst.residual_db > 0.0 else "weaker"
        said.append(
            f"{len(found.outliers)} outlying reading{'s' * (len(found.outliers) > 1)}: the worst, of scan"
            f" {worst.scan_seq}, is {abs(worst.residual_db):.0f} dB {how} than the model ({worst.sigmas:.1f} sigma)"
        )
    return said


def _filter_findings(found: Residuals) -> list[str]:
    seen = found.innovations
    if seen is None or seen.n <= seen.n_at_limit:
        return []
    # correlated innovations say less of their mean square than their number: squares correlate by
    # rho^2
    free = (seen.n - seen.n_at_limit) / (1.0 + 2.0 * float(np.sum(np.square(seen.autocorrelation))))
    if seen.mean_nis <= mean_bounds(max(round(free), 1))[1]:
        return []
    return [
        f"the filter is too sure of itself: its innovations squared are {seen.mean_nis:.1f} times what it expects"
    ]
