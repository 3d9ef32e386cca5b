"""What an estimate leaves unexplained: the readings against the model.

A residual is level minus model, positive where the cell is stronger than the model expects. A trend
against log-distance means that the exponent changes on the way, one against azimuth that the
antenna has a direction. In 1200 simulated walks through honest worlds (3 dB white; 6 dB
decorrelating over 15 or 60 m, with and without white noise) outliers were named in 1 to 4 %, a
changing exponent in 0 to 3 % and a sector in 0 to 1 %.

Shadowing belongs to the ground, so residuals are alike where points are near, whenever measured.
With D_ij the distance of two squares, a the white share, d_c the decorrelation distance and n_i the
readings of a square, `model.noise` has

    cov(e_i, e_j) = sigma^2 [(1 - a) exp(-D_ij / d_c) + delta_ij (a / n_i + rounding)]

(Gudmundson, Electron. Lett. 27(23), 1991). Residuals of a fit look whiter than the noise was, since
the fit follows it; restricted likelihood allows for that (Patterson & Thompson, Biometrika 58(3),
1971). With X the fit's design of k columns, m squares and s the squared residuals off X in the
metric of K:

    log p(a, d_c | e) = -1/2 log|K| - 1/2 log|X' K^-1 X| - (m - k) / 2 log s + const
    E sigma^2 = (s + SIGMA_DB^2) / (m - k - 1)

The covariance is the mean over the hypotheses short enough for the walk to tell. With it trends are
tested beside the fit's own columns: with further columns T, all averaged over squares and whitened,
the part of T off X gives the generalised least-squares estimate (Frisch & Waugh, Econometrica 1(4),
1933)

    b = (T' T)^-1 T' e,    cov b = (T' T)^-1
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import nan
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.posterior import Posterior
from logger.core.model import marginal, path_loss
from logger.core.model.blocks import squares
from logger.core.model.noise import Whitener, independent_variance, shadowing, whiteners_of
from logger.core.model.prior import WHITE, Hypothesis, Prior
from logger.core.places import Places
from logger.core.readings import Readings
from postproc.estimators.filters import FilterPath
from postproc.estimators.least_squares_rows import each_reading
from postproc.estimators.metrics import Consistency, consistency, lag1, mean_bounds

_WHITE_SHARES = 0.1, 0.5
_DECORRELATION_M = 12.0, 35.0, 110.0, 350.0, 1100.0
_TRUST = 0.5
"""Noise considered: each pair of share and distance is as likely as white noise alone.

Half of 464 measured walks decorrelated within 22 m, nearly all within 12 to 390 m. Variances of
correlated noise are divided by the trust: regions that trusted the exponential fully held the truth
in 78 % of 165 measured walks where 95 % were meant."""
SIGMA_DB = Prior().sigma_db
"""Median of those walks with the true position known; counts as one more reading."""

_MOST_SQUARES = 300  # their covariance is factored for each hypothesis
_FLAT = 1e-9  # precision of columns whose mean square is 1: nothing but keeps them invertible
_NEGLIGIBLE_DB2 = 1e-9  # misfit of levels that fit exactly


class ResidualNoise(NamedTuple):
    """Noise of residuals averaged over squares.

    `square` (n,) is the number of the square each row lies in; `covariance_db2` (m, m) is that of
    the squares' means; `white` the probability that nothing is correlated; `white_share` and
    `decorrelation_m` are means over the correlated hypotheses.
    """

    square: IntArray
    covariance_db2: FloatArray
    white: float
    white_share: float
    decorrelation_m: float


def averages(square: IntArray, weight: FloatArray, values: FloatArray) -> FloatArray:
    """Weighted means of the rows of `values`, (n,) or (n, k), in each square."""
    total = np.bincount(square, weight)
    columns = [np.bincount(square, weight * column) / total for column in np.atleast_2d(values.T)]
    return np.asarray(columns[0] if values.ndim == 1 else np.column_stack(columns), float)


def unit_columns(design: FloatArray) -> FloatArray:
    """The design (n, k) with columns of unit mean square, for rank and rounding."""
    scale = np.sqrt(np.mean(design**2, axis=0))
    return np.asarray(design / np.maximum(scale, 1e-300), float)


class Shapes(NamedTuple):
    """What may correlate the residuals of a walk, whatever is fitted to them.

    `square` (n,) is as in `ResidualNoise`, `k` (c, m, m) the covariance of the squares' means in
    units of sigma^2 under each of the `hypotheses`, with its `whiteners`.
    """

    square: IntArray
    weight: FloatArray
    hypotheses: list[Hypothesis]
    k: FloatArray
    whiteners: list[Whitener]

    @classmethod
    def of(cls, places: Places, readings: FloatArray, weight: FloatArray) -> "Shapes":
        """`readings` (n,) is how many a row stands for; the weights (n,) are positive."""
        square, _ = squares(places, _MOST_SQUARES)
        x, y = (averages(square, weight, v) for v in (places.x_m, places.y_m))
        n_there = np.bincount(square, readings).astype(float)
        apart_m = Places.of(x, y).distances_m(Places.of(x, y))
        hypotheses = _testable(0.5 * float(np.max(apart_m)))
        k = np.array([_shape(apart_m, n_there, h) for h in hypotheses])
        return cls(square, weight, hypotheses, k, whiteners_of(k))


def residual_noise(shapes: Shapes, design: FloatArray, residual_db: FloatArray) -> ResidualNoise:
    """Noise that the residuals (n,) of a weighted fit with this design (n, k) show."""
    square, weight, hypotheses, k, whiteners = shapes
    e, scaled = (averages(square, weight, v) for v in (residual_db, unit_columns(design)))
    likelihoods = [_restricted_likelihood(one, scaled, e) for one in whiteners]
    log_p, variance_db2 = np.array(likelihoods).T
    p = np.exp(log_p - np.max(log_p))
    p /= np.sum(p)
    white_share, decorrelation_m = np.array([(h.white_share, h.short_m) for h in hypotheses]).T
    trust = np.where(white_share < 1.0, _TRUST, 1.0)
    covariance = np.einsum("h,hij->ij", p * variance_db2 / trust, k)
    correlated = p[1:] / max(np.sum(p[1:]), 1e-300)
    return ResidualNoise(
        square,
        covariance,
        white=float(p[0]),
        white_share=float(correlated @ white_share[1:]),
        decorrelation_m=float(correlated @ decorrelation_m[1:]),
    )


def _testable(longest_m: float) -> list[Hypothesis]:
    """Hypotheses whose decorrelation distance the walk can tell from a trend; the first is white.

    A trend is taken up by the fit.
    """
    longest_m = max(longest_m, _DECORRELATION_M[0])
    distances_m = [distance_m for distance_m in _DECORRELATION_M if distance_m <= longest_m]
    return [WHITE, *(Hypothesis(a, d_m) for a in _WHITE_SHARES for d_m in distances_m)]


def _shape(apart_m: FloatArray, readings: FloatArray, hypothesis: Hypothesis) -> FloatArray:
    """K of one hypothesis in units of sigma^2, shape (m, m)."""
    independent = independent_variance(readings, hypothesis.white_share, SIGMA_DB)
    return shadowing(apart_m, hypothesis) + np.diag(independent)


def _restricted_likelihood(
    shape: Whitener, design: FloatArray, e: FloatArray
) -> tuple[float, float]:
    """Log restricted likelihood of K, and the mean of sigma^2 under it.

    The coefficients of the design are integrated out under a flat prior.
    """
    k = design.shape[1]
    white = shape.matrix @ np.column_stack([e, design])
    sums = (white.T @ white)[np.tril_indices(k + 1)]
    flat = marginal.prior_sums(np.zeros(k), _FLAT * np.eye(k))
    no_weight, sigma_1 = 0.0, np.zeros((1, 1))
    rest = marginal.fit(np.append(sums, no_weight)[:, None, None], flat[:, None, None], sigma_1)
    misfit_db2, free = max(float(rest.misfit[0, 0]), 0.0), max(len(e) - k, 0)
    log_det = shape.log_det + float(rest.log_det[0, 0])
    log_p = -0.5 * (log_det + free * np.log(misfit_db2 + _NEGLIGIBLE_DB2))
    return log_p, (misfit_db2 + SIGMA_DB**2) / max(free - 1.0, 0.5)


_LEAST_OFF_SHARE = 1e-3  # of a column off the fit's: less is rounding
_SINGULAR = 1e-6  # singular values below it are rounding
_LEAST_SIGMA_DB = 0.01  # a bin that the fit passes through exactly
_BREAKPOINTS = (0.25, 0.5, 0.75)  # of the range of L


@dataclass(frozen=True)
class Ground:
    """Levels of a walk, shape (n,): places, residual `e_db`, L = 10 log10 d, azimuth in radians.

    The azimuth is that seen from the estimate; `design` (n, 4) is the derivative of the model by
    the state.
    """

    places: Places
    e_db: FloatArray
    distance_db: FloatArray
    azimuth: FloatArray
    design: FloatArray

    @cached_property
    def shapes(self) -> Shapes:
        """What may correlate the residuals: several tests ask for it."""
        one = np.ones(len(self.e_db))
        return Shapes.of(self.places, one, one)


class Bins(NamedTuple):
    """Mean residuals and their standard errors, shape (m,), in bins about `centre`.

    The unit is metres, or degrees of azimuth.
    """

    centre: FloatArray
    mean_db: FloatArray
    sigma_db: FloatArray
    readings: IntArray


class ExponentChange(NamedTuple):
    """Change of the exponent beyond a distance, and its standard error.

    Positive where levels fall faster there.
    """

    distance_m: float
    eta_change: float
    eta_sigma: float


class Sector(NamedTuple):
    """Direction in which levels are strongest, and the difference to the opposite one.

    `chi2` has 2 degrees of freedom.
    """

    azimuth_deg: float
    difference_db: float
    difference_sigma_db: float
    chi2: float


def noise_of(ground: Ground, *columns: FloatArray) -> ResidualNoise:
    """Noise of the residuals beside the fit and further columns (n,)."""
    design = np.column_stack([ground.design, *columns])
    return residual_noise(ground.shapes, design, ground.e_db)


def exponent_change(ground: Ground) -> ExponentChange | None:
    """The most significant change of the exponent beyond a quarter, half or three quarters of L."""
    low, high = np.quantile(ground.distance_db, [0.02, 0.98])
    changes = []
    for share in _BREAKPOINTS:
        break_db = low + share * (high - low)
        estimate = _estimate_beside_fit(ground, -np.maximum(ground.distance_db - break_db, 0.0))
        if estimate is not None:
            (change,), ((variance,),) = estimate
            distance_m = float(path_loss.distance_m(break_db))
            changes.append(ExponentChange(distance_m, float(change), float(np.sqrt(variance))))
    return max(changes, key=lambda c: abs(c.eta_change) / c.eta_sigma, default=None)


def sector(ground: Ground) -> Sector | None:
    """First harmonic of the residuals over the azimuth: e = a sin + b cos."""
    estimate = _estimate_beside_fit(ground, np.sin(ground.azimuth), np.cos(ground.azimuth))
    if estimate is None:
        return None
    harmonic, covariance = estimate
    size = max(float(np.hypot(*harmonic)), 1e-12)
    direction = harmonic / size
    return Sector(
        azimuth_deg=float(np.degrees(np.arctan2(*harmonic)) % 360.0),
        difference_db=2.0 * size,
        difference_sigma_db=2.0 * float(np.sqrt(direction @ covariance @ direction)),
        chi2=float(harmonic @ np.linalg.solve(covariance, harmonic)),
    )


def _estimate_beside_fit(
    ground: Ground, *columns: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Coefficients (k,) of further columns and their covariance.

    None where the fit explains all that they do.
    """
    noise = noise_of(ground, *columns)
    rows = np.column_stack([unit_columns(ground.design), *columns, ground.e_db])
    rows = averages(noise.square, np.ones(len(rows)), rows)
    white = np.linalg.solve(np.linalg.cholesky(noise.covariance_db2), rows)
    design, further = white[:, :4], white[:, 4:]
    off = further - _project(design, further)
    off_columns, e = off[:, :-1], off[:, -1]
    if len(rows) <= rows.shape[1]:
        return None
    least = _LEAST_OFF_SHARE * np.linalg.norm(further[:, :-1], 2)
    if np.linalg.norm(off_columns, -2) < least:
        return None
    covariance = np.asarray(np.linalg.inv(off_columns.T @ off_columns), float)
    return covariance @ off_columns.T @ e, covariance


def _project(design: FloatArray, values: FloatArray) -> FloatArray:
    """The part of the columns of `values` that the design spans."""
    basis, size, _ = np.linalg.svd(design, full_matrices=False)
    basis = basis[:, size > _SINGULAR * size[0]]
    return np.asarray(basis @ (basis.T @ values), float)


def bin_means(ground: Ground, noise: ResidualNoise, number: IntArray, centre: FloatArray) -> Bins:
    """Mean residual of each bin; `number` (n,) is the bin of each level.

    The standard error is that of residuals left by a fit, (I - H) Omega (I - H)' with H = X (X'
    X)^-1 X'.
    """
    of_square = np.zeros((len(centre), len(noise.covariance_db2)))
    np.add.at(of_square, (number, noise.square), 1.0)
    readings = np.sum(of_square, axis=1).astype(np.int64)
    occupied = np.flatnonzero(readings)
    mean = of_square[occupied] / readings[occupied, None]
    root = np.sqrt(np.bincount(noise.square))
    ones = np.ones(len(number))
    design = root[:, None] * averages(noise.square, ones, unit_columns(ground.design))
    off = mean - root * _project(design, (mean / root).T).T
    variance = np.einsum("bi,ij,bj->b", off, noise.covariance_db2, off)
    sigma_db = np.maximum(np.sqrt(variance), _LEAST_SIGMA_DB)
    mean_db = np.bincount(number, ground.e_db, len(centre))[occupied] / readings[occupied]
    return Bins(centre[occupied], mean_db, sigma_db, readings[occupied])


_FEWEST = 20  # levels; fewer show no distribution
_DISTANCE_BINS = 8
_AZIMUTH_BINS = 12
ROUNDING_DB = 12.0**-0.5  # of levels in whole dB
SIGMA_PER_MEDIAN = 1.0 / 0.6745  # of the absolute value, of a normal law
_MOST_STEPS = 2000  # of the autocorrelation along the walk
_OUTLIER_CHANCE = 0.02  # that any level of normal noise is named


class Outlier(NamedTuple):
    """A reading too far from the model; `sigmas` is its residual divided by the robust sigma.

    `k` numbers the readings of the cell from 0, `scan_seq` all records of the run.
    """

    k: int
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


def state_at_place(posterior: Posterior, obs: Readings) -> FloatArray:
    """[x, y, P0, eta] of the place shown, with P0 and eta given that place.

    Those of the posterior are means over all places that are possible and describe the levels as
    seen from none of them: in most walks they miss these by 5 dB or more. `obs` are readings on one
    scale.
    """
    inside, prior = obs.part(obs.limit == 0), posterior.prior
    distance_db = inside.places.log_distance_to(posterior.place, prior.height_m)[:, 0]
    columns = np.stack([np.ones(len(inside)), -distance_db], axis=1) / posterior.sigma_db
    mean, precision = (values[:2] for values in prior.coefficients)
    of_prior = np.diag(precision)
    p0_dbm, eta = np.linalg.solve(
        columns.T @ columns + of_prior,
        columns.T @ (inside.level_dbm / posterior.sigma_db) + of_prior @ mean,
    )
    return np.array([posterior.x_m, posterior.y_m, p0_dbm, eta])


def diagnose(
    state: FloatArray,
    obs: Readings,
    filtered: FilterPath | None = None,
    *,
    height_m: float = 0.0,
) -> Residuals:
    """Residuals of an estimate [x, y, P0, eta] over the readings of its cell.

    `filtered` adds the innovations of its filter. Of fewer than 20 levels, or levels that fit to
    their rounding, only residuals and sigma are given. A level that those around it do not share
    counts only as an outlier; a repeated level does not count.
    """
    rows = each_reading(obs, height_m)
    residual_db = np.where(obs.limit == 0, -rows.residuals(state), np.nan)
    shared_db = residual_db.copy()
    shared_db[[spike.k for spike in obs.spikes]] = np.nan
    shared_db[obs.repeats] = np.nan
    ground = _ground(state, obs, shared_db, height_m)
    e = ground.e_db
    sigma_db = nan
    if len(e):
        sigma_db = max(float(np.median(np.abs(e))) * SIGMA_PER_MEDIAN, ROUNDING_DB)
    innovations = _innovations(filtered)
    if len(e) < _FEWEST or float(np.std(e)) < ROUNDING_DB:
        return Residuals(
            residual_db=residual_db,
            sigma_db=sigma_db,
            independent=float(len(e)),
            innovations=innovations,
        )
    noise = noise_of(ground)
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
        exponent_change=exponent_change(ground),
        sector=sector(ground),
        innovations=innovations,
        outliers=_outliers(residual_db, sigma_db, obs),
    )


def _standard_moment(values: FloatArray, order: int) -> float:
    off = values - np.mean(values)
    return float(np.mean(off**order) / np.mean(off**2) ** (0.5 * order))


def _ground(state: FloatArray, obs: Readings, residual_db: FloatArray, height_m: float) -> Ground:
    level = np.isfinite(residual_db)
    azimuth = np.arctan2(obs.x_m - state[0], obs.y_m - state[1])
    design = each_reading(obs, height_m).jacobian(state)
    columns = (residual_db, -design[:, 3], azimuth, design)
    return Ground(obs.places.part(level), *(column[level] for column in columns))


def _correlation_lengths_m(ground: Ground) -> tuple[float, float]:
    """Way over which the autocorrelation of residuals falls to 1/e, and the length of the walk.

    The former is the latter where it never falls so far.
    """
    way_m = np.cumsum(np.hypot(*(np.diff(v, prepend=v[0]) for v in ground.places.xy_m)))
    length_m, steps = float(way_m[-1]), min(len(way_m), _MOST_STEPS)
    number = np.minimum((way_m / max(length_m, 1e-9) * steps).astype(np.int64), steps - 1)
    count = np.bincount(number, minlength=steps)
    mean = np.bincount(number, ground.e_db - np.mean(ground.e_db), steps) / np.maximum(count, 1)
    series = mean, (count > 0).astype(float)
    products, pairs = (np.correlate(v, v, "full")[steps - 1 :] for v in series)  # at lags from 0
    lag = np.flatnonzero(pairs >= 0.5)
    correlation = products[lag] / pairs[lag] / max(float(products[0] / pairs[0]), 1e-12)
    below = int(np.argmax(correlation < np.exp(-1.0)))
    if below == 0:
        return length_m, length_m
    around = [below, below - 1]
    fall = np.interp(np.exp(-1.0), correlation[around], lag[around])
    return float(fall) * length_m / steps, length_m


def _by_distance(ground: Ground, noise: ResidualNoise) -> Bins:
    low, high = np.min(ground.distance_db), np.max(ground.distance_db)
    edges = np.linspace(low, high + 1e-9, _DISTANCE_BINS + 1)
    centre_m = path_loss.distance_m(0.5 * (edges[1:] + edges[:-1]))
    return bin_means(ground, noise, _bin(ground.distance_db, edges), centre_m)


def _by_azimuth(ground: Ground, noise: ResidualNoise) -> Bins:
    edges = np.linspace(0.0, 360.0, _AZIMUTH_BINS + 1)
    number = _bin(np.degrees(ground.azimuth) % 360.0, edges)
    return bin_means(ground, noise, number, 0.5 * (edges[1:] + edges[:-1]))


def _bin(values: FloatArray, edges: FloatArray) -> IntArray:
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
        Outlier(k, int(obs.scan_seq[k]), int(obs.t_ns[k]), float(residual_db[k]), float(sigmas[k]))
        for k in beyond[np.argsort(-sigmas[beyond])].tolist()
    )


# limits at which a change is named in 1 % of honest walks
_CHANGE_SIGMAS = 2.6
_SECTOR_CHI2 = 9.2
# antennas are weaker to the back by 25 to 40 dB: more is another effect, seen from one side
_MOST_SECTOR_DB = 40.0
_CERTAINLY_CORRELATED = 0.99


def findings(left: Residuals) -> list[str]:
    """One sentence for each; empty for a walk that the model explains."""
    return [*_trends(left), *_noise(left), *_filter(left)]


def _trends(left: Residuals) -> Iterator[str]:
    change, sector = left.exponent_change, left.sector
    if change is not None and abs(change.eta_change) > _CHANGE_SIGMAS * change.eta_sigma:
        how = "faster" if change.eta_change > 0.0 else "more slowly"
        yield (
            f"levels fall {how} beyond {change.distance_m:.0f} m: "
            f"the exponent changes by {change.eta_change:+.1f} +- {change.eta_sigma:.1f}"
        )
    least_db = sector.difference_db - 2.0 * sector.difference_sigma_db if sector else 0.0
    if sector is not None and sector.chi2 > _SECTOR_CHI2 and least_db < _MOST_SECTOR_DB:
        yield (
            f"sector antenna suspected: {sector.difference_db:.0f} +- "
            f"{sector.difference_sigma_db:.0f} dB stronger towards {sector.azimuth_deg:.0f} deg "
            "than to the opposite side"
        )


def _noise(left: Residuals) -> Iterator[str]:
    if left.correlated > _CERTAINLY_CORRELATED:
        yield (
            f"residuals are correlated over about {left.decorrelation_m:.0f} m: "
            f"{np.sum(np.isfinite(left.residual_db))} readings count for "
            f"{left.independent:.0f} at most"
        )
    if left.outliers:
        worst = left.outliers[0]
        how = "stronger" if worst.residual_db > 0.0 else "weaker"
        yield (
            f"{len(left.outliers)} outlying reading{'s' * (len(left.outliers) > 1)}: the worst, "
            f"reading {worst.k + 1} of {len(left.residual_db)}, is {abs(worst.residual_db):.0f} dB "
            f"{how} than the model ({worst.sigmas:.1f} sigma)"
        )


def _filter(left: Residuals) -> Iterator[str]:
    consistency = left.innovations
    if consistency is None or consistency.n <= consistency.n_at_limit:
        return
    # squares of correlated innovations correlate by rho^2, so there are fewer independent ones
    correlated = 1.0 + 2.0 * float(np.sum(np.square(consistency.autocorrelation)))
    independent = (consistency.n - consistency.n_at_limit) / correlated
    if consistency.mean_nis > mean_bounds(max(round(independent), 1))[1]:
        yield (
            "the filter is overconfident: its squared innovations are "
            f"{consistency.mean_nis:.1f} times what it expects"
        )
