"""Raster tiles in one file: MBTiles 1.3.

Their rows are numbered from the south (TMS) unless the metadata state xyz.
"""

import math
import sqlite3
import warnings
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image
from pyproj import CRS

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from logger.sqlite_file import open_database
from postproc.basemap.georeferenced import Area, Ground
from postproc.basemap.world_file import WEB_MERCATOR
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
_HAS_ZOOM = "SELECT 1 FROM tiles WHERE zoom_level = ? LIMIT 1"
_FINEST = 26
"""Level at which a tile is half a metre wide."""
_TILE = """
SELECT CAST(tile_data AS BLOB) FROM tiles
WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?
"""


TilePicture = Callable[[int, int], Image.Image | None]
"""Picture of the tile in a column and a row, counted from the north; None for no tile."""


class TileMatrix(NamedTuple):
    """One zoom level: `west, north` is the corner of tile (0, 0) in units of `crs`.

    `tile_width` and `tile_height` are the size of a tile in the same units.
    """

    crs: CRS
    zoom: int
    columns: int
    rows: int
    west: float
    north: float
    tile_width: float
    tile_height: float
    from_south: bool

    def span(self, points: FloatArray) -> tuple[range, range]:
        """Columns and rows, counted from the north, that cover points (2, ...)."""
        column = (points[0] - self.west) / self.tile_width
        row = (self.north - points[1]) / self.tile_height
        if not (np.all(np.isfinite(column)) and np.all(np.isfinite(row))):
            return range(0), range(0)
        return _covering(column, self.columns), _covering(row, self.rows)


def _covering(index: FloatArray, count: int) -> range:
    """Those of `count` tiles that cover all fractional indices."""
    return range(max(math.floor(index.min()), 0), min(math.floor(index.max()) + 1, count))


def open_tiles(path: Path, area: Area) -> Ground:
    """The tiles that cover an area, of the finest level that needs at most `MOST_TILES`.

    Raises `ConfigError`.
    """
    try:
        with open_database(path, views=True) as database:
            for matrix in _matrices(database):
                columns, rows = matrix.span(area.within(matrix.crs))
                if 0 < len(columns) * len(rows) <= MOST_TILES:
                    ground = mosaic(_of_database(database, matrix), matrix, columns, rows)
                    if ground is not None:
                        return ground
    except sqlite3.Error as error:
        raise ConfigError(f"{path} is no MBTiles file with raster tiles: {error}") from error
    except ValueError as error:
        raise ConfigError(f"{path}: {error} (vector tiles are read from PMTiles)") from error
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror or error}") from error
    raise ConfigError(f"{path} does not cover the area of this walk")


def _matrices(database: sqlite3.Connection) -> Iterator[TileMatrix]:
    """All zoom levels, the finest first."""
    from_south = database.execute(_IS_XYZ).fetchone() is None
    for zoom in range(_FINEST, -1, -1):
        if database.execute(_HAS_ZOOM, (zoom,)).fetchone():
            yield web_mercator_matrix(zoom)._replace(from_south=from_south)


def web_mercator_matrix(zoom: int) -> TileMatrix:
    """A zoom level of the world's tiles, numbered from the north."""
    count = 2**zoom
    side = 2 * _HALF_WORLD_M / count
    corner = -_HALF_WORLD_M, _HALF_WORLD_M
    size = count, count
    return TileMatrix(WEB_MERCATOR, zoom, *size, *corner, side, side, from_south=False)


def mosaic(picture: TilePicture, matrix: TileMatrix, columns: range, rows: range) -> Ground | None:
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
    pixel_x, pixel_y = matrix.tile_width / width, matrix.tile_height / height
    west = matrix.west + columns[0] * matrix.tile_width
    north = matrix.north - rows[0] * matrix.tile_height
    affine = np.array(
        [[pixel_x, 0.0, west + 0.5 * pixel_x], [0.0, -pixel_y, north - 0.5 * pixel_y]]
    )
    return Ground(np.asarray(image), matrix.crs, affine)


def _of_database(database: sqlite3.Connection, matrix: TileMatrix) -> TilePicture:
    def picture(column: int, row: int) -> Image.Image | None:
        stored = matrix.rows - 1 - row if matrix.from_south else row
        tile = database.execute(_TILE, (matrix.zoom, column, stored)).fetchone()
        return None if tile is None else tile_picture(tile[0])

    return picture


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
