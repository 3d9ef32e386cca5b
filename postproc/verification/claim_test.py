"""One claim against one walk: how likely its levels are if the transmitter stands there.

The statistic S is the probability of all positions that are less likely than the claim in the
posterior of the walk: 1 - the level of the smallest highest-density region that contains it. The
density of an uncertain claim is its mean over the claim's positions. S is a sum over the complete
posterior, so several modes make no difference. As a p-value S is right on average over the prior;
walks simulated from the claim make it right for the claim, and walks simulated from elsewhere give
its power.

Everything but the position is estimated from this walk, wherever its transmitter is: the likeliest
hypothesis of the noise, and sigma and eta drawn together from their posterior (parametric
bootstrap: Davison & Hinkley, Bootstrap Methods and their Application, 1997, ch. 4). P0 does not
matter and is left out.

This holds for noise that is known to be stationary, as that of a simulated run is. In a measured
walk all parts may agree on a wrong position: a directional antenna or a hill changes levels as a
displacement does. Therefore the test tempers the likelihood and adds a first harmonic of the
azimuth as one more unknown, in the simulated walks too. Since a measured walk is not like those,
they may only raise its p-value.
"""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.model.blocks import Blocks
from logger.core.model.columns import distances_db, receiver_variance, varying_columns
from logger.core.model.noise import covariances, inverse_of_lower, whiteners_of
from logger.core.model.prior import Prior, Station
from logger.core.places import Places
from postproc.verification.likelihood_grid import (
    LikelihoodGrid,
    coarse_squares,
    likelihood_grid,
    refine,
)
from postproc.verification.verdicts import Detectable

DRAWS = 240
"""Walks simulated from a claim."""
ANTENNA_DB = 6.0
"""Sigma of cosine and sine of a measured transmitter's pattern, 15 dB front to back on average.

Chosen on the measured walks; 3 or 10 dB give similar results.
"""
POWER = 0.95
BEARINGS_DEG = (0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)

_COARSE = 550  # squares: of the walk's posterior to be refined for a claim
_FINE = 1600  # where the noise is estimated
_MOST_SQUARES = 800  # for a claim
_SCOUTS = 12  # simulated walks by which it is refined
_BELOW = 1e-9
_TAIL = 16
_LEAST = 1e-300
_LIKELY = 1e-4
_APART_M = 6.0
_FEWEST_PLACES = 32
_MOST_PLACES = 256
_GOLDEN_RAD = np.pi * (3.0 - 5.0**0.5)
_SHARES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0)  # displacements tried, of the distance to the walk
_POWER_DRAWS = 32
_NEARLY = 0.9
_BATCH = 256


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
        """Levels of one walk for each place (b,) of the transmitter, shape (n, b)."""
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


@dataclass(frozen=True)
class PreparedWalk:
    """A walk ready for tests of claims: blocks with levels about zero, and estimated noise.

    `covariances` (c, n, n) are those of every hypothesis of the prior. `field` has few places, to
    be refined for a claim, `fine` those at which the noise is estimated.
    """

    blocks: Blocks
    prior: Prior
    level_dbm: FloatArray
    covariances: FloatArray
    field: LikelihoodGrid
    fine: LikelihoodGrid
    noise: Nuisances


@dataclass(frozen=True)
class ClaimTest:
    """The test of one claim of `k` equally likely positions, with which `field` ends.

    `directional` is the same with an antenna pattern, for a measured walk. `calm` and
    `calm_directional` are the sorted statistics of walks drawn from the claim.
    """

    walk: PreparedWalk
    claim: FloatArray
    field: LikelihoodGrid
    directional: LikelihoodGrid
    calm: FloatArray
    calm_directional: FloatArray

    @property
    def distance_m(self) -> float:
        """The claim's distance from the walk, at least the size of a block."""
        middle, blocks = np.mean(self.claim, axis=1), self.walk.blocks
        nearest = float(np.min(blocks.places.distances_m(Places.of(*middle))))
        return max(nearest, 2.0 * blocks.size_m)

    def tails(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """S (b,) for levels (n, b), with an antenna pattern and tempered hypotheses.

        `trusting`: without either.
        """
        if trusting:
            return _tails(self.field, self.claim.shape[1], level_dbm)
        return _tails(self.directional, self.claim.shape[1], level_dbm, tempered=True)

    def p_values(self, level_dbm: FloatArray, *, trusting: bool) -> FloatArray:
        """p-values (b,) of levels (n, b).

        `trusting`: the noise is as stationary as in a simulation.
        """
        found = self.tails(level_dbm, trusting=trusting)
        if trusting:
            return calibrate(self.calm, found)
        return np.maximum(found, calibrate(self.calm_directional, found))

    def residuals(self) -> FloatArray:
        """Residuals (n,) of the walk at the claim, whitened by its likeliest noise."""
        walk = self.walk
        possible = distances_db(walk.blocks, walk.prior.height_m, Places.of(*self.claim))
        design = np.column_stack([np.ones(len(walk.blocks)), -np.mean(possible, axis=1)])
        whiten = inverse_of_lower(walk.noise.root)
        basis, white = np.linalg.qr(whiten @ design)[0], whiten @ walk.level_dbm
        return np.asarray(white - basis @ (basis.T @ white), float)

    def power(
        self,
        positions: Places,
        p_fa: float,
        draws: int,
        rng: np.random.Generator,
        *,
        trusting: bool,
    ) -> FloatArray:
        """Share of simulated walks in which the claim is rejected, shape (m,).

        There are `draws` walks for each position (m,) of the transmitter.
        """
        each = positions.part(np.repeat(np.arange(len(positions)), draws))
        rejected = []
        for k in range(0, len(each), _BATCH):
            level_dbm = self.walk.noise.walks(each.part(slice(k, k + _BATCH)), rng)
            rejected.append(self.p_values(level_dbm, trusting=trusting) <= p_fa)
        return np.asarray(
            np.concatenate(rejected).reshape(len(positions), draws).mean(axis=1), float
        )

    def detectable(
        self, p_fa: float, rng: np.random.Generator, *, trusting: bool
    ) -> list[Detectable]:
        """Detectable displacements for each of eight azimuths.

        They are tried up to 20 times the claim's distance from the walk.
        """
        middle = np.mean(self.claim, axis=1)
        radius = self.distance_m * np.array(_SHARES)
        azimuth = np.radians(BEARINGS_DEG)
        x = middle[0] + np.outer(np.sin(azimuth), radius).ravel()
        y = middle[1] + np.outer(np.cos(azimuth), radius).ravel()
        shares = self.power(Places.of(x, y), p_fa, _POWER_DRAWS, rng, trusting=trusting)
        found = zip(BEARINGS_DEG, shares.reshape(len(azimuth), len(radius)), strict=True)
        return [Detectable(deg, *_crossing(radius, row), float(radius[-1])) for deg, row in found]


def prepare_walk(blocks: Blocks, prior: Prior) -> PreparedWalk:
    """Learn from a walk what does not depend on the claim."""
    level_dbm = blocks.level_dbm - float(np.mean(blocks.level_dbm))
    k, coarse = covariances(blocks, prior), coarse_squares(blocks, prior)
    every = whiteners_of(k)
    # each hypothesis has its own peak: places too coarse for the sharpest would rule that one out
    searched = refine(likelihood_grid(blocks, prior, coarse, every[::6]), level_dbm[:, None], _FINE)
    fine = likelihood_grid(blocks, prior, searched.squares, every).plausible(level_dbm)
    field = refine(
        likelihood_grid(blocks, prior, coarse, fine.whiteners), level_dbm[:, None], _COARSE
    )
    return PreparedWalk(blocks, prior, level_dbm, k, field, fine, nuisances(fine, level_dbm, k))


def claim_test(walk: PreparedWalk, claim: FloatArray, rng: np.random.Generator) -> ClaimTest:
    """Prepare the test of a claim of equally likely positions (2, k).

    The grid is refined for walks simulated from the claim.
    """
    at = Places.of(*claim[:, rng.integers(claim.shape[1], size=DRAWS)])
    drawn_dbm = walk.noise.walks(at, rng)
    fine, k = refine(walk.field, drawn_dbm[:, :_SCOUTS], _MOST_SQUARES), claim.shape[1]
    squares = np.concatenate([fine.squares, np.vstack([claim, np.zeros(k)])], axis=1)
    plain = walk.field.with_squares(squares)
    directional, of_antenna = plain, np.zeros(1)
    if not walk.prior.antenna_db:
        directional = plain.with_prior(
            walk.prior.of_station(Station(1.0, walk.prior.height_m, (ANTENNA_DB,)))
        )
        middle = Places.of(*np.repeat(np.mean(claim, axis=1, keepdims=True), DRAWS, axis=1))
        size = np.full(DRAWS, walk.noise.mean_sigma_db / walk.prior.sigma_db)
        of_antenna = antenna_patterns(directional.blocks, directional.prior, middle, size, rng)
    calm = _tails(plain, k, drawn_dbm), _tails(directional, k, drawn_dbm + of_antenna)
    return ClaimTest(walk, claim, plain, directional, *(np.sort(one) for one in calm))


def _tails(
    field: LikelihoodGrid, k: int, level_dbm: FloatArray, *, tempered: bool = False
) -> FloatArray:
    log_p, _ = field.evaluate(level_dbm)
    density = field.densities(log_p, tempered=tempered)
    mass = density[:-k] * field.squares[2, :-k, None] ** 2
    claim = np.mean(density[-k:], axis=0)
    less = np.sum(np.where(density[:-k] <= claim, mass, 0.0), axis=0)
    # the second term orders claims that are less likely than every square
    return np.asarray(less / np.sum(mass, axis=0) + _BELOW * claim / np.max(density, axis=0), float)


def _crossing(radius: FloatArray, share: FloatArray) -> tuple[float | None, float | None]:
    """Where the share first reaches 95 %, and where it later falls below 90 %.

    Between the radii it is interpolated by their logarithm.
    """
    reached = np.flatnonzero(share >= POWER)
    if not len(reached):
        return None, None
    k = int(reached[0])
    again = np.flatnonzero(share[k:] < _NEARLY)
    blind = float(radius[k + again[0]]) if len(again) else None
    if k == 0:
        return float(radius[0]), blind
    part = (POWER - share[k - 1]) / (share[k] - share[k - 1])
    return float(radius[k - 1] * (radius[k] / radius[k - 1]) ** part), blind


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


def around(place: Places, sigma_m: float) -> FloatArray:
    """Equally likely places (2, k) of a normal claim, or the place alone.

    They lie on the spiral of a sunflower, which leaves no hole (Vogel, Math. Biosci. 44, 1979), the
    closer together the less a walk may know a place by.
    """
    if sigma_m <= 0.0:
        return place.xy_m
    k = int(np.clip((sigma_m / _APART_M) ** 2, _FEWEST_PLACES, _MOST_PLACES))
    radius = sigma_m * np.sqrt(-2.0 * np.log(1.0 - (np.arange(k) + 0.5) / k))
    angle = _GOLDEN_RAD * np.arange(k)
    away = radius * np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(place.xy_m + away - np.mean(away, axis=1, keepdims=True), float)
