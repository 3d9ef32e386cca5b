"""Covariance of the levels of blocks, with shadowing averaged over the points of each.

What changes within a block is averaged away in part, and what remains is smoother than at points that lie as far apart
as blocks do. The locator, in a hurry, takes a block for a point and finds shadowing that lasts longer than it does. Its
places hardly suffer; the false alarms of a test do, since walks drawn with such a covariance are too rough.
"""

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.blocks import Blocks
from logger.core.locator.evidence import offset_covariance, own_variance
from logger.core.locator.prior import Prior


def covariances(blocks: Blocks, prior: Prior) -> FloatArray:
    """K of every hypothesis of the prior in units of sigma^2, shape (c, n, n)."""
    n, x_m, y_m = len(blocks), blocks.point_x_m, blocks.point_y_m
    averaging = np.zeros((n, len(x_m)))
    averaging[np.searchsorted(blocks.first, np.arange(len(x_m)), side="right") - 1, np.arange(len(x_m))] = blocks.weight
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    shadowing = {d_c: averaging @ np.exp(-apart_m / d_c) @ averaging.T for d_c in prior.decorrelation_m}
    k = np.zeros((len(prior.hypotheses), n, n))
    for i, (white_share, decorrelation_m, _) in enumerate(prior.hypotheses):
        if decorrelation_m:
            k[i] = (1.0 - white_share) * shadowing[decorrelation_m]
        k[i][np.diag_indices(n)] += own_variance(blocks.readings, white_share, prior.sigma_db)
    of_modems = offset_covariance(blocks.modem, prior)
    return k if of_modems is None else k + of_modems
