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
BATCH: Final = (214, 40, 57)
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

_SCALE = np.array(
    [
        (66, 75, 181),
        (66, 148, 255),
        (26, 212, 208),
        (74, 248, 128),
        (169, 251, 57),
        (235, 211, 57),
        (254, 147, 42),
        (228, 69, 10),
        (169, 22, 1),
    ],
    float,
)  # turbo (A. Mikhailov, 2019) without its dark ends


def verdict_colour(verdict: str) -> Colour:
    """Green for yes, pink for no, amber for several positions, grey for undecided."""
    return _VERDICTS.get(verdict, QUIET)


def level_colours(level_dbm: FloatArray, weakest_dbm: float, strongest_dbm: float) -> Bytes:
    """Colours (n, 3) of levels (n,): blue is weak, red is strong, grey is NaN."""
    span_db = max(strongest_dbm - weakest_dbm, 1e-9)  # two equal limits make no division by zero
    position = np.clip((level_dbm - weakest_dbm) / span_db, 0.0, 1.0) * (len(_SCALE) - 1)
    finite = np.isfinite(position)
    steps = np.arange(len(_SCALE))
    rgb = [np.interp(np.where(finite, position, 0.0), steps, channel) for channel in _SCALE.T]
    return np.where(finite[:, None], np.round(np.column_stack(rgb)), QUIET).astype(np.uint8)


def level_scale(count: int) -> Bytes:
    """The scale of levels from weak to strong in `count` steps, shape (count, 3)."""
    return level_colours(np.linspace(0.0, 1.0, count), 0.0, 1.0)
