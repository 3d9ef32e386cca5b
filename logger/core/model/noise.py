"""Covariance of the mean levels of blocks under each hypothesis of the noise, and its whitener.

Shadowing is averaged over the points of a block: with blocks taken for points it would seem
correlated over longer distances than it is.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.model.blocks import READINGS_BELIEVED, Blocks
from logger.core.model.prior import Hypothesis, Prior

_ROUNDING_DB2 = 1.0 / 12.0  # of levels in whole dB
_SMALL = 25  # rows: up to that the general inverse is faster


class Whitener(NamedTuple):
    """Hypothesis `number`, the matrix W with W K W' = I, shape (n, n), and log |K|."""

    number: int
    matrix: FloatArray
    log_det: float


def covariances(blocks: Blocks, prior: Prior, numbers: Sequence[int] | None = None) -> FloatArray:
    """K of the blocks' mean levels in units of sigma^2, shape (c, n, n).

    One for every hypothesis, or for those of some `numbers`.
    """
    chosen = [
        prior.hypotheses[i] for i in (range(len(prior.hypotheses)) if numbers is None else numbers)
    ]
    apart_m = blocks.points.distances_m(blocks.points)
    scales_m = {scale_m for h in chosen for _, scale_m in shares(h)}
    shadowed = {d_c: blocks.mean(blocks.mean(correlation(apart_m, d_c)).T) for d_c in scales_m}
    k = np.zeros((len(chosen), len(blocks), len(blocks)))
    for i, h in enumerate(chosen):
        for share, scale_m in shares(h):
            k[i] += share * shadowed[scale_m]
    diagonal = np.arange(len(blocks))
    k[:, diagonal, diagonal] += [
        independent_variance(blocks.readings, h.white_share, prior.sigma_db) for h in chosen
    ]
    of_modems = offset_covariance(blocks.modem, prior)
    return k if of_modems is None else k + of_modems


def correlation(apart_m: FloatArray, decorrelation_m: float) -> FloatArray:
    """Correlation of the shadowing at points this far apart.

    Gudmundson, Electronics Letters 27(23), 1991.
    """
    return np.asarray(np.exp(-apart_m / max(decorrelation_m, 1.0)), float)


def shares(hypothesis: Hypothesis) -> list[tuple[float, float]]:
    """Shares of sigma^2 that are correlated, each with its decorrelation distance in m.

    An average with a memory of a metres turns exp(-D / d) into (d exp(-D / d) - a exp(-D / a)) /
    (d - a), a covariance in the plane too: the share of a is negative.
    """
    white, short_m, long, long_m, averaged_m = hypothesis
    both = ((1.0 - white) * (1.0 - long), short_m), ((1.0 - white) * long, long_m)
    found = [(share, scale_m) for share, scale_m in both if share > 0.0]
    if averaged_m <= 0.0:
        return found
    seen = [(share / (scale_m - averaged_m), scale_m) for share, scale_m in found]
    return [
        part
        for share, scale_m in seen
        for part in ((share * scale_m, scale_m), (-share * averaged_m, averaged_m))
    ]


def shadowing(apart_m: FloatArray, hypothesis: Hypothesis) -> FloatArray:
    """Covariance, in units of sigma^2, of the shadowing at points this far apart."""
    parts = (share * correlation(apart_m, scale_m) for share, scale_m in shares(hypothesis))
    return np.asarray(sum(parts, np.zeros_like(apart_m)), float)


def independent_variance(
    readings: FloatArray | float, white_share: FloatArray | float, sigma_db: float
) -> FloatArray:
    """Block-specific part of K's diagonal: fading, and rounding to 1 dB.

    Fading changes little while one stands still: more than 16 readings count as 16.
    """
    return np.asarray(
        white_share / np.minimum(readings, READINGS_BELIEVED) + _ROUNDING_DB2 / sigma_db**2, float
    )


def offset_covariance(modem: IntArray, prior: Prior) -> FloatArray | None:
    """What the offsets of modems (n,) add to K; None for one modem, whose offset is part of P0.

    Levels are on the scale of modem 0; another differs from it by the difference of two offsets.
    """
    if not np.any(modem):
        return None
    same, other = modem[:, None] == modem, modem > 0
    return np.asarray(
        (prior.offset_sigma_db / prior.sigma_db) ** 2 * (other[:, None] & other) * (1.0 + same),
        float,
    )


def whiteners(blocks: Blocks, prior: Prior, numbers: Sequence[int] | None = None) -> list[Whitener]:
    """One for each hypothesis, or for those of some `numbers`."""
    return whiteners_of(covariances(blocks, prior, numbers), numbers)


def whiteners_of(k: FloatArray, numbers: Sequence[int] | None = None) -> list[Whitener]:
    """One for each covariance (c, n, n) in units of sigma^2.

    Their hypotheses are those of these `numbers`, or all.
    """
    chosen = range(len(k)) if numbers is None else numbers
    root = np.asarray(np.linalg.cholesky(k), float)
    log_det = 2.0 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
    return [
        Whitener(*each)
        for each in zip(chosen, inverse_of_lower(root), log_det.tolist(), strict=True)
    ]


def matrices_of(whiteners: Sequence[Whitener]) -> FloatArray:
    """Matrices of some whiteners of the same blocks, shape (c, n, n)."""
    return np.stack([one.matrix for one in whiteners])


def inverse_of_lower(root: FloatArray) -> FloatArray:
    """Inverse of lower triangular matrices (..., n, n), by halves: four times as fast."""
    n = root.shape[-1]
    if n <= _SMALL:
        return np.asarray(np.tril(np.linalg.inv(root)), float)
    half, found = n // 2, np.zeros_like(root)
    first, last = (
        inverse_of_lower(root[..., :half, :half]),
        inverse_of_lower(root[..., half:, half:]),
    )
    found[..., :half, :half], found[..., half:, half:] = first, last
    found[..., half:, :half] = -(last @ root[..., half:, :half]) @ first
    return found
