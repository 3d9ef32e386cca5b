"""Colours of every picture: one for each estimator and verdict, and a scale for levels.

All of them are legible on black and on white. A colour is red, green, blue from 0 to 255.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from logger.core.arrays import FloatArray

Bytes = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

EKF: Final = (235, 130, 20)
RTS: Final = (0, 160, 150)
BATCH: Final = (150, 84, 40)
POSTERIOR: Final = (60, 110, 230)
REFERENCE: Final = (130, 130, 130)
TRUTH: Final = (150, 90, 230)
WALKER: Final = (40, 130, 240)
QUIET: Final = (125, 125, 135)
ESTIMATORS: Final = {
    "batch": BATCH,
    "ekf": EKF,
    "backward": EKF,
    "rts": RTS,
    "reference": REFERENCE,
}
"""By the key of `postproc.result.Estimator`."""

INK: Final = (31, 36, 43)
"""Text, axes and lines on white paper, with the next three; a dark page replaces all four."""
MUTED: Final = (92, 100, 112)
GRID: Final = (221, 225, 230)
PAPER: Final = (255, 255, 255)

BOUNDS: Final = ((90, 150, 90), (175, 145, 40))
"""Chi-square bounds, the inner one first."""

OTHERS: Final = (
    (150, 150, 60),
    (90, 150, 90),
    (170, 110, 110),
    (130, 115, 165),
    (150, 120, 95),
    (180, 120, 160),
    (90, 145, 160),
)
"""Cells other than the one shown in detail, in turn."""

GREEN: Final = (50, 140, 80)
RED: Final = (190, 50, 60)

_VERDICTS: dict[str, Colour] = {
    "located": GREEN,
    "consistent": GREEN,
    "ambiguous": (190, 140, 30),
    "rejected": (225, 85, 165),
}

AMBER: Final = (176, 118, 14)

_WORDS: dict[str, Colour] = {"suspicious": RED, "unusual": AMBER}

_SCALE = np.array(
    [
        (88, 78, 168),
        (70, 105, 180),
        (52, 132, 184),
        (40, 158, 172),
        (60, 182, 146),
        (120, 200, 105),
        (178, 208, 66),
        (238, 202, 44),
    ],
    float,
)  # viridis (S. van der Walt, N. Smith, 2015) without its dark end: nothing of it is a warning


def verdict_colour(verdict: str) -> Colour:
    """Green for yes, pink for no, amber for several positions, grey for undecided."""
    return _VERDICTS.get(verdict, QUIET)


def word_colour(word: str) -> Colour:
    """Red for suspicious, amber for unusual, grey for any other word and for none."""
    return _WORDS.get(word, QUIET)


def level_colours(level_dbm: FloatArray, weakest_dbm: float, strongest_dbm: float) -> Bytes:
    """Colours (n, 3) of levels (n,): violet is weak, yellow is strong, grey is NaN."""
    span_db = max(strongest_dbm - weakest_dbm, 1e-9)  # two equal limits make no division by zero
    position = np.clip((level_dbm - weakest_dbm) / span_db, 0.0, 1.0) * (len(_SCALE) - 1)
    finite = np.isfinite(position)
    steps = np.arange(len(_SCALE))
    rgb = [np.interp(np.where(finite, position, 0.0), steps, channel) for channel in _SCALE.T]
    return np.where(finite[:, None], np.round(np.column_stack(rgb)), QUIET).astype(np.uint8)


def level_scale(count: int) -> Bytes:
    """The scale of levels from weak to strong in `count` steps, shape (count, 3)."""
    return level_colours(np.linspace(0.0, 1.0, count), 0.0, 1.0)
