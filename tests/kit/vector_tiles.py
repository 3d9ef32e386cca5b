"""Vector tiles of a few features, written by the specification, in a PMTiles file."""

import gzip
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import Writer

EXTENT = 4096
KINDS = {"point": 1, "line": 2, "polygon": 3}

Part = Sequence[tuple[int, int]]


def tile_at(lat_deg: float, lon_deg: float, zoom: int) -> tuple[int, int]:
    """Column and row of the tile that contains a position."""
    count, lat = 2**zoom, math.radians(lat_deg)
    row = (1.0 - math.asinh(math.tan(lat)) / math.pi) / 2.0
    return int((lon_deg + 180.0) / 360.0 * count), int(row * count)


def feature(kind: str, parts: Iterable[Part], tags: Sequence[int] = ()) -> bytes:
    """A feature; `tags` are pairs of indices of keys and values."""
    numbers: list[int] = []
    x = y = 0
    for part in parts:
        for i, (u, v) in enumerate(part):
            if i < 2:
                count = 1 if i == 0 else len(part) - 1
                numbers.append((1 if i == 0 else 2) | count << 3)
            numbers += [_zigzag(u - x), _zigzag(v - y)]
            x, y = u, v
        if kind == "polygon":
            numbers.append(7 | 1 << 3)
    packed = b"".join(map(varint, tags)), b"".join(map(varint, numbers))
    return field(2, packed[0]) + number(3, KINDS[kind]) + field(4, packed[1])


def layer(
    name: str, features: Iterable[bytes], keys: Sequence[str] = (), values: Sequence[str] = ()
) -> bytes:
    """A layer of a tile, with text values."""
    return field(
        3,
        field(1, name.encode())
        + b"".join(field(2, one) for one in features)
        + b"".join(field(3, key.encode()) for key in keys)
        + b"".join(field(4, field(1, value.encode())) for value in values)
        + number(5, EXTENT)
        + number(15, 2),
    )


def write_pmtiles(
    path: Path, tiles: dict[tuple[int, int, int], bytes], kind: TileType = TileType.MVT
) -> Path:
    """A file with tiles by zoom, column and row."""
    zooms = [zoom for zoom, _, _ in tiles]
    is_vector = kind == TileType.MVT
    packed = {tile: gzip.compress(tile) if is_vector else tile for tile in set(tiles.values())}
    with path.open("wb") as file:
        writer = Writer(file)
        for place in sorted(tiles, key=lambda place: zxy_to_tileid(*place)):
            writer.write_tile(zxy_to_tileid(*place), packed[tiles[place]])
        world = {"min_lon_e7": -1_800_000_000, "min_lat_e7": -850_000_000}
        world |= {"max_lon_e7": 1_800_000_000, "max_lat_e7": 850_000_000}
        compression = Compression.GZIP if is_vector else Compression.NONE
        header = {"tile_type": kind, "tile_compression": compression}
        header |= {"min_zoom": min(zooms), "max_zoom": max(zooms), "center_zoom": 0}
        writer.finalize(header | world | {"center_lon_e7": 0, "center_lat_e7": 0}, {})
    return path


def _zigzag(number: int) -> int:
    return number << 1 if number >= 0 else -number * 2 - 1


def varint(value: int) -> bytes:
    data = b""
    while value > 0x7F:
        data, value = data + bytes([value & 0x7F | 0x80]), value >> 7
    return data + bytes([value])


def number(key: int, value: int) -> bytes:
    return varint(key << 3) + varint(value)


def field(key: int, data: bytes) -> bytes:
    return varint(key << 3 | 2) + varint(len(data)) + data
