"""Maps of tiles, PMTiles and MBTiles: their part under the plan as one picture with a position.

The rows of MBTiles are numbered from the south (TMS) unless the metadata state xyz.
"""

import gzip
import math
import re
import sqlite3
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image
from pmtiles.tile import (
    Compression,
    Entry,
    TileType,
    deserialize_directory,
    deserialize_header,
    find_tile,
    zxy_to_tileid,
)
from pyproj import CRS, Transformer

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from logger.core.foreign import check_regular, open_regular
from logger.sqlite_file import open_database
from postproc.basemap.vector_tile import draw_tile, layers_of, street_near
from postproc.foreign_file import MOST_DIRECTORY_BYTES, MOST_TILE_BYTES, MOST_TILE_PIXELS
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


# Source: protomaps/PMTiles, spec v3.

_MAGIC = b"PMTiles\x03"
_HEADER_BYTES = 127
_VECTOR_PIXELS = 1536
"""Along the longer side of what is drawn."""
_DEEPEST = 31
"""Level up to which the number of a tile fits into 64 bit."""
_LEVELS_OF_DIRECTORIES = 4
"""The root and three levels of leaves, as the specification allows."""
_LONG_NUMBER = re.compile(rb"[\x80-\xff]{10}")
_EQUATOR_M = 40_075_016.7


class _Archive:
    """An open file; raises ValueError where it contradicts itself or the limits."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._file, self._size = file, check_regular(path)
        self._header = deserialize_header(self._bytes(0, _HEADER_BYTES, _HEADER_BYTES))
        if not self._header["min_zoom"] <= self._header["max_zoom"] <= _DEEPEST:
            raise ValueError("it has no levels")
        self._directories: dict[tuple[int, int], list[Entry]] = {}

    @property
    def zooms(self) -> range:
        """From the finest."""
        return range(min(self._header["max_zoom"], FINEST), self._header["min_zoom"] - 1, -1)

    @property
    def is_vector(self) -> bool:
        return self._header["tile_type"] is TileType.MVT

    def tile(self, zoom: int, column: int, row: int) -> bytes | None:
        """A tile without its compression, None where there is none."""
        header, tile = self._header, zxy_to_tileid(zoom, column, row)
        at, length = header["root_offset"], header["root_length"]
        for _ in range(_LEVELS_OF_DIRECTORIES):
            entry = find_tile(self._directory(at, length), tile)
            if entry is None:
                return None
            if entry.run_length:
                at = header["tile_data_offset"] + entry.offset
                data = self._bytes(at, entry.length, MOST_TILE_BYTES)
                return _unpack(data, header["tile_compression"], MOST_TILE_BYTES)
            at, length = header["leaf_directory_offset"] + entry.offset, entry.length
        raise ValueError("its directories refer to each other")

    def _directory(self, at: int, length: int) -> list[Entry]:
        known = self._directories.get((at, length))
        if known is None:
            data = self._bytes(at, length, MOST_DIRECTORY_BYTES)
            plain = _unpack(data, self._header["internal_compression"], MOST_DIRECTORY_BYTES)
            if _LONG_NUMBER.search(plain):
                raise ValueError("a directory has a number of more than 64 bit")
            # the library takes gzip only, and would unpack all that follows the part checked here
            known = deserialize_directory(gzip.compress(plain, compresslevel=0))
            if len(self._directories) == _LEVELS_OF_DIRECTORIES:
                del self._directories[next(iter(self._directories))]
            self._directories[at, length] = known
        return known

    def _bytes(self, at: int, length: int, most: int) -> bytes:
        if length > min(most, self._size - at):
            raise ValueError(f"it names {length:,} bytes at {at:,}, of {self._size:,}")
        self._file.seek(at)
        data = self._file.read(length)
        if len(data) < length:
            raise ValueError("it is cut short")
        return data


def is_pmtiles(path: Path) -> bool:
    """Whether a file is a PMTiles archive of version 3."""
    try:
        with open_regular(path) as file:
            return file.read(len(_MAGIC)) == _MAGIC
    except OSError:
        return False


def open_pmtiles(path: Path, area: Area) -> Ground:
    """The tiles that cover an area; raises `ConfigError`."""
    with _archive(path) as archive:

        def picture_at(zoom: int, columns: range, rows: range) -> TilePicture:
            size = max(_VECTOR_PIXELS // max(len(columns), len(rows)), 256)

            def picture(column: int, row: int) -> Image.Image | None:
                data = archive.tile(zoom, column, row)
                if data is None:
                    return None
                if archive.is_vector:
                    return draw_tile(layers_of(data), size)
                return tile_picture(data)

            return picture

        ground = ground_of(archive.zooms, area, picture_at)
    if ground is None:
        raise ConfigError(f"{path} does not cover the area of this walk")
    return ground


def street_at(path: Path, lat_deg: float, lon_deg: float) -> str | None:
    """Name of the nearest street, by the finest vector tile at a position.

    None without one near, and for other kinds of files. Raises `ConfigError` for a file that cannot
    be read.
    """
    if not is_pmtiles(path):
        return None
    with _archive(path) as archive:
        for zoom in archive.zooms if archive.is_vector else ():
            x, y = _web_mercator(lat_deg, lon_deg, zoom)
            data = archive.tile(zoom, int(x), int(y))
            if data is not None:
                tile_m = _EQUATOR_M * math.cos(math.radians(lat_deg)) / 2**zoom
                return street_near(layers_of(data), (x % 1.0, y % 1.0), tile_m)
    return None


def _web_mercator(lat_deg: float, lon_deg: float, zoom: int) -> tuple[float, float]:
    count = 2**zoom
    row = 0.5 - math.asinh(math.tan(math.radians(lat_deg))) / (2.0 * math.pi)
    return (lon_deg + 180.0) / 360.0 * count % count, row * count


@contextmanager
def _archive(path: Path) -> Iterator[_Archive]:
    try:
        with open_regular(path) as file:
            yield _Archive(path, file)
    except EOFError:
        raise ConfigError(f"{path} cannot be read: a directory is cut short") from None
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise ConfigError(f"{path} cannot be read: {reason}") from error


def _unpack(data: bytes, packing: Compression, most: int) -> bytes:
    if packing is Compression.NONE:
        return data
    if packing is not Compression.GZIP:
        raise ValueError("it is compressed by something else than gzip")
    try:
        whole = zlib.decompressobj(16 + zlib.MAX_WBITS)
        plain = whole.decompress(data, most)
    except zlib.error as error:
        raise ValueError(f"a compressed part is damaged: {error}") from error
    if not whole.eof:
        raise ValueError(f"a compressed part is cut, or has more than {most >> 20} MB")
    return plain
