"""How much higher each modem reads than the first, where one cell was heard by several.

Modem m > 0 reads z = P0 + b_m - eta L + v. The b are differences of offsets that are independent
from modem to modem, so b ~ N(0, o^2 (I + 1 1')); integrated out, they add o^2 (1 + [same modem]) to
the covariance of modems other than the first (a random effect: Laird & Ware, Biometrics 38(4),
1982; `evidence.offset_covariance`). Here they are unknowns beside P0 and eta, so that they can be
told.

The evidence is in units of sigma^2, and a prior of offsets in dB is not: a first look at the walk
in few blocks, with offsets as free as can be, says what sigma is, and o is given in units of that.
Readings at the end of a scale are moved to the first modem's scale by what the first look says of
the offsets, and left out where it says less than a level would.
"""

from dataclasses import dataclass, replace

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.evidence import distances_db, receiver_variance
from logger.core.locator.mixture import Mixture
from logger.core.locator.quadtree import Effort, Tree
from logger.core.locator.search import search_once
from logger.core.model.blocks import NOTHING_CENSORED, Blocks, Censored, censored_places
from logger.core.model.noise import covariances
from logger.core.model.prior import Prior
from logger.core.observations import CellObservations

_MOST_PLACES = 150
_LEAST_SHARE = 1e-3
_FREE_DB = 60.0
_LOOK = Effort(most_squares=1500, split_share=0.01)


@dataclass(frozen=True, slots=True)
class Offsets:
    """What each modem reads higher than the first: mean in dB, shape (m,), and covariance, shape
    (m, m).
    """

    mean_db: FloatArray
    covariance_db2: FloatArray

    @property
    def sigma_db(self) -> FloatArray:
        """Standard deviations, 0 for the first, shape (m,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance_db2)), float)


def first_look(obs: CellObservations, coarse: Blocks, prior: Prior) -> tuple[Prior, Censored]:
    """Prior with the offsets in units of the sigma that the walk seems to have, and the censored
    places moved.
    """
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
    """Offsets over the likeliest of the places `among`: between places and hypotheses, and given
    both.
    """
    p = mixed.probability[among]
    places = among[np.argsort(-p, kind="stable")[:_MOST_PLACES]]
    share = mixed.share[:, places] / np.sum(mixed.share[:, places])
    rows = np.flatnonzero(np.sum(share, axis=1) > _LEAST_SHARE)
    at = tree.x_m[places], tree.y_m[places]
    given = [
        _given(blocks, prior, int(tree.numbers[c]), at, tree.evidence.sigma_db[c, places], modems)
        for c in rows
    ]
    weight = share[rows] / np.sum(share[rows])
    mean, spread = np.stack([m for m, _ in given]), np.stack([v for _, v in given])
    average = np.einsum("ch,chi->i", weight, mean)
    off = mean - average
    total = np.einsum("ch,chij->ij", weight, spread + off[..., :, None] * off[..., None, :])
    return Offsets(np.append(0.0, average), np.pad(total, ((1, 0), (1, 0))))


def _given(
    blocks: Blocks,
    prior: Prior,
    number: int,
    at: tuple[FloatArray, FloatArray],
    sigma_db: FloatArray,
    modems: int,
) -> tuple[FloatArray, FloatArray]:
    """Mean (h, m - 1) and covariance (h, m - 1, m - 1) of b given hypothesis, place and sigma.

    Levels count with the hypothesis' trust, as they do for the place.
    """
    hypothesis = prior.hypotheses[number]
    of_one_modem = replace(blocks, modem=np.zeros_like(blocks.modem))
    root = np.linalg.cholesky(covariances(of_one_modem, prior, [number])[0])
    distance_db = distances_db(blocks, prior.height_m, *at)
    is_of = (blocks.modem[:, None] == np.arange(1, modems)).astype(float)
    white = np.linalg.solve(
        root, np.column_stack([blocks.level_dbm, np.ones(len(blocks)), is_of, -distance_db])
    )
    level, fixed, slope = white[:, 0], white[:, 1 : modems + 1], white[:, modems + 1 :]
    extra = receiver_variance(blocks, prior, distance_db)
    weight = np.full(slope.shape, hypothesis.trust * sigma_db**-2.0)
    if extra is not None:
        weight /= 1.0 + extra / np.diag(root)[:, None] ** 2
    design = np.concatenate(
        [np.broadcast_to(fixed.T[..., None], (modems, *slope.shape)), slope[None]]
    )
    precision, mean = _prior(prior, sigma_db, modems)
    a = np.einsum("inh,nh,jnh->hij", design, weight, design, optimize=True) + precision
    b = np.einsum("inh,nh,n->hi", design, weight, level, optimize=True) + np.einsum(
        "hij,j->hi", precision, mean
    )
    inverse = np.linalg.inv(a)
    return np.einsum("hij,hj->hi", inverse, b)[:, 1:modems], inverse[:, 1:modems, 1:modems]


def _prior(prior: Prior, sigma_db: FloatArray, modems: int) -> tuple[FloatArray, FloatArray]:
    """Precision (h, m + 1, m + 1) and mean (m + 1,) of P0, the offsets of the other modems, and
    eta.
    """
    precision = np.zeros((len(sigma_db), modems + 1, modems + 1))
    precision[:, 0, 0], precision[:, -1, -1] = prior.p0_sigma_db**-2, prior.eta_sigma**-2
    relative = np.linalg.inv(np.eye(modems - 1) + 1.0)
    offset_db = prior.offset_sigma_db / prior.sigma_db * sigma_db
    precision[:, 1:-1, 1:-1] = relative / offset_db[:, None, None] ** 2
    return precision, np.array([prior.p0_dbm, *np.zeros(modems - 1), prior.eta])
