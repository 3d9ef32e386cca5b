"""How much higher each modem reads than the first, where several have received one cell.

Modem m > 0 reads z = P0 + b_m - eta L + v. The b are differences of offsets that are independent
from modem to modem, so b ~ N(0, o^2 (I + 1 1')); integrated out, they add o^2 (1 + [same modem]) to
the covariance of modems other than the first (a random effect: Laird & Ware, Biometrics 38(4),
1982; `noise.offset_covariance`). Here they are unknowns beside P0 and eta, so that they can be
reported.

The evidence is in units of sigma^2, and a prior of offsets in dB is not: a first look at the walk
in few blocks, with offsets as free as can be, gives sigma, and o is expressed in units of that.
Readings at the end of a scale are moved to the first modem's scale by the offsets of the first
look, and left out where these are less certain than a level.
"""

from dataclasses import dataclass, replace

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.mixture import Mixture
from logger.core.locator.quadtree import Effort, Tree
from logger.core.locator.search import search_once
from logger.core.model.blocks import NOTHING_CENSORED, Blocks, Censored, censored_places
from logger.core.model.columns import receiver_variance, varying_columns
from logger.core.model.marginal import fit, prior_sums, sums
from logger.core.model.noise import whiteners
from logger.core.model.prior import Prior
from logger.core.places import Places
from logger.core.readings import Readings

_MOST_PLACES = 150  # that hold nearly all of a mode
_LEAST_SHARE = 1e-3  # of the probability: hypotheses below add nothing
_FREE_DB = 60.0  # ten times the prior: as good as unknown
_LOOK = Effort(most_squares=1500, split_share=0.01)


@dataclass(frozen=True, slots=True)
class Offsets:
    """What each modem reads above the first: mean (m,) in dB, and covariance (m, m)."""

    mean_db: FloatArray
    covariance_db2: FloatArray

    @property
    def sigma_db(self) -> FloatArray:
        """Standard deviations, 0 for the first, shape (m,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance_db2)), float)


def first_look(obs: Readings, coarse: Blocks, prior: Prior) -> tuple[Prior, Censored]:
    """Prior of the offsets in units of the walk's sigma, and censored points on one scale."""
    plain = replace(coarse, censored=NOTHING_CENSORED)
    tree = search_once(plain, replace(prior, offset_sigma_db=_FREE_DB), _LOOK)
    mixed = tree.mixture(prior)
    sigma_db = float(np.sum(mixed.share * tree.evidence.sigma_db))
    scaled = replace(prior, offset_sigma_db=prior.offset_sigma_db * prior.sigma_db / sigma_db)
    found = offsets(plain, scaled, tree, mixed, np.arange(len(tree.x_m)), obs.n_modems)
    moved = obs.on_one_scale(found.mean_db)
    vague = (found.sigma_db > sigma_db)[obs.modem]
    return scaled, censored_places(replace(moved, known_limit=np.where(vague, 0, moved.limit)))


def offsets(
    blocks: Blocks, prior: Prior, tree: Tree, mixed: Mixture, among: IntArray, modems: int
) -> Offsets:
    """Offsets over the likeliest of the positions `among`, by the law of total covariance.

    A modem without a block keeps the prior.
    """
    present = np.union1d(blocks.modem, 0)
    numbered = replace(blocks, modem=np.searchsorted(present, blocks.modem))
    known = _offsets_of_all(numbered, prior, tree, mixed, among, len(present))
    mean = np.zeros(modems)
    mean[present] = known.mean_db
    sigma_db = float(np.sum(mixed.share * tree.evidence.sigma_db))
    unknown_db2 = 2.0 * (prior.offset_sigma_db / prior.sigma_db * sigma_db) ** 2
    covariance = np.diag(np.where(np.isin(np.arange(modems), present), 0.0, unknown_db2))
    covariance[np.ix_(present, present)] = known.covariance_db2
    return Offsets(mean, covariance)


def _offsets_of_all(
    blocks: Blocks, prior: Prior, tree: Tree, mixed: Mixture, among: IntArray, modems: int
) -> Offsets:
    """As `offsets`, if each of the modems has a block."""
    p = mixed.probability[among]
    indices = among[np.argsort(-p, kind="stable")[:_MOST_PLACES]]
    share = mixed.share[:, indices] / np.sum(mixed.share[:, indices])
    rows = np.flatnonzero(np.sum(share, axis=1) > _LEAST_SHARE)
    at = Places.of(tree.x_m[indices], tree.y_m[indices], utm=blocks.places.utm)
    given = [
        _conditional_offsets(
            blocks, prior, int(tree.numbers[c]), at, tree.evidence.sigma_db[c, indices], modems
        )
        for c in rows
    ]
    weight = share[rows] / np.sum(share[rows])
    mean, spread = np.stack([m for m, _ in given]), np.stack([v for _, v in given])
    average = np.einsum("ch,chi->i", weight, mean)
    off = mean - average
    total = np.einsum("ch,chij->ij", weight, spread + off[..., :, None] * off[..., None, :])
    return Offsets(np.append(0.0, average), np.pad(total, ((1, 0), (1, 0))))


def _conditional_offsets(
    blocks: Blocks,
    prior: Prior,
    number: int,
    positions: Places,
    sigma_db: FloatArray,
    modems: int,
) -> tuple[FloatArray, FloatArray]:
    """Mean (h, m - 1) and covariance (h, m - 1, m - 1) of b, given hypothesis, position and sigma.

    Levels count with the trust of the hypothesis, as they do for the position.
    """
    one_scale = replace(blocks, modem=np.zeros_like(blocks.modem))
    (noise,) = whiteners(one_scale, prior, [number])
    varying = varying_columns(blocks, prior, positions)
    extra = receiver_variance(blocks, prior, -varying[0])
    of_modem = (np.arange(1, modems)[:, None] == blocks.modem).astype(float)
    fixed = np.vstack([blocks.level_dbm, np.ones(len(blocks)), of_modem])
    total = sums(noise.matrix, fixed, varying, extra)
    trust = float(prior.noise_table.trust[number])
    given = fit(total, _prior(prior, sigma_db, modems), np.log(sigma_db) - 0.5 * np.log(trust))
    covariance = given.covariance(modems)[1:, 1:]
    return given.theta[1:modems].T, np.moveaxis(covariance, -1, 0)


def _prior(prior: Prior, sigma_db: FloatArray, modems: int) -> FloatArray:
    """Packed prior (m, h) of P0, the offsets of the other modems, eta and the harmonics."""
    mean, diagonal = (np.insert(v, 1, np.zeros(modems - 1)) for v in prior.coefficients)
    precision = np.repeat(np.diag(diagonal)[..., None], len(sigma_db), axis=2)
    relative = np.linalg.inv(np.eye(modems - 1) + 1.0)
    offset_db = prior.offset_sigma_db / prior.sigma_db * sigma_db
    precision[1:modems, 1:modems] = relative[..., None] / offset_db**2
    return prior_sums(mean, precision)
