"""Losses of the least-squares fit, scipy's by name."""

from typing import Literal

import numpy as np

from logger.core.arrays import FloatArray

Loss = Literal["linear", "soft_l1", "huber", "cauchy"]


def influence(loss: Loss, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Influence psi(u) / u and its slope psi'(u), u in units of the loss's scale.

    The losses are scipy's.
    """
    if loss == "soft_l1":
        return (1.0 + u**2) ** -0.5, (1.0 + u**2) ** -1.5
    if loss == "huber":
        return 1.0 / np.maximum(np.abs(u), 1.0), np.where(np.abs(u) <= 1.0, 1.0, 0.0)
    if loss == "cauchy":
        return 1.0 / (1.0 + u**2), (1.0 - u**2) / (1.0 + u**2) ** 2
    return np.ones_like(u), np.ones_like(u)
