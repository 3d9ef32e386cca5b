"""A cell with very many readings, thinned by what the model of the levels says loses nothing.

The locator takes the mean of all readings of one modem in a square of ground, of at most 1000
squares, for one reading: what it knows of a square is the mean level and the mean position. 256
readings of a square, evenly spread over those it has, change its mean by a sixteenth of the
standard deviation within the square, some 0.3 dB where shadowing has 5 dB. Up to `MOST_READINGS`
nothing is left out.
"""

import numpy as np

from logger.core.arrays import BoolArray
from logger.core.model.blocks import squares
from logger.core.readings import Readings

MOST_READINGS = 200_000
OF_A_SQUARE = 256
_MOST_SQUARES = 1000
"""As many as the locator pools readings into."""


def thin(obs: Readings) -> Readings:
    """The readings that matter, in their order; they are usable ones."""
    return obs if len(obs) <= MOST_READINGS else obs.part(_choice(obs))


def _choice(obs: Readings) -> BoolArray:
    """Which readings (n,) to keep: of each square, modem and censoring evenly spread ones."""
    modem = np.zeros(len(obs), np.int64) if obs.modem is None else obs.modem
    square, _ = squares(obs.places, _MOST_SQUARES, modem)
    key = square * 3 + obs.limit + 1
    order = np.argsort(key, kind="stable")
    first = np.searchsorted(key[order], key[order])
    count = np.bincount(key)[key[order]]
    rank = np.arange(len(key)) - first
    share = np.minimum(OF_A_SQUARE / count, 1.0)
    chosen = np.zeros(len(key), np.bool_)
    chosen[order] = np.floor((rank + 1) * share) > np.floor(rank * share)
    return chosen
