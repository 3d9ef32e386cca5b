"""A picture of the ground under the plan, from a file on this machine."""

from dataclasses import dataclass
from io import BytesIO
from math import hypot
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image
from pyproj import CRS

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from logger.sqlite_file import is_sqlite
from postproc.basemap.tiles import Area, Ground, is_pmtiles, open_mbtiles, open_pmtiles
from postproc.pictures.survey import Box, Survey

MOST_PIXELS = 2048
"""Along the longer side: a megabyte as JPEG."""
_MESH = 17
"""Points along each side that are projected; interpolation between them is accurate enough."""
_MARGIN = 0.02
_QUALITY = 85
"""JPEG quality: artefacts are invisible behind what is drawn on it."""

Pixels = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Basemap:
    """Pixels (rows, columns, 4), north up, that cover `box` in local metres.

    They are transparent where the file has no data.
    """

    pixels: Pixels
    box: Box

    def jpeg(self, paper: tuple[int, int, int], opacity: float = 1.0) -> bytes:
        """The pixels on paper of a colour, where they are transparent or not opaque."""
        alpha = opacity * self.pixels[..., 3:] / 255.0
        rgb = self.pixels[..., :3] * alpha + np.array(paper) * (1.0 - alpha)
        file = BytesIO()
        Image.fromarray(np.rint(rgb).astype(np.uint8)).save(file, "JPEG", quality=_QUALITY)
        return file.getvalue()


def read_basemap(
    path: Path, survey: Survey, plan: Box | None, most_pixels: int = MOST_PIXELS
) -> Basemap | None:
    """The part of a file that covers a plan; None without a plan.

    Raises `ConfigError` where the file does not cover any of it.
    """
    if plan is None or survey.utm is None:
        return None
    box = plan.enlarge(_MARGIN * plan.size)
    area = _area_of(survey, box, most_pixels)
    ground = open_ground(path, area)
    # the nearest pixel is taken: half as large, so that none is off by more than a quarter of one
    pixel_m = max(area.finest_m, 0.5 * _pixel_m(ground, area))
    shape = max(round(box.height / pixel_m), 1), max(round(box.width / pixel_m), 1)
    pixels = _resample(ground, area, shape)
    if not np.any(pixels[..., 3]):
        raise ConfigError(f"{path} does not cover the area of this walk")
    return Basemap(pixels, box)


def open_ground(path: Path, area: Area) -> Ground:
    """What a file has of an area; raises `ConfigError` for one that cannot be read."""
    if is_sqlite(path):
        return open_mbtiles(path, area)
    if is_pmtiles(path):
        return open_pmtiles(path, area)
    if not path.is_file():
        raise ConfigError(f"{path} is no file")
    raise ConfigError(
        f"{path} is neither PMTiles nor MBTiles; GDAL makes MBTiles of a picture with a position: "
        "gdal_translate -of MBTILES PICTURE map.mbtiles"
    )


def _area_of(survey: Survey, box: Box, most_pixels: int) -> Area:
    assert survey.utm is not None
    zone = survey.utm.zone
    # EPSG 326xx are the UTM zones of the north, 327xx those of the south
    crs = CRS.from_epsg((32600 if zone > 0 else 32700) + abs(zone))
    origin_x, origin_y = survey.origin_m
    east = np.linspace(box.west, box.east, _MESH) + origin_x
    north = np.linspace(box.north, box.south, _MESH) + origin_y
    return Area(crs, np.stack(np.meshgrid(east, north)), box.size / most_pixels)


def _pixel_m(ground: Ground, area: Area) -> float:
    """Metres of the plan between neighbouring pixels of the ground, along its diagonal."""
    diagonal_m, diagonal_pixels = (
        hypot(*(float(values[-1, -1] - values[0, 0]) for values in pair))
        for pair in (area.mesh, ground.pixel_at(area))
    )
    return diagonal_m / max(diagonal_pixels, 1e-9)


def _resample(ground: Ground, area: Area, shape: tuple[int, int]) -> Pixels:
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
