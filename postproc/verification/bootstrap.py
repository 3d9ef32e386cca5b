"""Walks simulated past a transmitter at a given position: they calibrate both tests.

Everything but the position is estimated from this walk, wherever its transmitter is: the likeliest
hypothesis of the noise, and sigma and eta drawn together from their posterior (parametric
bootstrap: Davison & Hinkley, Bootstrap Methods and their Application, 1997, ch. 4). P0 does not
matter to either test and is left out. For the direct test the noise is estimated without the
directions in which it looks for displacements: with them, shadowing seems correlated over longer
distances the larger F is by chance, and alarms are too few (a p-value with plugged-in nuisances is
too large where they depend on its statistic: Robins, van der Vaart & Ventura, J. Am. Statist.
Assoc. 95(452), 2000).

Simulated walks are stationary, so they are tested with full trust. A measured walk usually is not:
hills, streets and the antenna pattern stay in its residuals. It is tested with the trust of each
hypothesis (`logger.core.model.prior`), as the locator does, so its p-values are larger than those
of a simulated walk with the same levels would be.
"""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.blocks import Blocks
from logger.core.model.columns import distances_db, receiver_variance, varying_columns
from logger.core.model.noise import whiteners_of
from logger.core.model.prior import Prior
from logger.core.places import Places
from postproc.verification.likelihood_grid import LikelihoodGrid, likelihood_grid

_TAIL = 16
_LEAST = 1e-300
_LIKELY = 1e-4
_ANY = 300.0  # variance in units of sigma^2


@dataclass(frozen=True)
class Nuisances:
    """A `root` (n, n) of the noise's covariance by the likeliest hypothesis, and what goes with it.

    That is, for places (m,), their probability, sigma, and mean and variance of eta.
    """

    blocks: Blocks
    prior: Prior
    root: FloatArray
    probability: FloatArray
    sigma_db: FloatArray
    eta: FloatArray
    eta_variance: FloatArray

    @property
    def mean_sigma_db(self) -> float:
        """Noise that the walk shows."""
        return float(self.probability @ self.sigma_db)

    def walks(self, positions: Places, rng: np.random.Generator) -> FloatArray:
        """Levels of one walk for each position (b,) of the transmitter, shape (n, b)."""
        m = rng.choice(len(self.probability), len(positions), p=self.probability)
        eta = self.eta[m] + np.sqrt(self.eta_variance[m]) * rng.normal(size=len(m))
        sigma_db = self.sigma_db[m]
        at_db = distances_db(self.blocks, self.prior.height_m, positions)
        noise = self.root @ rng.normal(size=at_db.shape)
        extra = receiver_variance(self.blocks, self.prior, at_db)
        if extra is not None:
            noise += np.sqrt(extra) * rng.normal(size=extra.shape)
        levels_dbm = sigma_db * noise - eta * at_db
        if self.prior.antenna_db:
            size = sigma_db / self.prior.sigma_db
            levels_dbm += antenna_patterns(self.blocks, self.prior, positions, size, rng)
        return np.asarray(levels_dbm, float)


def antenna_patterns(
    blocks: Blocks,
    prior: Prior,
    positions: Places,
    size: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Random antenna patterns in dB at positions (b,), `size` (b,) times the prior's: (n, b)."""
    _, *harmonics = varying_columns(blocks, prior, positions)
    sigma_db = np.repeat(prior.antenna_db, 2)[:, None] * size
    walks = sigma_db * rng.normal(size=(len(harmonics), len(size)))
    return np.asarray(np.einsum("knb,kb->nb", np.stack(harmonics), walks), float)


def nuisances(field: LikelihoodGrid, level_dbm: FloatArray, k: FloatArray) -> Nuisances:
    """Of a walk (n,), with the covariance `k` (c, n, n) by every hypothesis of the prior."""
    log_p, variance = field.evaluate(level_dbm[:, None])
    best = int(np.argmax(field.weights(log_p)[:, 0]))
    eta, inverse = field.exponents(level_dbm)
    joint = log_p[best, :, 0] + field.log_mass
    p = np.exp(joint - np.max(joint))
    likely = p > _LIKELY
    of_noise = variance[best, likely, 0]
    return Nuisances(
        field.blocks,
        field.prior,
        np.asarray(np.linalg.cholesky(k[field.numbers[best]]), float),
        p[likely] / np.sum(p[likely]),
        np.sqrt(of_noise),
        eta[best, likely],
        of_noise * inverse[best, likely],
    )


def nuisances_off(
    bent: FloatArray, field: LikelihoodGrid, level_dbm: FloatArray, k: FloatArray
) -> Nuisances:
    """The same without what the levels have in the orthonormal directions `bent` (n, q)."""
    free = whiteners_of(k[field.numbers] + _ANY * (bent @ bent.T), field.numbers.tolist())
    return nuisances(likelihood_grid(field.blocks, field.prior, field.squares, free), level_dbm, k)


def calibrate(calm: FloatArray, statistics: FloatArray) -> FloatArray:
    """Share of the sorted `calm` (d,) at or below each of `statistics`.

    In the tail, where few are, it follows a power law through the least of them.
    """
    calm, statistics = np.maximum(calm, _LEAST), np.maximum(statistics, _LEAST)
    count = np.searchsorted(calm, statistics, side="right")
    edge = calm[_TAIL]
    steep = float(
        np.clip((_TAIL - 1.0) / max(float(np.sum(np.log(edge / calm[:_TAIL]))), 1e-9), 0.2, 5.0)
    )
    beyond = (_TAIL + 0.5) / (len(calm) + 1.0) * (np.minimum(statistics, edge) / edge) ** steep
    return np.asarray(np.where(statistics < edge, beyond, (count + 0.5) / (len(calm) + 1.0)), float)
