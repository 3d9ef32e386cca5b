"""Places that stand for a posterior: where its probability is gathered."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.places import Places

MOST = 4
"""Places that routes lead to: more are hardly ever plausible at the same time."""
_REACH_M = 1500.0
"""Farther than this from the walker nobody walks for one route."""
_BLUR_M, _BLUR_SHARE = 60.0, 0.25
"""Probability within this distance, or this share of the way there, belongs to one place."""
_LEAST = 0.03
"""Less probability than this is no place to walk to."""
_CENTRES = 60
"""Squares tried as the centre of a place, the likeliest first: 150 gave the same places."""
_NEGLIGIBLE = 1e-5
"""Squares with less probability change no place."""


class Cluster(NamedTuple):
    """Probability of a place, and its centre."""

    probability: float
    place: Places


def clusters(square: FloatArray, probability: FloatArray, here: Places) -> list[Cluster]:
    """Up to `MOST` places within reach of the walker, the likeliest first.

    `square` (3, h) has rows x, y, side. Each place is the one that has most probability around it
    of what is left.
    """
    x_m, y_m, _ = square[:, probability > _NEGLIGIBLE]
    left = probability[probability > _NEGLIGIBLE]
    away_m = np.hypot(x_m - here.x_m, y_m - here.y_m)
    left = np.where(away_m <= _REACH_M, left, 0.0)
    places: list[Cluster] = []
    while len(places) < MOST and np.sum(left) >= _LEAST:
        top = np.argsort(-left, kind="stable")[:_CENTRES]
        apart_m = np.hypot(x_m[top, None] - x_m, y_m[top, None] - y_m)
        around = apart_m < np.maximum(_BLUR_M, _BLUR_SHARE * away_m[top])[:, None]
        mass = around @ left
        best = int(np.argmax(mass))
        if mass[best] < _LEAST:
            break
        share = np.where(around[best], left, 0.0) / mass[best]
        centre = Places.of(share @ x_m, share @ y_m, utm=here.utm)
        places.append(Cluster(float(mass[best]), centre))
        left = np.where(around[best], 0.0, left)
    return places
