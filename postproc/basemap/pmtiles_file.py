"""Tiles in a PMTiles file (version 3): pictures, or vector tiles that are drawn here.

Source: protomaps/PMTiles, spec v3.
"""

import gzip
import math
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image, UnidentifiedImageError
from pmtiles.reader import MmapSource, Reader
from pmtiles.tile import Compression, TileType

from logger.core.errors import ConfigError
from postproc.basemap.georeferenced import Area, Ground
from postproc.basemap.street_map import draw_tile
from postproc.basemap.tiles import MOST_TILES, TileMatrix, mosaic, web_mercator_matrix
from postproc.basemap.vector_tile import layers_of

_MAGIC = b"PMTiles\x03"
_VECTOR_PIXELS = 1536
"""Along the longer side of what is drawn."""
_MOST_BYTES = 64 << 20
"""Of one tile; real ones have less than a megabyte."""


class _Archive(NamedTuple):
    reader: Any
    header: dict[str, Any]

    def tile(self, zoom: int, column: int, row: int) -> bytes | None:
        """A tile without its compression, None where there is none."""
        data: bytes | None = self.reader.get(zoom, column, row)
        if data is None or self.header["tile_compression"] == Compression.NONE:
            return data
        if self.header["tile_compression"] != Compression.GZIP:
            raise ValueError("its tiles are compressed by something else than gzip")
        with gzip.GzipFile(fileobj=BytesIO(data)) as file:
            return file.read(_MOST_BYTES)


class TilePlace(NamedTuple):
    """A tile and a place in it, as shares of its width from the west and from the north."""

    zoom: int
    data: bytes
    place: tuple[float, float]


def is_pmtiles(path: Path) -> bool:
    """Whether a file is a PMTiles archive of version 3."""
    try:
        with path.open("rb") as file:
            return file.read(len(_MAGIC)) == _MAGIC
    except OSError:
        return False


def open_pmtiles(path: Path, area: Area) -> Ground:
    """The tiles that cover an area, of the finest level that needs at most `MOST_TILES`.

    Raises `ConfigError`.
    """
    try:
        with _archive(path) as archive:
            zooms = range(archive.header["max_zoom"], archive.header["min_zoom"] - 1, -1)
            for matrix in map(web_mercator_matrix, zooms):
                columns, rows = matrix.span(area.within(matrix.crs))
                if 0 < len(columns) * len(rows) <= MOST_TILES:
                    ground = mosaic(_source(archive, matrix, columns, rows), matrix, columns, rows)
                    if ground is not None:
                        return ground
    except (UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise ConfigError(f"{path}: a tile is no picture: {error}") from error
    except (OSError, EOFError, ValueError, LookupError, TypeError) as error:
        raise ConfigError(f"{path} cannot be read: {error}") from error
    raise ConfigError(f"{path} does not cover the area of this walk")


def vector_tile_at(path: Path, lat_deg: float, lon_deg: float) -> TilePlace | None:
    """The finest vector tile at a position; None for pictures and without a tile there.

    Raises `ConfigError`.
    """
    try:
        with _archive(path) as archive:
            if archive.header["tile_type"] != TileType.MVT:
                return None
            for zoom in range(archive.header["max_zoom"], archive.header["min_zoom"] - 1, -1):
                x, y = _web_mercator(lat_deg, lon_deg, zoom)
                data = archive.tile(zoom, int(x), int(y))
                if data is not None:
                    return TilePlace(zoom, data, (x % 1.0, y % 1.0))
    except (OSError, EOFError, ValueError, LookupError, TypeError) as error:
        raise ConfigError(f"{path} cannot be read: {error}") from error
    return None


def _web_mercator(lat_deg: float, lon_deg: float, zoom: int) -> tuple[float, float]:
    """Column and row of a position, with fractions."""
    count = 2**zoom
    row = 0.5 - math.asinh(math.tan(math.radians(lat_deg))) / (2.0 * math.pi)
    return (lon_deg + 180.0) / 360.0 * count % count, row * count


@contextmanager
def _archive(path: Path) -> Iterator[_Archive]:
    with path.open("rb") as file:
        reader: Any = Reader(MmapSource(file))  # type: ignore[no-untyped-call]
        yield _Archive(reader, reader.header())


def _source(archive: _Archive, matrix: TileMatrix, columns: range, rows: range) -> Any:
    """How a tile becomes a picture, by what the file says that its tiles are."""
    is_vector = archive.header["tile_type"] == TileType.MVT
    size = max(_VECTOR_PIXELS // max(len(columns), len(rows)), 256)

    def picture(column: int, row: int) -> Image.Image | None:
        data = archive.tile(matrix.zoom, column, row)
        if data is None:
            return None
        if is_vector:
            return draw_tile(layers_of(data), size)
        return Image.open(BytesIO(data)).convert("RGBA")

    return picture
