"""What a walk says about one place: its likelihood with power, exponent and noise integrated out.

Model of the mean level z_k in block k of the walk, L_k = 10 log10 d_k:

    z = P0 - eta L(x, y) + v,    v ~ N(0, sigma^2 K),    K_ij = (1 - a) exp(-D_ij / d_c) + a delta_ij / n_i

with D_ij the distance of two blocks (shadowing is a property of the place: Gudmundson, Electron. Lett. 27(23), 1991),
a the white share and n_i the readings of the block. Given (x, y), sigma, a and d_c the model is linear in P0 and eta,
which are integrated in closed form; sigma, a and d_c are summed over small sets; (x, y) is a tree of square cells
split where the mass is. With Phi = [1, -L],
A = Phi' K^-1 Phi / sigma^2 + Lambda0 and b = Phi' K^-1 z / sigma^2 + Lambda0 m0:

    log p(z | x, y, sigma, a, d_c) = -n log sigma - 1/2 log|K| + 1/2 log|Lambda0| - 1/2 log|A|
                                     - 1/2 (z' K^-1 z / sigma^2 + m0' Lambda0 m0 - b' A^-1 b) + const

(marginalised point mass; Schoen, Gustafsson & Nordlund, IEEE Trans. Signal Process. 53(7), 2005).
"""

from dataclasses import dataclass
from math import log
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from logger.core.arrays import FloatArray, IntArray
from logger.core.observations import CellObservations

_C = 10.0 / log(10.0)
_FINEST_BLOCK_M = 2.0
_MAX_BLOCKS = 300
_MAX_POINTS = 1000
_READINGS_BELIEVED = 16
_ROUNDING_DB2 = 1.0 / 12.0
_CHUNK = 512
_NEGLIGIBLE = 0.995


@dataclass(frozen=True, slots=True)
class Prior:
    """What is believed before the walk; printed with every result.

    P0 and eta are normal, sigma is log-normal, the pairs (white share, decorrelation distance) and white noise alone
    are equally likely. The position is uniform within `near_m` of the walk and falls with the distance to the power
    of `far_power` beyond, up to `reach_m`; with 2 every octave of range would count the same. The antenna is `height_m`
    above the receiver. `trust` is the weight of the log-likelihood where the residuals are correlated: an exponential
    correlation is a guess about houses and hills, and in measured walks a weight of 1 was too sure of itself
    (generalised posterior: Bissiri, Holmes & Walker, JRSS-B 78(5), 2016).
    """

    p0_dbm: float = -40.0
    p0_sigma_db: float = 30.0
    eta: float = 2.6
    eta_sigma: float = 0.9
    sigma_db: float = 5.4
    sigma_log_sd: float = 0.45
    decorrelation_m: tuple[float, ...] = (12.0, 35.0, 110.0, 350.0, 1100.0)
    white_shares: tuple[float, ...] = (0.1, 0.5)
    near_m: float = 200.0
    far_power: float = 3.0
    height_m: float = 10.0
    trust: float = 0.5
    reach_m: float = 30_000.0

    @property
    def noise_pairs(self) -> list[tuple[float, float]]:
        """White share and decorrelation distance of each hypothesis; the first is white noise alone."""
        return [(1.0, 0.0)] + [(a, d) for a in self.white_shares for d in self.decorrelation_m]

    @property
    def precision(self) -> FloatArray:
        """Lambda0, the inverse variances of P0 and eta, shape (2,)."""
        return np.array([self.p0_sigma_db**-2, self.eta_sigma**-2])


class Track(NamedTuple):
    """The walk in blocks of readings taken at about one place.

    `x_m, y_m, weight` are supporting points, shape (m,); block k has those from `first[k]` on, weights sum to 1.
    `block_x_m, block_y_m, level_dbm, readings, position_sigma_m` have shape (n,); `size_m` is the side of a block.
    """

    x_m: FloatArray
    y_m: FloatArray
    weight: FloatArray
    first: IntArray
    block_x_m: FloatArray
    block_y_m: FloatArray
    level_dbm: FloatArray
    readings: FloatArray
    position_sigma_m: FloatArray
    size_m: float


class Noise(NamedTuple):
    """Hypothesis `number` of the residuals' covariance: `whitener` W with W K W' = I, shape (n, n), and log |K|."""

    number: int
    white_share: float
    decorrelation_m: float
    whitener: FloatArray
    log_det: float


class Evidence(NamedTuple):
    """Per position, shape (h,): log p(z | x, y) and the mean of sigma, given all else.

    `theta` (2, h) is the mean of (P0, eta), `theta_cov` (3, h) their var, cov, var, `by_noise` (c, h) the share of
    each noise hypothesis.
    """

    log_p: FloatArray
    theta: FloatArray
    theta_cov: FloatArray
    sigma_db: FloatArray
    by_noise: FloatArray


def blocks(obs: CellObservations) -> Track:
    """Gather the readings of one place, whenever taken, into blocks; at most 300 of them.

    Standing still or walking a street twice adds readings to a block and no block.
    """
    fine = _grid(obs.x_m, obs.y_m, _MAX_POINTS)[0]
    count = np.bincount(fine).astype(float)
    mean = [np.bincount(fine, v) / count for v in (obs.x_m, obs.y_m, obs.level_dbm, obs.position_sigma_m**2)]
    coarse, size_m = _grid(mean[0], mean[1], _MAX_BLOCKS)
    order = np.argsort(coarse, kind="stable")
    coarse, count, (x, y, level, variance) = coarse[order], count[order], [v[order] for v in mean]
    total = np.asarray(np.bincount(coarse, count), float)
    weight = count / total[coarse]
    bx, by, bl, bv = (np.asarray(np.bincount(coarse, weight * v), float) for v in (x, y, level, variance))
    first = np.searchsorted(coarse, np.arange(len(total)))
    return Track(x, y, weight, first, bx, by, bl, total, np.sqrt(bv), size_m)


def _grid(x_m: FloatArray, y_m: FloatArray, most: int) -> tuple[IntArray, float]:
    """Number of the square each point lies in, squares as small as `most` of them allow."""
    size_m = _FINEST_BLOCK_M
    while True:
        column = np.floor((x_m - np.mean(x_m)) / size_m).astype(np.int64)
        row = np.floor((y_m - np.mean(y_m)) / size_m).astype(np.int64)
        key = (row - row.min()) * (int(np.ptp(column)) + 1) + column - column.min()
        found, index = np.unique(key, return_inverse=True)
        if len(found) <= most:
            return index.astype(np.int64), size_m
        size_m *= 1.25


def noises(track: Track, prior: Prior) -> list[Noise]:
    """Covariance hypotheses, white noise first."""
    distance = np.hypot(track.block_x_m[:, None] - track.block_x_m, track.block_y_m[:, None] - track.block_y_m)
    # fading stays the same for a while where one stands: more readings are not believed
    white = 1.0 / np.minimum(track.readings, _READINGS_BELIEVED)
    rounding = _ROUNDING_DB2 / prior.sigma_db**2
    found = []
    for number, (a, d_c) in enumerate(prior.noise_pairs):
        k = (1.0 - a) * np.exp(-distance / max(d_c, 1.0))
        k[np.diag_indices_from(k)] += a * white + rounding
        root = cholesky(k, lower=True)
        whitener = solve_triangular(root, np.eye(len(k)), lower=True)
        found.append(Noise(number, a, d_c, whitener, 2.0 * float(np.sum(np.log(np.diag(root))))))
    return found


def distances_db(track: Track, height_m: float, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """L = 10 log10 d of each block from each position, shape (n, h).

    An uncertain receiver is farther away on average, E d^2 = d^2 + 2 sigma^2; the height adds too; at least 1 m.
    """
    spread = np.repeat(2.0 * track.position_sigma_m**2, np.diff(np.append(track.first, len(track.x_m))))
    d2 = (x_m - track.x_m[:, None]) ** 2 + (y_m - track.y_m[:, None]) ** 2 + spread[:, None] + height_m**2
    each = 5.0 * np.log10(np.maximum(d2, 1.0))
    return np.asarray(np.add.reduceat(track.weight[:, None] * each, track.first, axis=0), float)


def receiver_weights(track: Track, prior: Prior, distance_db: FloatArray) -> FloatArray:
    """Factor on a block's row for the error of the receiver's position, shape (n, h).

    An error sigma_g at distance d moves the level by C eta sigma_g / d; the row's variance grows by the square of it,
    its correlation with other rows stays (position errors last as shadowing does).
    """
    error_db = _C * prior.eta * track.position_sigma_m[:, None] * 10.0 ** (-0.1 * distance_db)
    weight = 1.0 / np.sqrt(1.0 + (error_db / prior.sigma_db) ** 2)
    return np.where(np.min(weight, axis=0) < _NEGLIGIBLE, weight, 1.0)


def evidence(track: Track, found: list[Noise], prior: Prior, x_m: FloatArray, y_m: FloatArray) -> Evidence:
    """Likelihood of positions with P0, eta, sigma and the noise integrated out; x_m, y_m have shape (h,)."""
    parts = [
        _evidence(track, found, prior, x_m[i : i + _CHUNK], y_m[i : i + _CHUNK]) for i in range(0, len(x_m), _CHUNK)
    ]
    return Evidence(*(np.concatenate(values, axis=-1) for values in zip(*parts, strict=True)))


def sigma_nodes(prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Values of sigma in dB, 10 % apart, and their log prior weights."""
    sigma = prior.sigma_db * 1.1 ** np.arange(-18.0, 15.0)
    log_weight = -0.5 * (np.log(sigma / prior.sigma_db) / prior.sigma_log_sd) ** 2
    return sigma, log_weight - np.log(np.sum(np.exp(log_weight)))


def _evidence(track: Track, found: list[Noise], prior: Prior, x_m: FloatArray, y_m: FloatArray) -> Evidence:
    distance_db = distances_db(track, prior.height_m, x_m, y_m)
    weight = receiver_weights(track, prior, distance_db)
    sigma, log_weight = sigma_nodes(prior)
    results = [_linear(track, noise, prior, distance_db, weight, sigma) for noise in found]
    log_p = np.stack([r[0] for r in results]) + log_weight[None, :, None] - log(len(prior.noise_pairs))
    top = np.max(log_p, axis=(0, 1))
    share = np.exp(log_p - top)
    total = np.sum(share, axis=(0, 1))
    share /= total
    moments = np.stack([r[1] for r in results])  # (c, 5, s, h): P0, eta, var P0, cov, var eta
    p0, eta, v00, v01, v11 = np.moveaxis(moments, 1, 0)
    mean0, mean1 = np.sum(share * p0, axis=(0, 1)), np.sum(share * eta, axis=(0, 1))
    cov = [
        np.sum(share * (v + da * db), axis=(0, 1))
        for v, da, db in (
            (v00, p0 - mean0, p0 - mean0),
            (v01, p0 - mean0, eta - mean1),
            (v11, eta - mean1, eta - mean1),
        )
    ]
    by_noise = np.zeros((len(prior.noise_pairs), len(x_m)))
    by_noise[[noise.number for noise in found]] = np.sum(share, axis=1)
    return Evidence(
        top + np.log(total),
        np.stack([mean0, mean1]),
        np.stack(cov),
        np.sum(share * sigma[None, :, None], axis=(0, 1)),
        by_noise,
    )


def _linear(
    track: Track, noise: Noise, prior: Prior, distance_db: FloatArray, weight: FloatArray, sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Log evidence (s, h) and moments of (P0, eta) (5, s, h) for one noise hypothesis."""
    near = np.any(weight < 1.0, axis=0)
    w = noise.whitener
    slope = w @ (-weight * distance_db)
    one = np.repeat(np.sum(w, axis=1)[:, None], len(near), axis=1)
    level = np.repeat((w @ track.level_dbm)[:, None], len(near), axis=1)
    if np.any(near):
        one[:, near] = w @ weight[:, near]
        level[:, near] = w @ (weight[:, near] * track.level_dbm[:, None])
    s2 = sigma[:, None] ** 2

    def dot(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("nh,nh->h", a, b) / s2, float)

    lam, mean = prior.precision, np.array([prior.p0_dbm, prior.eta])
    a00, a01, a11 = dot(one, one) + lam[0], dot(one, slope), dot(slope, slope) + lam[1]
    b0, b1 = dot(one, level) + lam[0] * mean[0], dot(slope, level) + lam[1] * mean[1]
    det = a00 * a11 - a01 * a01
    p0, eta = (a11 * b0 - a01 * b1) / det, (a00 * b1 - a01 * b0) / det
    misfit = dot(level, level) + np.sum(lam * mean**2) - b0 * p0 - b1 * eta
    log_p = -0.5 * (misfit + np.log(det) - np.sum(np.log(lam)) + noise.log_det)
    n = len(track.level_dbm)
    log_p += np.sum(np.log(weight), axis=0) - n * np.log(sigma)[:, None]
    return log_p, np.stack([p0, eta, a11 / det, -a01 / det, a00 / det])
