"""A picture of the ground under the plan, from a file on this machine."""

from dataclasses import dataclass
from io import BytesIO
from math import hypot
from pathlib import Path

import numpy as np
import numpy.typing as npt
import rerun as rr
from PIL import Image
from pyproj import CRS

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from postproc.pictures.geometry import Box
from postproc.view.georeferenced import Area, Ground
from postproc.view.ground import PAPER
from postproc.view.rerun_writer import RerunWriter
from postproc.view.tiles import is_database, open_tiles
from postproc.view.view_model import ViewModel
from postproc.view.world_file import open_picture

MOST_PIXELS = 2048
"""Along the longer side: a megabyte as JPEG."""
_MESH = 17
"""Points along each side that are projected; interpolation between them is accurate enough."""
_MARGIN = 0.02
_ORDER = -25.0
"""Below the density and everything else."""
_OPACITY = 0.3
"""Dark enough for what glows on it."""
_QUALITY = 85
"""JPEG quality: artefacts are invisible at this opacity."""

Pixels = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Basemap:
    """Pixels (rows, columns, 4), north up, that cover `box` in local metres.

    They are transparent where the file has no data.
    """

    pixels: Pixels
    box: Box


def read_basemap(path: Path, view: ViewModel) -> Basemap | None:
    """The part of a file that covers the plan; None without a plan.

    Raises `ConfigError` where the file does not cover any of it.
    """
    if view.box is None or view.survey.utm is None:
        return None
    box = view.box.enlarge(_MARGIN * view.box.size)
    area = _area_of(view, box)
    ground = open_tiles(path, area) if is_database(path) else open_picture(path, area)
    # the nearest pixel is taken: half as large, so that none is off by more than a quarter of one
    pixel_m = max(area.finest_m, 0.5 * _pixel_m(ground, area))
    shape = max(round(box.height / pixel_m), 1), max(round(box.width / pixel_m), 1)
    pixels = _resample(ground, area, shape)
    if not np.any(pixels[..., 3]):
        raise ConfigError(f"{path} does not cover the area of this walk")
    return Basemap(pixels, box)


def draw_basemap(writer: RerunWriter, basemap: Basemap) -> None:
    """Below everything else on the plan."""
    alpha = basemap.pixels[..., 3:] / 255.0
    rgb = basemap.pixels[..., :3] * alpha + np.array(PAPER) * (1.0 - alpha)
    file = BytesIO()
    Image.fromarray(np.rint(rgb).astype(np.uint8)).save(file, "JPEG", quality=_QUALITY)
    rows, columns = rgb.shape[:2]
    box = basemap.box
    picture = rr.EncodedImage(
        contents=file.getvalue(), media_type="image/jpeg", opacity=_OPACITY, draw_order=_ORDER
    )
    corner = rr.Transform3D(
        translation=(box.west, box.north, 0.0),
        scale=(box.width / columns, -box.height / rows, 1.0),
    )
    writer.log_static("plan/ground/basemap", picture, corner)


def _area_of(view: ViewModel, box: Box) -> Area:
    assert view.survey.utm is not None
    zone = view.survey.utm.zone
    # EPSG 326xx are the UTM zones of the north, 327xx those of the south
    crs = CRS.from_epsg((32600 if zone > 0 else 32700) + abs(zone))
    origin_x, origin_y = view.survey.origin_m
    east = np.linspace(box.west, box.east, _MESH) + origin_x
    north = np.linspace(box.north, box.south, _MESH) + origin_y
    return Area(crs, np.stack(np.meshgrid(east, north)), box.size / MOST_PIXELS)


def _pixel_m(ground: Ground, area: Area) -> float:
    """Metres of the plan between neighbouring pixels of the ground, along its diagonal."""
    diagonal_m, diagonal_pixels = (
        hypot(*(float(values[-1, -1] - values[0, 0]) for values in pair))
        for pair in (area.mesh, ground.pixel_at(area))
    )
    return diagonal_m / max(diagonal_pixels, 1e-9)


def _resample(ground: Ground, area: Area, shape: tuple[int, int]) -> Pixels:
    """The ground in the plan's projection, shape (rows, columns, 4)."""
    down, across = (_weights(count) for count in shape)
    column, row = (np.rint(down @ grid @ across.T) for grid in ground.pixel_at(area))
    rows, columns = ground.pixels.shape[:2]
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    index = np.where(inside, row, 0).astype(int), np.where(inside, column, 0).astype(int)
    return np.where(inside[..., None], ground.pixels[index], np.uint8(0))


def _weights(count: int) -> FloatArray:
    """Linear interpolation from the mesh to the centres of `count` pixels, shape (count, mesh)."""
    position = (np.arange(count) + 0.5) / count * (_MESH - 1)
    return np.maximum(1.0 - np.abs(position[:, None] - np.arange(_MESH)), 0.0)
