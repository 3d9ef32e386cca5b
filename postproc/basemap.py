"""A picture of the ground under the plan: tiles of PMTiles and MBTiles."""

import gzip
import math
import re
import sqlite3
import struct
import sys
import warnings
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from math import hypot
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
from PIL import Image, ImageDraw
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
from logger.core.certainty import OnMap
from logger.core.errors import ConfigError
from logger.core.foreign import begins_with, check_regular, open_regular
from logger.core.printable import printable
from logger.sqlite_file import is_sqlite, open_database
from postproc.foreign_file import MOST_DIRECTORY_BYTES, MOST_TILE_BYTES, MOST_TILE_PIXELS
from postproc.pictures.survey import Box, Survey
from postproc.progress import with_progress

# The rows of MBTiles are numbered from the south (TMS) unless the metadata state xyz.

# Vector tiles are drawn as a quiet picture, and asked for the name of a street.
# Source: mapbox/vector-tile-spec, 2.1. The tiles are protocol buffers, read here: the library
# mapbox-vector-tile (2.2.0) needs a protobuf below 7 and pyclipper. Layers have the names of the
# two schemas in use, Protomaps (docs.protomaps.com/basemaps/layers) and OpenMapTiles
# (openmaptiles.org/schema).

Kind = Literal["point", "line", "polygon"]
Value = str | float | int | bool
Part = list[tuple[int, int]]
Point = tuple[float, float]
Colour = tuple[int, int, int]

_KINDS: dict[int, Kind] = {1: "point", 2: "line", 3: "polygon"}
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_MOVE, _CLOSE = 1, 7
_FARTHEST = 1 << 24
"""Units of a tile, which has 4096: a drawing program would take hours for a line beyond."""
_MOST_BITS = 70
"""Of a number in bytes of seven."""


class Feature(NamedTuple):
    """One feature: its parts as points (x, y), x to the east and y to the south, and its tags."""

    kind: Kind
    parts: list[Part]
    tags: dict[str, Value]


class Layer(NamedTuple):
    """A layer of a tile that is `extent` units wide and high."""

    name: str
    extent: int
    features: list[Feature]


def layers_of(tile: bytes) -> list[Layer]:
    """All layers of a tile; raises ValueError for bytes that are none."""
    try:
        return [_layer(_message(data)) for data in _message(tile)[3]]
    except (
        AttributeError,  # a number where a text belongs
        IndexError,
        KeyError,
        TypeError,
        UnicodeDecodeError,
        struct.error,
    ) as error:
        raise ValueError(f"no vector tile: {error}") from error


def _layer(fields: Mapping[int, Sequence[Any]]) -> Layer:
    keys = [key.decode() for key in fields[3]]
    values = [_value(_message(value)) for value in fields[4]]
    extent = int(fields[5][-1]) if fields[5] else 4096
    if not 0 < extent <= _FARTHEST:
        raise IndexError("its layers have no size")
    features = []
    for feature in map(_message, fields[2]):
        kind = _KINDS.get(feature[3][-1] if feature[3] else 0)
        if kind is not None:
            tags, geometry = (_numbers(feature[n][-1] if feature[n] else b"") for n in (2, 4))
            named = {keys[k]: values[v] for k, v in zip(tags[::2], tags[1::2], strict=False)}
            features.append(Feature(kind, _parts(geometry), named))
    return Layer(fields[1][-1].decode() if fields[1] else "", extent, features)


def _parts(numbers: Sequence[int]) -> list[Part]:
    """Commands of the cursor as points of each part; a polygon's first point is not repeated."""
    parts: list[Part] = []
    at = x = y = 0
    while at < len(numbers):
        kind, count = numbers[at] & 7, numbers[at] >> 3
        at += 1
        if kind == _CLOSE:
            continue
        if 2 * count > len(numbers) - at:
            raise IndexError("a line has fewer points than it states")
        points = numbers[at : at + 2 * count]
        at += 2 * count
        for right, down in zip(points[::2], points[1::2], strict=True):
            x, y = x + _signed(right), y + _signed(down)
            if max(abs(x), abs(y)) > _FARTHEST:
                raise IndexError("a point lies far outside of the tile")
            if kind == _MOVE:
                parts.append([])
            parts[-1].append((x, y))
    return parts


def _value(fields: Mapping[int, Sequence[Any]]) -> Value:
    for number, (value, *_) in fields.items():
        match number:
            case 1:
                return str(value.decode())
            case 2 | 3:
                return float(struct.unpack("<f" if number == 2 else "<d", value)[0])
            case 6:
                return _signed(value)
        return int(value)
    return ""


def _message(data: bytes) -> Mapping[int, list[Any]]:
    fields: defaultdict[int, list[Any]] = defaultdict(list)
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind in {_VARINT, _BYTES}:
            length, at = _varint(data, at)
        else:
            length = {_FIXED64: 8, _FIXED32: 4}[kind]
        if kind == _VARINT:
            fields[key >> 3].append(length)
            continue
        if at + length > len(data):
            raise IndexError("cut short")
        fields[key >> 3].append(data[at : at + length])
        at += length
    return fields


def _numbers(data: bytes) -> list[int]:
    numbers, at = [], 0
    while at < len(data):
        number, at = _varint(data, at)
        numbers.append(number)
    return numbers


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        value, at = value | (byte & 0x7F) << shift, at + 1
        if byte < 0x80:
            return value, at
        shift += 7
        if shift >= _MOST_BITS:
            raise IndexError("a number has more than 64 bit")


def _signed(number: int) -> int:
    return number >> 1 ^ -(number & 1)


_PAPER: Colour = (250, 249, 246)
_AREAS: dict[str, Colour] = {
    "landcover": (232, 240, 224),
    "landuse": (236, 240, 230),
    "park": (214, 232, 205),
    "water": (190, 215, 235),
    "buildings": (218, 213, 206),
    "building": (218, 213, 206),
}
"""In the order in which they are drawn."""
_GREEN = frozenset({"park", "forest", "wood", "grass", "garden", "nature_reserve", "cemetery"})
_DRAWN_STREETS = ("roads", "transportation")
_WATERWAYS = ("waterway", "water")
_WIDE = frozenset({"highway", "motorway", "trunk", "major_road", "primary", "secondary"})
_NARROW = frozenset({"path", "footway", "track", "steps", "cycleway", "other"})
_ROAD: Colour = (150, 146, 140)
_PATH: Colour = (186, 178, 166)


def draw_tile(layers: list[Layer], size: int) -> Image.Image:
    """The layers as RGBA of `size` pixels a side."""
    picture = Image.new("RGBA", (size, size), (*_PAPER, 255))
    draw = ImageDraw.Draw(picture)
    by_name = {layer.name: layer for layer in layers}
    scale = {layer.name: size / max(layer.extent, 1) for layer in layers}
    for name, colour in _AREAS.items():
        for feature in _features(by_name, name, "polygon"):
            _draw_area(draw, scale[name], feature, colour)
    for name in _WATERWAYS:
        for feature in _features(by_name, name, "line"):
            _draw_line(draw, scale[name], feature, _AREAS["water"], size / 170)
    for name in _DRAWN_STREETS:
        for feature in _features(by_name, name, "line"):
            _draw_street(draw, scale[name], feature, size)
    return picture


def _features(by_name: dict[str, Layer], name: str, kind: str) -> list[Feature]:
    layer = by_name.get(name)
    return [feature for feature in layer.features if feature.kind == kind] if layer else []


def _in_pixels(part: Part, scale: float) -> list[Point]:
    return [(x * scale, y * scale) for x, y in part]


def _draw_area(draw: ImageDraw.ImageDraw, scale: float, feature: Feature, colour: Colour) -> None:
    kinds = {str(feature.tags.get(key, "")) for key in ("kind", "class", "subclass", "pmap:kind")}
    fill = _AREAS["park"] if kinds & _GREEN else colour
    for part in feature.parts:
        if len(part) >= 3:
            # a hole runs the other way round (4.3.4.4 of the specification)
            draw.polygon(_in_pixels(part, scale), fill=fill if _area(part) > 0 else _PAPER)


def _area(part: Part) -> float:
    """Twice the signed area; positive for an outer ring, whose y points down."""
    following = [*part[1:], part[0]]
    return float(sum(x * v - u * y for (x, y), (u, v) in zip(part, following, strict=True)))


def _draw_street(draw: ImageDraw.ImageDraw, scale: float, feature: Feature, size: int) -> None:
    kinds = {str(feature.tags.get(key, "")) for key in ("kind", "class", "kind_detail")}
    is_path = bool(kinds & _NARROW)
    width = size / 400 if is_path else size / 200
    if kinds & _WIDE:
        width = size / 110
    _draw_line(draw, scale, feature, _PATH if is_path else _ROAD, width)


def _draw_line(
    draw: ImageDraw.ImageDraw, scale: float, feature: Feature, colour: Colour, width: float
) -> None:
    for part in feature.parts:
        if len(part) >= 2:
            ink_width = max(round(width), 1)
            draw.line(_in_pixels(part, scale), fill=colour, width=ink_width, joint="curve")


_NAMED_STREETS = frozenset({"roads", "transportation_name"})
"""Layers of Protomaps and OpenMapTiles."""
_NEAR_M = 100.0
"""A position farther from every named street is not at one of them."""


def street_near(layers: Sequence[Layer], place: Point, tile_m: float) -> str | None:
    """Name of the nearest street within 100 m of a place, given as shares of the tile."""
    distances = [
        (_distance(layer, part, place) * tile_m, name)
        for layer in layers
        for name, part in _named_parts(layer)
    ]
    distance_m, name = min(distances, default=(math.inf, None))
    return name if distance_m <= _NEAR_M else None


def _named_parts(layer: Layer) -> Iterator[tuple[str, Part]]:
    if layer.name in _NAMED_STREETS:
        for feature in layer.features:
            name = feature.tags.get("name")
            if feature.kind == "line" and isinstance(name, str) and name:
                yield from ((name, part) for part in feature.parts)


def _distance(layer: Layer, part: Part, place: Point) -> float:
    """From a place in a tile to a line of it, both as shares of the tile."""
    points = [(x / layer.extent, y / layer.extent) for x, y in part]
    line = shapely.LineString(points) if len(points) > 1 else shapely.MultiPoint(points)
    return float(line.distance(shapely.Point(place))) if points else math.inf


# --- maps of tiles ---

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
    """Pixels (rows, columns, 4) from a corner, its west and north, in metres of Web Mercator."""

    pixels: npt.NDArray[np.uint8]
    west_m: float
    north_m: float
    pixel_width_m: float
    pixel_height_m: float

    def pixel_at(self, area: Area) -> tuple[FloatArray, FloatArray]:
        """Column and row, whole in the middle of a pixel, of each point of the area's mesh."""
        x_m, y_m = area.web_mercator_m
        column = (x_m - self.west_m) / self.pixel_width_m - 0.5
        return column, (self.north_m - y_m) / self.pixel_height_m - 0.5


def ground_of(
    zooms: range, area: Area, picture_at: Callable[[int, range, range], TilePicture]
) -> Ground | None:
    """Tiles that cover an area, of the finest of these levels that needs at most `MOST_TILES`.

    `picture_at` gives the pictures of the tiles in these columns and rows of a level.
    """
    x_m, y_m = area.web_mercator_m
    for zoom in zooms:
        side_m = 2.0 * _HALF_WORLD_M / 2**zoom
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
    west_m = columns[0] * side_m - _HALF_WORLD_M
    north_m = _HALF_WORLD_M - rows[0] * side_m
    return Ground(np.asarray(image), west_m, north_m, side_m / width, side_m / height)


@contextmanager
def _mbtiles(path: Path) -> Iterator[sqlite3.Connection]:
    try:
        with open_database(path, views=True) as database:
            yield database
    except sqlite3.Error as error:
        raise ConfigError(f"{path} is no MBTiles file with raster tiles: {error}") from error
    except ValueError as error:
        raise ConfigError(f"{path}: {error} (vector tiles are read from PMTiles)") from error
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror or error}") from error


def open_mbtiles(path: Path, area: Area) -> Ground | None:
    """The tiles of a file that cover an area; raises `ConfigError`."""
    with _mbtiles(path) as database:
        from_south = database.execute(_IS_XYZ).fetchone() is None

        def picture_at(zoom: int, *_: range) -> TilePicture:
            def picture(column: int, row: int) -> Image.Image | None:
                stored = 2**zoom - 1 - row if from_south else row
                tile = database.execute(_TILE, (zoom, column, stored)).fetchone()
                return None if tile is None else tile_picture(tile[0])

            return picture

        return ground_of(range(FINEST, -1, -1), area, picture_at)


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
    return begins_with(path, _MAGIC)


def open_pmtiles(path: Path, area: Area) -> Ground | None:
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

        return ground_of(archive.zooms, area, picture_at)


def street_at(path: Path, at: OnMap) -> str | None:
    """Name of the nearest street, by the finest vector tile there.

    None without one near, and for other kinds of files. Raises `ConfigError` for a file that cannot
    be read.
    """
    if not is_pmtiles(path):
        return None
    with _archive(path) as archive:
        for zoom in archive.zooms if archive.is_vector else ():
            x, y = _web_mercator(at.lat, at.lon, zoom)
            data = archive.tile(zoom, int(x), int(y))
            if data is not None:
                tile_m = _EQUATOR_M * math.cos(math.radians(at.lat)) / 2**zoom
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


# --- the picture ---

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

    def on_paper(self, paper: Colour, opacity: float = 1.0) -> Pixels:
        """On paper of a colour, shape (rows, columns, 3)."""
        alpha = opacity * self.pixels[..., 3:] / 255.0
        rgb = self.pixels[..., :3] * alpha + np.array(paper) * (1.0 - alpha)
        return np.asarray(np.rint(rgb), np.uint8)

    def jpeg(self, paper: Colour, opacity: float = 1.0) -> bytes:
        """As `on_paper`."""
        file = BytesIO()
        Image.fromarray(self.on_paper(paper, opacity)).save(file, "JPEG", quality=_QUALITY)
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
    pixels = _resample(ground, area, box.shape(pixel_m))
    if not np.any(pixels[..., 3]):
        raise ConfigError(f"{path} does not cover the area of this walk")
    return Basemap(pixels, box)


def ground_under(
    path: Path | None, survey: Survey, plan: Box | None, most_pixels: int = MOST_PIXELS
) -> Basemap | None:
    """As `read_basemap`; a line on stderr where that fails."""
    if path is None:
        return None
    try:
        ground = read_basemap(path, survey, plan, most_pixels)
        why = "the walk has no position"
    except ConfigError as error:
        ground, why = None, str(error)
    if ground is None:
        sys.stderr.write(printable(f"{path} is not drawn: {why}") + "\n")
    return ground


def open_ground(path: Path, area: Area) -> Ground:
    """What a file has of an area; raises `ConfigError` for one that cannot be read."""
    check_basemap(path)
    ground = open_mbtiles(path, area) if is_sqlite(path) else open_pmtiles(path, area)
    if ground is None:
        raise ConfigError(f"{path} does not cover the area of this walk")
    return ground


def check_basemap(path: Path | None) -> None:
    """Raise `ConfigError` for a file that is no map."""
    if path is None:
        return
    if not path.is_file():
        raise ConfigError(f"{path}: no such file")
    if is_sqlite(path):
        with _mbtiles(path) as database:
            database.execute("SELECT 1 FROM tiles LIMIT 1")
    elif is_pmtiles(path):
        with _archive(path):
            pass
    else:
        raise ConfigError(
            f"{path} is neither PMTiles nor MBTiles; GDAL makes MBTiles of a picture with a "
            "position: gdal_translate -of MBTILES PICTURE map.mbtiles"
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
