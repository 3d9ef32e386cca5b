"""What walks say about places: the locator's evidence for many walks at once, real or drawn.

The model is the locator's (`logger.core.locator`): z = P0 - eta L(x, y) + v, v ~ N(0, sigma^2 K_c)
for hypothesis c of the noise. What changes is the prior of power and scale, so that thousands of
drawn walks cost a few matrix products: P0 is flat, eta ~ N(eta0, eta_sigma^2) in units of a
reference sigma, sigma^2 inverse gamma. With whitened rows o = W 1, X = -W L, z = W z, weights w of
rows, Lam = (sigma_ref / eta_sigma)^2, m = eta0,

    A = X'wX + Lam - (X'wo)(o'wX) / o'wo      g = X'wz + Lam m - (X'wo)(o'wz) / o'wo
    S = z'wz + m'Lam m - (o'wz)^2 / o'wo - g'A^-1 g log p = -1/2 log|K| + 1/2 sum log w - 1/2 log
    o'wo - 1/2 log|A| - (a0 + (n - 1) / 2) log(b0 + S / 2) + const

An antenna that does not send all round adds a cos b + c sin b, b the bearing from it; a and c ~
N(0, antenna_db^2) are then two more columns of X.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.mixture import log_sum
from logger.core.locator.quadtree import children, first_squares, log_prior
from logger.core.model.blocks import Blocks
from logger.core.model.columns import distances_db, receiver_variance
from logger.core.model.noise import Whitener
from logger.core.model.prior import Prior

Squares = FloatArray
"""Rows x, y, side: shape (3, h).

A place without extent has side 0 and no probability of its own.
"""

_STRIP = 32
_SIGMA_SHAPE = 1.7
"""Of the inverse gamma law of sigma^2: about as wide as the locator's log-normal one (0.45)."""
_LEAST_WEIGHT = 0.003
_MOST_HYPOTHESES = 6


class _Design(NamedTuple):
    """Of one hypothesis: w of rows and places, and what makes sums of z of it; h places, q columns
    of X.

    With R'R = A^-1, R lower triangular: `level` (n, h) gives o'wz / sqrt(o'wo), `rows` (q, n, h)
    and `of_eta` (q, h), the first column of R, give R g, and `log_det` (h,) is log(o'wo |A|).
    """

    w: FloatArray
    level: FloatArray
    rows: FloatArray
    of_eta: FloatArray
    log_det: FloatArray


@dataclass(frozen=True)
class Field:
    """Walks of `blocks` judged at `squares` (3, h) under hypotheses `numbers` (c,).

    The arrays with a first axis c hold what does not depend on levels. With an `antenna_db` of 0
    the antenna sends all round.
    """

    blocks: Blocks
    prior: Prior
    squares: Squares
    found: list[Whitener]
    distance_db: FloatArray
    extra: FloatArray | None
    antenna_db: float = 0.0

    @property
    def numbers(self) -> IntArray:
        """Hypotheses of the noise by their number in the prior."""
        return np.array([w.number for w in self.found])

    @property
    def trust(self) -> FloatArray:
        """Power that the likelihood of each hypothesis is raised to, shape (c,)."""
        return np.array([self.prior.hypotheses[w.number].trust for w in self.found])

    @property
    def _eta_weight(self) -> float:
        return (self.prior.sigma_db / self.prior.eta_sigma) ** 2

    @property
    def log_mass(self) -> FloatArray:
        """Log prior probability of each square, shape (h,), -inf for those without extent; up to a
        constant.
        """
        with np.errstate(divide="ignore"):
            return np.asarray(
                log_prior(self.blocks, self.prior, self.squares) + 2.0 * np.log(self.squares[2]),
                float,
            )

    def with_squares(self, squares: Squares) -> "Field":
        """The same walk and hypotheses at other places."""
        return field_at(self.blocks, self.prior, squares, self.found, self.antenna_db)

    def at_other(self, blocks: Blocks, found: list[Whitener]) -> "Field":
        """The same places, judged by another walk."""
        return field_at(blocks, self.prior, self.squares, found, self.antenna_db)

    def judged(self, level_dbm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Log evidence and mean of sigma^2 by hypothesis and place, for levels (n, b): shape (c, h,
        b) each.
        """
        log_p = np.empty((len(self.found), self.squares.shape[1], level_dbm.shape[1]))
        variance = np.empty_like(log_p)
        for i, whitener in enumerate(self.found):
            self._judge(whitener, level_dbm, log_p[i], variance[i])
        return log_p, variance

    def _judge(
        self, whitener: Whitener, level_dbm: FloatArray, log_p: FloatArray, variance: FloatArray
    ) -> None:
        shape = _SIGMA_SHAPE + 0.5 * (len(self.blocks) - 1)
        scale = _SIGMA_SHAPE * self.prior.sigma_db**2 + 0.5 * self._eta_weight * self.prior.eta**2
        of = self._design(whitener)
        constant = 0.5 * (np.sum(np.log(of.w), axis=0) - whitener.log_det - of.log_det)[:, None]
        shift = of.of_eta[..., None] * self._eta_weight * self.prior.eta
        z = whitener.matrix @ level_dbm
        squares = z * z
        for k in range(0, level_dbm.shape[1], _STRIP):  # few at a time: these stay in the cache
            some = slice(k, k + _STRIP)
            left = of.w.T @ squares[:, some] - (of.level.T @ z[:, some]) ** 2
            for rows, more in zip(of.rows, shift, strict=True):
                left = left - (rows.T @ z[:, some] + more) ** 2
            total = np.maximum(scale + 0.5 * left, _SIGMA_SHAPE * self.prior.sigma_db**2)
            np.subtract(constant, shape * np.log(total), out=log_p[:, some])
            np.divide(total, shape - 1.0, out=variance[:, some])

    def exponents(self, level_dbm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean of eta, and its variance by that of the noise, for one walk (n,): shape (c, h)
        each.
        """
        mean, inverse = [], []
        for whitener in self.found:
            of, z = self._design(whitener), whitener.matrix @ level_dbm
            inverse.append(np.sum(of.of_eta**2, axis=0))
            found = np.sum(of.of_eta * (np.swapaxes(of.rows, 1, 2) @ z), axis=0)
            mean.append(found + inverse[-1] * self._eta_weight * self.prior.eta)
        return np.stack(mean), np.stack(inverse)

    def _design(self, whitener: Whitener) -> "_Design":
        columns, believed = [-self.distance_db], [self._eta_weight]
        if self.antenna_db:
            columns += bearings(self.blocks, self.squares, self.distance_db)
            believed += [(self.prior.sigma_db / self.antenna_db) ** 2] * 2
        o, x = np.sum(whitener.matrix, axis=1)[:, None], whitener.matrix @ np.stack(columns)
        w = self._weights(whitener)
        wo, wx = w * o, w * x
        oo, ox = np.sum(wo * o, axis=0), np.sum(wx * o, axis=1)
        a = (
            np.einsum("inh,jnh->hij", wx, x)
            - np.einsum("ih,jh->hij", ox, ox / oo)
            + np.diag(believed)
        )
        root = np.linalg.inv(np.linalg.cholesky(a))
        rows = np.einsum("hij,jnh->inh", root, wx - (ox / oo)[:, None] * wo)
        size = np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
        return _Design(w, wo * oo**-0.5, rows, root[:, :, 0].T, np.log(oo) - 2.0 * size)

    def _weights(self, whitener: Whitener) -> FloatArray:
        """Of rows, for the error of the receiver's position at each place: (n, h), or (n, 1) where
        there is none.
        """
        if self.extra is None:
            return np.ones((len(self.blocks), 1))
        own = np.diagonal(whitener.matrix) ** 2
        return np.asarray(1.0 / (1.0 + own[:, None] * self.extra), float)

    def weights(self, log_p: FloatArray) -> FloatArray:
        """Probability of each hypothesis, wherever the transmitter stands, shape (c, b)."""
        total = self.overall(log_p) + self.prior.log_odds[self.numbers][:, None]
        return np.asarray(np.exp(total - log_sum(total.T)), float)

    def overall(self, log_p: FloatArray) -> FloatArray:
        """Log evidence of each hypothesis over all places, shape (c, b)."""
        log_mass = self.log_mass - log_sum(self.log_mass)
        return log_sum(np.swapaxes(log_p + log_mass[:, None], 1, 2))

    def densities(self, log_p: FloatArray, trust: FloatArray) -> FloatArray:
        """Probability per square metre at each place, each likelihood raised to the power `trust`
        (c,): (h, b).
        """
        tempered = trust[:, None, None] * log_p
        log_mass = (self.log_mass - log_sum(self.log_mass))[:, None]
        norm = log_sum(np.swapaxes(tempered + log_mass, 1, 2))
        log_density = log_prior(self.blocks, self.prior, self.squares) - log_sum(self.log_mass)
        share = np.exp(tempered - norm[:, None]) * self.weights(log_p)[:, None]
        return np.asarray(np.sum(share, axis=0) * np.exp(log_density)[:, None], float)

    def plausible(self, level_dbm: FloatArray) -> "Field":
        """With the hypotheses only that one walk (n,) has not ruled out, at most six."""
        p = self.weights(self.judged(level_dbm[:, None])[0])[:, 0]
        keep = [i for i in np.argsort(-p)[:_MOST_HYPOTHESES].tolist() if p[i] > _LEAST_WEIGHT]
        found = [self.found[i] for i in sorted(keep)]
        return field_at(self.blocks, self.prior, self.squares, found, self.antenna_db)


def field_at(
    blocks: Blocks, prior: Prior, squares: Squares, found: list[Whitener], antenna_db: float = 0.0
) -> Field:
    """Field of a walk at places."""
    distance_db = distances_db(blocks, prior.height_m, squares[0], squares[1])
    extra = receiver_variance(blocks, prior, distance_db)
    return Field(blocks, prior, squares, found, distance_db, extra, antenna_db)


def bearings(blocks: Blocks, places: FloatArray, distance_db: FloatArray) -> list[FloatArray]:
    """Cosine and sine (n, h) of the bearing under which places (2 or 3, h), `distance_db` away, see
    the blocks.
    """
    away_m = 10.0 ** (0.1 * distance_db)
    return [
        (own_m[:, None] - m) / away_m
        for own_m, m in ((blocks.x_m, places[0]), (blocks.y_m, places[1]))
    ]


def refined(field: Field, level_dbm: FloatArray, most: int, share: float = 0.01) -> Field:
    """Split squares until by no hypothesis one holds over `share` of any of the walks (n, b), or
    there are `most`.
    """
    while field.squares.shape[1] < most:
        log_p, _ = field.judged(level_dbm)
        # flattened, so that a peak inside a large square is not missed
        log_mass = 0.5 * log_p + field.log_mass[:, None]
        p = np.max(np.exp(log_mass - log_sum(np.swapaxes(log_mass, 1, 2))[:, None]), axis=(0, 2))
        wanted = p > share
        order = np.argsort(-np.where(wanted, p, 0.0))[: max((most - len(p)) // 3, 0)]
        split = np.zeros(len(p), np.bool_)
        split[order] = wanted[order] & (field.squares[2, order] > 1.0)
        if not np.any(split):
            break
        field = field.with_squares(
            np.concatenate([field.squares[:, ~split], children(field.squares[:, split])], axis=1)
        )
    return field


def coarse_squares(blocks: Blocks, prior: Prior) -> Squares:
    """Where a search begins."""
    return first_squares(blocks, prior, 1.2)
