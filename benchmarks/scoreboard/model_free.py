"""Methods that need no model of the level."""

import numpy as np

from .answer import Answer
from .world import Walk


def weighted_centroid(walk: Walk) -> Answer:
    """Mean of the receiver's places weighted by power in milliwatts."""
    weight = 10.0 ** (0.1 * (walk.level_dbm - np.max(walk.level_dbm)))
    return Answer(
        float(np.average(walk.x_m, weights=weight)), float(np.average(walk.y_m, weights=weight))
    )


def strongest_sample(walk: Walk) -> Answer:
    """Where the strongest level was measured; the middle of such places where there are several."""
    top = walk.level_dbm == np.max(walk.level_dbm)
    return Answer(float(np.mean(walk.x_m[top])), float(np.mean(walk.y_m[top])))
