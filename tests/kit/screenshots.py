"""Items of a walk that are visible on a screenshot of the viewer."""

from io import BytesIO

import numpy as np
from PIL import Image

from postproc.pictures import colours

LEAST_PIXELS = 15
SHOWN = {
    "walker": colours.WALKER,
    "posterior": colours.POSTERIOR,
    "EKF": colours.EKF,
    "least squares": colours.BATCH,
    "truth": colours.TRUTH,
    "a weak level": tuple(colours.level_scale(9)[1].tolist()),
    "a strong level": tuple(colours.level_scale(9)[7].tolist()),
}
"""Colours of a walk's plan."""


def count_pixels(png: bytes, colour, *, within=(0.0, 1.0), off=30) -> int:
    """Number of pixels of about a colour, between two fractions of the width."""
    pixels = np.asarray(Image.open(BytesIO(png)).convert("RGB")).astype(int)
    left, right = (int(share * pixels.shape[1]) for share in within)
    return int(np.count_nonzero(np.max(np.abs(pixels[:, left:right] - colour), axis=2) <= off))


def missing_items(png: bytes, *, within=(0.0, 1.0)) -> list[str]:
    """Items of a walk that are not visible."""
    return [
        name
        for name, colour in SHOWN.items()
        if count_pixels(png, colour, within=within) < LEAST_PIXELS
    ]
