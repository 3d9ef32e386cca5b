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
from postproc.pictures.geometry import Box
from postproc.view.surface import Surface
from postproc.view.view_model import CellView, ViewModel

MOST_PIXELS = 192
"""Along the longer side of the plan: twenty steps are a third of a megabyte."""
_ORDER = -15.0
"""Below all lines, above the base map."""
_SHADES = 64
_OPACITY = 0.85
"""Below 1, or the viewer draws transparent pixels as black."""


def draw_density(plan: Surface, view: ViewModel, cell: CellView) -> None:
    """Density at each step, over the whole plan."""
    box = view.box
    if not cell.steps or box is None:
        return
    pixel_m = box.size / MOST_PIXELS
    path = ("cells", cell.name, "posterior", "density")
    style = rr.EncodedImage.from_fields(media_type="image/png", opacity=_OPACITY, draw_order=_ORDER)
    corner = rr.Transform3D(translation=(box.west, box.north, 0.0), scale=(pixel_m, -pixel_m, 1.0))
    plan.log_static(path, style, corner)
    origin_m = view.survey.origin_m
    images = [png(density(step.posterior.squares, origin_m, box, pixel_m)) for step in cell.steps]
    plan.send_columns(path, cell.t_ns, rr.EncodedImage.columns(blob=images))


def density(
    squares: Squares, origin_m: tuple[float, float], box: Box, pixel_m: float
) -> FloatArray:
    """Probability of each pixel of the plan, shape (rows, columns), north up.

    A square contributes to a pixel by the area that they share. Each of its corners is a step in a
    two-dimensional difference array, which is summed in both directions at the end.
    """
    rows, columns = max(round(box.height / pixel_m), 1), max(round(box.width / pixel_m), 1)
    half = 0.5 * squares.size_m / pixel_m
    across = (squares.x_m - origin_m[0] - box.west) / pixel_m
    down = (box.north - squares.y_m + origin_m[1]) / pixel_m
    share = squares.probability * (pixel_m / squares.size_m) ** 2
    steps = np.zeros((rows + 2, columns + 2))
    for side_y, side_x in product((-1.0, 1.0), repeat=2):
        edges = product(
            _split_edge(down + side_y * half, rows), _split_edge(across + side_x * half, columns)
        )
        for (row, row_share), (column, column_share) in edges:
            np.add.at(steps, (row, column), side_y * side_x * share * row_share * column_share)
    summed = np.cumsum(np.cumsum(steps, axis=0), axis=1)
    return np.maximum(summed[:rows, :columns], 0.0)


def _split_edge(
    edge: FloatArray, count: int
) -> tuple[tuple[IntArray, FloatArray], tuple[IntArray, FloatArray]]:
    """The two pixels next to an edge, and the share of its step that each gets."""
    edge = np.clip(edge, 0.0, count)
    first = np.floor(edge).astype(np.int64)
    return (first, first + 1.0 - edge), (first + 1, edge - first)


def png(pixel_density: FloatArray) -> bytes:
    """A glow in the posterior's colour, transparent where the density (rows, columns) is 0."""
    peak = float(np.max(pixel_density))
    # the square root shows a hundredth of the peak's density, too
    share = np.sqrt(pixel_density / peak) if peak > 0.0 else pixel_density
    picture = Image.fromarray(np.rint(share * (_SHADES - 1)).astype(np.uint8), "P")
    picture.putpalette(_palette().tobytes(), "RGBA")
    file = BytesIO()
    picture.convert("RGBA").save(file, "PNG", compress_level=6)
    return file.getvalue()


def _palette() -> npt.NDArray[np.uint8]:
    """From transparent through the posterior's colour to nearly white, shape (shades, 4)."""
    share = np.linspace(0.0, 1.0, _SHADES)[:, None]
    white = np.maximum(share - 0.6, 0.0) * 1.6  # from 60 % of the scale on
    rgb = np.array(colours.POSTERIOR) * (1.0 - white) + 255.0 * white
    return np.rint(np.hstack([rgb, 255.0 * share])).astype(np.uint8)
