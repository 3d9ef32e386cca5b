"""Raster tiles in one file: MBTiles 1.3, and GeoPackage (OGC 12-128r18, clause 2.2).

Rows of a GeoPackage are numbered from the north. Those of MBTiles are from the south (TMS) unless
its metadata say xyz.
"""

import math
import sqlite3
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, UnidentifiedImageError
from pyproj import CRS
from pyproj.exceptions import CRSError

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from postproc.sqlite_file import opened
from postproc.view.georeferenced import Area, Ground
from postproc.view.world_file import WEB_MERCATOR

MOST_TILES = 64
_HALF_WORLD_M = math.pi * 6378137.0
_MAGIC = b"SQLite format 3\0"


class Level(NamedTuple):
    """One zoom level: `west, north` is the corner of tile (0, 0), `wide, high` the size of each in
    units of `crs`.
    """

    table: str
    crs: CRS
    zoom: int
    columns: int
    rows: int
    west: float
    north: float
    wide: float
    high: float
    from_south: bool

    def span(self, places: FloatArray) -> tuple[range, range]:
        """Columns and rows, counted from the north, that cover places (2, ...)."""
        column, row = (places[0] - self.west) / self.wide, (self.north - places[1]) / self.high
        if not (np.all(np.isfinite(column)) and np.all(np.isfinite(row))):
            return range(0), range(0)
        return _covering(column, self.columns), _covering(row, self.rows)


def _covering(at: FloatArray, count: int) -> range:
    """Those of `count` tiles in a row that reach from the least to the greatest place."""
    return range(max(math.floor(at.min()), 0), min(math.floor(at.max()) + 1, count))


def is_database(path: Path) -> bool:
    """Whether a file is one of SQLite, as both kinds are."""
    try:
        with path.open("rb") as file:
            return file.read(len(_MAGIC)) == _MAGIC
    except OSError:
        return False


def open_tiles(path: Path, area: Area) -> Ground:
    """The tiles that cover an area, of the finest level that needs no more than `MOST_TILES`;
    raises `ConfigError`.
    """
    try:
        with opened(path, views=True) as database:
            for level in _levels(database):
                columns, rows = level.span(area.within(level.crs))
                if 0 < len(columns) * len(rows) <= MOST_TILES:
                    found = _mosaic(database, level, columns, rows)
                    if found is not None:
                        return found
    except sqlite3.Error as error:
        raise ConfigError(f"{path} holds no raster tiles: {error}") from error
    except CRSError as error:
        raise ConfigError(f"{path}: its reference system is not known") from error
    except (UnidentifiedImageError, Image.DecompressionBombError, OSError, SyntaxError) as error:
        raise ConfigError(f"{path}: a tile is no picture (vector tiles cannot be drawn)") from error
    raise ConfigError(f"{path} shows nothing of the place of this walk")


def _levels(database: sqlite3.Connection) -> Iterator[Level]:
    """All levels of all layers, the finest of each first."""
    names = {
        name
        for (name,) in database.execute(
            "SELECT name FROM sqlite_master WHERE type IN ('table', 'view')"
        )
    }
    yield from _of_geopackage(database) if "gpkg_contents" in names else _of_mbtiles(database)


def _of_mbtiles(database: sqlite3.Connection) -> Iterator[Level]:
    told = dict(database.execute("SELECT name, value FROM metadata"))
    from_south = told.get("scheme", "tms") != "xyz"
    for (zoom,) in database.execute(
        "SELECT DISTINCT zoom_level FROM tiles ORDER BY zoom_level DESC"
    ).fetchall():
        side = 2 * _HALF_WORLD_M / 2**zoom
        corner = -_HALF_WORLD_M, _HALF_WORLD_M
        yield Level("tiles", WEB_MERCATOR, zoom, 2**zoom, 2**zoom, *corner, side, side, from_south)


def _of_geopackage(database: sqlite3.Connection) -> Iterator[Level]:
    sets = database.execute(
        "SELECT s.table_name, s.min_x, s.max_y, r.organization, r.organization_coordsys_id, r.definition "
        "FROM gpkg_tile_matrix_set s JOIN gpkg_contents c ON c.table_name = s.table_name AND c.data_type = 'tiles' "
        "JOIN gpkg_spatial_ref_sys r ON r.srs_id = s.srs_id"
    ).fetchall()
    for table, west, north, organisation, number, definition in sets:
        known = organisation.upper() == "EPSG"
        crs = CRS.from_epsg(number) if known else CRS.from_user_input(definition)
        matrices = database.execute(
            "SELECT zoom_level, matrix_width, matrix_height, tile_width * pixel_x_size, tile_height * pixel_y_size "
            "FROM gpkg_tile_matrix WHERE table_name = ? ORDER BY zoom_level DESC",
            (table,),
        ).fetchall()
        for zoom, columns, rows, wide, high in matrices:
            yield Level(table, crs, zoom, columns, rows, west, north, wide, high, from_south=False)


def _mosaic(
    database: sqlite3.Connection, level: Level, columns: range, rows: range
) -> Ground | None:
    """Tiles side by side, clear where there is none; None where there is none at all."""
    name = '"' + level.table.replace('"', '""') + '"'
    query = f"SELECT CAST(tile_data AS BLOB) FROM {name} WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?"  # noqa: S608
    found: dict[tuple[int, int], Image.Image] = {}
    for row in rows:
        for column in columns:
            stored = level.rows - 1 - row if level.from_south else row
            tile = database.execute(query, (level.zoom, column, stored)).fetchone()
            if tile is not None:
                found[column, row] = Image.open(BytesIO(tile[0])).convert("RGBA")
    if not found:
        return None
    width, height = next(iter(found.values())).size
    whole = Image.new("RGBA", (width * len(columns), height * len(rows)))
    for (column, row), picture in found.items():
        whole.paste(
            picture.resize((width, height)),
            ((column - columns[0]) * width, (row - rows[0]) * height),
        )
    wide, high = level.wide / width, level.high / height
    west, north = level.west + columns[0] * level.wide, level.north - rows[0] * level.high
    affine = np.array([[wide, 0.0, west + 0.5 * wide], [0.0, -high, north - 0.5 * high]])
    return Ground(np.asarray(whole), level.crs, affine)
