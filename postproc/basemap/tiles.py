"""Tiles of Web Mercator as one picture with a position, and those of MBTiles 1.3.

The rows of MBTiles are numbered from the south (TMS) unless the metadata state xyz.
"""

import math
import sqlite3
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image
from pyproj import CRS, Transformer

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from logger.sqlite_file import open_database
from postproc.foreign_file import MOST_TILE_PIXELS
from postproc.progress import with_progress

MOST_TILES = 64
"""Eight by eight of 256 pixels: as many pixels as the plan can use."""
_HALF_WORLD_M = math.pi * 6378137.0
"""Half the circumference of Web Mercator's sphere."""

_MOSAIC_PIXELS = 512
"""Of a tile: more than the plan can use."""
_FORMATS = ("PNG", "JPEG", "WEBP")
"""Of tiles; Pillow would start other programs for some formats."""
_IS_XYZ = "SELECT 1 FROM metadata WHERE name = 'scheme' AND value = 'xyz' LIMIT 1"
FINEST = 26
"""Level at which a tile is half a metre wide."""
_TILE = """
SELECT CAST(tile_data AS BLOB) FROM tiles
WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?
"""


TilePicture = Callable[[int, int], Image.Image | None]
"""Picture of the tile in a column and a row, counted from the north; None for no tile."""


_WEB_MERCATOR = CRS.from_epsg(3857)


class Area(NamedTuple):
    """The plan's area: a mesh (2, k, k) of points in `crs`, and the finest useful pixel."""

    crs: CRS
    mesh: FloatArray
    finest_m: float

    @property
    def web_mercator_m(self) -> FloatArray:
        """The mesh in Web Mercator, shape (2, k, k); x is east."""
        transform = Transformer.from_crs(self.crs, _WEB_MERCATOR, always_xy=True).transform
        return np.stack(transform(*self.mesh))


@dataclass(frozen=True, slots=True)
class Ground:
    """Pixels (rows, columns, 4) of a part of the Earth.

    The centre of pixel (column, row) lies at `affine` (2, 3) @ [column, row, 1] in Web Mercator.
    """

    pixels: npt.NDArray[np.uint8]
    affine: FloatArray

    def pixel_at(self, area: Area) -> tuple[FloatArray, FloatArray]:
        """Column and row, with fractions, of each point of the area's mesh."""
        points = area.web_mercator_m
        offset = points - self.affine[:, 2].reshape(2, *[1] * (points.ndim - 1))
        column, row = np.tensordot(np.linalg.inv(self.affine[:, :2]), offset, axes=1)
        return column, row


def ground_of(
    zooms: range, area: Area, picture_at: Callable[[int, range, range], TilePicture]
) -> Ground | None:
    """Tiles that cover an area, of the finest of these levels that needs at most `MOST_TILES`.

    `picture_at` gives the pictures of the tiles in these columns and rows of a level.
    """
    for zoom in zooms:
        side_m = 2.0 * _HALF_WORLD_M / 2**zoom
        x_m, y_m = area.web_mercator_m
        columns = _covering((x_m + _HALF_WORLD_M) / side_m, 2**zoom)
        rows = _covering((_HALF_WORLD_M - y_m) / side_m, 2**zoom)
        if 0 < len(columns) * len(rows) <= MOST_TILES:
            ground = _mosaic(picture_at(zoom, columns, rows), side_m, columns, rows)
            if ground is not None:
                return ground
    return None


def _covering(index: FloatArray, count: int) -> range:
    """Those of `count` tiles that cover all fractional indices."""
    if not np.all(np.isfinite(index)):
        return range(0)
    return range(max(math.floor(index.min()), 0), min(math.floor(index.max()) + 1, count))


def _mosaic(picture: TilePicture, side_m: float, columns: range, rows: range) -> Ground | None:
    """Tiles side by side, transparent where one is missing; None where all are."""
    places = [(column, row) for row in rows for column in columns]
    image: Image.Image | None = None
    width = height = 1
    for column, row in with_progress(places, "tiles of the map", len(places)):
        tile = picture(column, row)
        if tile is None:
            continue
        if image is None:
            width, height = (min(side, _MOSAIC_PIXELS) for side in tile.size)
            image = Image.new("RGBA", (width * len(columns), height * len(rows)))
        corner = (column - columns[0]) * width, (row - rows[0]) * height
        image.paste(tile.resize((width, height)), corner)
    if image is None:
        return None
    pixel_x, pixel_y = side_m / width, side_m / height
    west = columns[0] * side_m - _HALF_WORLD_M
    north = _HALF_WORLD_M - rows[0] * side_m
    affine = np.array(
        [[pixel_x, 0.0, west + 0.5 * pixel_x], [0.0, -pixel_y, north - 0.5 * pixel_y]]
    )
    return Ground(np.asarray(image), affine)


def open_mbtiles(path: Path, area: Area) -> Ground:
    """The tiles of a file that cover an area; raises `ConfigError`."""
    try:
        with open_database(path, views=True) as database:
            from_south = database.execute(_IS_XYZ).fetchone() is None

            def picture_at(zoom: int, *_: range) -> TilePicture:
                def picture(column: int, row: int) -> Image.Image | None:
                    stored = 2**zoom - 1 - row if from_south else row
                    tile = database.execute(_TILE, (zoom, column, stored)).fetchone()
                    return None if tile is None else tile_picture(tile[0])

                return picture

            ground = ground_of(range(FINEST, -1, -1), area, picture_at)
    except sqlite3.Error as error:
        raise ConfigError(f"{path} is no MBTiles file with raster tiles: {error}") from error
    except ValueError as error:
        raise ConfigError(f"{path}: {error} (vector tiles are read from PMTiles)") from error
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror or error}") from error
    if ground is None:
        raise ConfigError(f"{path} does not cover the area of this walk")
    return ground


def tile_picture(data: bytes | None) -> Image.Image:
    """The picture in a tile; raises ValueError for anything else."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(BytesIO(data or b""), formats=_FORMATS) as picture:
                if max(picture.size) <= MOST_TILE_PIXELS:
                    return picture.convert("RGBA")
    except Exception as error:  # whatever Pillow makes of a damaged picture
        raise ValueError(f"a tile is no picture: {error}") from error
    raise ValueError(f"a tile has more than {MOST_TILE_PIXELS} pixels along a side")
