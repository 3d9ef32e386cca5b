"""A picture of the ground under the plan, from a file of this machine."""

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
from postproc.pictures.picture import Box
from postproc.view.georeferenced import Area, Ground
from postproc.view.ground import PAPER
from postproc.view.rerun_writer import Sheet
from postproc.view.tiles import is_database, open_tiles
from postproc.view.view_model import Story
from postproc.view.world_file import open_picture

MOST_PIXELS = 2048
"""Along the longer side: a megabyte as JPEG."""
_MESH = 17
"""Places along each side that are projected; between them it is straight enough."""
_MARGIN = 0.02
_UNDER_HEAT = -25.0
_OPACITY = 0.3
"""Dark enough for what glows on it."""
_QUALITY = 85

Pixels = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Basemap:
    """Pixels (rows, columns, 4), north up, that cover `box` in local metres; clear where the file
    has nothing.
    """

    pixels: Pixels
    box: Box


def read_basemap(path: Path, story: Story) -> Basemap | None:
    """What a file shows of the plan, None without a plan; raises `ConfigError` where it shows
    nothing of it.
    """
    if story.box is None or story.utm is None:
        return None
    box = story.box.wider(_MARGIN * story.box.size)
    utm = CRS.from_epsg((32600 if story.utm.zone > 0 else 32700) + abs(story.utm.zone))
    east, north = (
        np.linspace(*ends, _MESH) for ends in ((box.west, box.east), (box.north, box.south))
    )
    mesh = np.stack(np.meshgrid(east + story.origin_m[0], north + story.origin_m[1]))
    area = Area(utm, mesh, box.size / MOST_PIXELS)
    ground = open_tiles(path, area) if is_database(path) else open_picture(path, area)
    # the nearest pixel is taken: half as large, so that none lies off by more than a quarter of its
    # own size
    pixel_m = max(area.finest_m, 0.5 * _pixel_m(ground, area))
    shape = max(round(box.height / pixel_m), 1), max(round(box.width / pixel_m), 1)
    pixels = _resampled(ground, area, shape)
    if not np.any(pixels[..., 3]):
        raise ConfigError(f"{path} shows nothing of the place of this walk")
    return Basemap(pixels, box)


def draw_basemap(sheet: Sheet, basemap: Basemap) -> None:
    """Under everything else of the plan."""
    alpha = basemap.pixels[..., 3:] / 255.0
    flat = np.rint(basemap.pixels[..., :3] * alpha + np.array(PAPER) * (1.0 - alpha)).astype(
        np.uint8
    )
    file = BytesIO()
    Image.fromarray(flat).save(file, "JPEG", quality=_QUALITY)
    rows, columns = flat.shape[:2]
    box = basemap.box
    scale = (box.width / columns, -box.height / rows, 1.0)
    place = rr.Transform3D(translation=(box.west, box.north, 0.0), scale=scale)
    picture = rr.EncodedImage(
        contents=file.getvalue(), media_type="image/jpeg", opacity=_OPACITY, draw_order=_UNDER_HEAT
    )
    sheet.always("plan/ground/basemap", picture, place)


def _pixel_m(ground: Ground, area: Area) -> float:
    """Metres of the plan between neighbouring pixels of the ground, along its diagonal."""
    metres, pixels = (
        hypot(*(float(values[-1, -1] - values[0, 0]) for values in pair))
        for pair in (area.mesh, ground.pixel_at(area))
    )
    return metres / max(pixels, 1e-9)


def _resampled(ground: Ground, area: Area, shape: tuple[int, int]) -> Pixels:
    """The ground in the plan's projection, shape (rows, columns, 4)."""
    down, across = (_weights(count) for count in shape)
    column, row = (np.rint(down @ grid @ across.T) for grid in ground.pixel_at(area))
    rows, columns = ground.pixels.shape[:2]
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    at = np.where(inside, row, 0).astype(int), np.where(inside, column, 0).astype(int)
    return np.where(inside[..., None], ground.pixels[at], np.uint8(0))


def _weights(count: int) -> FloatArray:
    """Linear interpolation from the mesh to the middles of `count` pixels, shape (count, mesh)."""
    at = (np.arange(count) + 0.5) / count * (_MESH - 1)
    return np.maximum(1.0 - np.abs(at[:, None] - np.arange(_MESH)), 0.0)
