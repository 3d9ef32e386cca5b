"""The posterior as a glow on the plan: a small picture of its density for each step."""

from io import BytesIO
from itertools import product

import numpy as np
import numpy.typing as npt
import rerun as rr
from PIL import Image

from logger.core.arrays import FloatArray, IntArray
from logger.core.locator.region import Squares
from postproc.pictures import colours
from postproc.pictures.picture import Box
from postproc.view.rerun_writer import Sheet, entity
from postproc.view.view_model import Story, Subject

MOST_PIXELS = 192
"""Along the longer side of the plan: twenty steps of it are a third of a megabyte."""
_UNDER_LINES = -15.0
_SHADES = 64
_GLOW = 0.85
"""Below 1, or the viewer takes what is clear for black."""


def draw_heat(sheet: Sheet, story: Story, subject: Subject, box: Box) -> None:
    """Density at each step, over the whole plan."""
    if not subject.steps:
        return
    pixel_m = box.size / MOST_PIXELS
    path = entity("plan", "cells", subject.cell, "posterior", "heat")
    corner = rr.Transform3D(translation=(box.west, box.north, 0.0), scale=(pixel_m, -pixel_m, 1.0))
    style = rr.EncodedImage.from_fields(
        media_type="image/png", opacity=_GLOW, draw_order=_UNDER_LINES
    )
    sheet.always(path, style, corner)
    blobs = [
        png(density(step.posterior.squares, story.origin_m, box, pixel_m)) for step in subject.steps
    ]
    times = np.array([step.t_ns for step in subject.steps])
    sheet.over_time(path, times, rr.EncodedImage.columns(blob=blobs))


def density(cells: Squares, origin_m: tuple[float, float], box: Box, pixel_m: float) -> FloatArray:
    """Probability of each pixel of a picture of the plan, north up; what lies outside is left out.

    Every cell counts in a pixel by the area that they share: each corner of it is a step of a sum
    in both directions.
    """
    rows, columns = max(round(box.height / pixel_m), 1), max(round(box.width / pixel_m), 1)
    half = 0.5 * cells.size_m / pixel_m
    across, down = (
        (cells.x_m - origin_m[0] - box.west) / pixel_m,
        (box.north - cells.y_m + origin_m[1]) / pixel_m,
    )
    share = cells.probability * (pixel_m / cells.size_m) ** 2
    steps = np.zeros((rows + 2, columns + 2))
    for side_y, side_x in product((-1.0, 1.0), repeat=2):
        for (row, of_row), (column, of_column) in product(
            _edge(down + side_y * half, rows), _edge(across + side_x * half, columns)
        ):
            np.add.at(steps, (row, column), side_y * side_x * share * of_row * of_column)
    summed = np.cumsum(np.cumsum(steps, axis=0), axis=1)
    return np.maximum(summed[:rows, :columns], 0.0)


def _edge(
    at: FloatArray, count: int
) -> tuple[tuple[IntArray, FloatArray], tuple[IntArray, FloatArray]]:
    """The two pixels among which an edge divides its step, and their parts of it."""
    at = np.clip(at, 0.0, count)
    first = np.floor(at).astype(np.int64)
    return (first, first + 1.0 - at), (first + 1, at - first)


def png(density_of_pixel: FloatArray) -> bytes:
    """A glow in the posterior's colour, clear where there is nothing."""
    peak = float(np.max(density_of_pixel))
    # the square root: what has a hundredth of the peak's density still shows
    share = np.sqrt(density_of_pixel / peak) if peak > 0.0 else density_of_pixel
    picture = Image.fromarray(np.rint(share * (_SHADES - 1)).astype(np.uint8), "P")
    picture.putpalette(_palette().tobytes(), "RGBA")
    file = BytesIO()
    picture.convert("RGBA").save(file, "PNG", compress_level=6)
    return file.getvalue()


def _palette() -> npt.NDArray[np.uint8]:
    share = np.linspace(0.0, 1.0, _SHADES)[:, None]
    white = np.maximum(share - 0.6, 0.0) * 1.6
    rgb = np.array(colours.POSTERIOR) * (1.0 - white) + 255.0 * white
    return np.rint(np.hstack([rgb, 255.0 * share])).astype(np.uint8)
