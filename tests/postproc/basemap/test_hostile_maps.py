"""Maps made to hurt: each ends in a sentence, in little memory."""

import gzip
import sqlite3
import struct
import zlib
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image, PngImagePlugin
from pmtiles.tile import TileType

from logger.core.certainty import OnMap
from logger.core.errors import ConfigError
from postproc.basemap import open_ground, street_at
from tests.fuzz.fuzz_foreign import LAT, LON, area, places, png, streets
from tests.kit.own_memory import run_alone
from tests.kit.vector_tiles import field, layer, number, varint, write_pmtiles

MORE_MB = 300
AROUND, HERE = area(), OnMap(lat=LAT, lon=LON)


def read_map(arguments):
    """Print what becomes of a map: for the ground, and for the streets."""
    path = Path(arguments[0])
    for use in (lambda: open_ground(path, AROUND), lambda: street_at(path, HERE)):
        try:
            use()
            print("read")
        except ConfigError as error:
            print(error)


def _pmtiles(path, **changed):
    """A sound file with numbers of its header, by their place, changed."""
    write_pmtiles(path, dict.fromkeys(places(14), streets()))
    data = bytearray(path.read_bytes())
    for name, value in changed.items():
        struct.pack_into("<Q", data, int(name.removeprefix("at_")), value)
    path.write_bytes(data)


def _directory(path, numbers):
    """A file with this root directory."""
    _pmtiles(path)
    root = gzip.compress(numbers)
    data = bytearray(path.read_bytes())
    struct.pack_into("<QQ", data, 8, len(data), len(root))
    path.write_bytes(bytes(data) + root)


def _tile(path, data):
    write_pmtiles(path, dict.fromkeys(places(14), data))


def _geometry(numbers):
    """A layer with one line of these numbers."""
    packed = b"".join(map(varint, numbers))
    return layer("roads", [number(3, 2) + field(4, packed)])


def _large_png(width, height, mode="L"):
    file = BytesIO()
    Image.new(mode, (width, height)).save(file, "PNG")
    return file.getvalue()


def _bomb_png():
    """A head that claims 60,000 pixels a side."""
    head = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 6, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(b"\0" * 10_000_000)), (b"IEND", b""))
    chunks = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def _text_png():
    info = PngImagePlugin.PngInfo()
    info.add_text("x", "0" * 90_000_000, zip=True)
    file = BytesIO()
    Image.new("L", (64, 64)).save(file, "PNG", pnginfo=info)
    return file.getvalue()


def _pictures(path, data):
    write_pmtiles(path, dict.fromkeys(places(14), data), TileType.PNG)


PMTILES = {
    "root longer than the file": lambda path: _pmtiles(path, at_16=1 << 40),
    "root beyond the file": lambda path: _pmtiles(path, at_8=1 << 62),
    "tiles beyond the file": lambda path: _pmtiles(path, at_56=1 << 62),
    "entries claimed": lambda path: _directory(path, varint(1 << 31) + b"\1" * 8),
    "entries packed": lambda path: _directory(path, varint(30_000_000) + b"\1" * 120_000_000),
    "a run of all tiles": lambda path: _directory(
        path, varint(1) + b"\0" + varint(1 << 60) + varint(1 << 40) + b"\1"
    ),
    "a long number": lambda path: _directory(path, b"\xff" * 1_000_000 + b"\1"),
    "a loop of leaves": lambda path: _directory(path, b"\1\0\0\x40\1"),
    "a tile packed": lambda path: _tile(path, b"\0" * 300_000_000),
    "points claimed": lambda path: _tile(path, _geometry([9, 2, 2, 2 | 1 << 31])),
    "a point far away": lambda path: _tile(path, _geometry([9, 1 << 60, 2])),
    "a layer without size": lambda path: _tile(path, field(3, number(5, 0))),
    "a layer of huge size": lambda path: _tile(path, field(3, number(5, 1 << 62))),
    "a long number in a tile": lambda path: _tile(path, b"\x1a" + b"\xff" * 3_000_000),
    "a number for a text": lambda path: _tile(path, field(3, number(1, 7))),
    "a large picture": lambda path: _pictures(path, _large_png(9000, 9000)),
    "a picture that claims": lambda path: _pictures(path, _bomb_png()),
    "a text in a picture": lambda path: _pictures(path, _text_png()),
    "PostScript": lambda path: _pictures(
        path, b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n"
    ),
    "no level": lambda path: path.write_bytes(b"PMTiles\3" + b"\xff" * 400),
}


@pytest.mark.parametrize("name", PMTILES)
def test_pmtiles_are_refused(tmp_path, name):
    PMTILES[name](tmp_path / "x.pmtiles")
    said, more_mb = _read(tmp_path / "x.pmtiles")
    assert "cannot be read" in said[0]
    assert more_mb < MORE_MB, f"{more_mb} MB"


def _read(path):
    done = run_alone(f"{__name__}:read_map", path)
    return done.out.splitlines(), done.more_mb


def test_what_follows_a_packed_directory_is_not_unpacked(tmp_path):
    path = tmp_path / "x.pmtiles"
    _pmtiles(path)
    data = bytearray(path.read_bytes())
    at, length = struct.unpack_from("<QQ", data, 8)
    root = bytes(data[at : at + length]) + gzip.compress(bytes(400_000_000))
    struct.pack_into("<QQ", data, 8, len(data), len(root))
    path.write_bytes(data + root)
    said, more_mb = _read(path)
    assert said == ["read", "read"]
    assert more_mb < MORE_MB, f"{more_mb} MB"


def test_the_most_points_of_a_tile_take_little_memory(tmp_path):
    points = [9, 0, 0] + [2 | 100_000 << 3, *[2, 1] * 100_000] * 9
    _tile(tmp_path / "x.pmtiles", _geometry(points))
    said, more_mb = _read(tmp_path / "x.pmtiles")
    assert said == ["read", "read"] or "cannot be read" in said[0]
    assert more_mb < MORE_MB, f"{more_mb} MB"


def _mbtiles(path, tile, zoom=14):
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE metadata (name, value)")
        database.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data)")
        rows = [(zoom, x, 2**14 - 1 - y, tile) for _, x, y in places(14)]
        database.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", rows)
    database.close()


@pytest.mark.parametrize(
    "tile", [b"x", None, 7, _large_png(9000, 9000), _bomb_png(), b"\x89PNG" * 2_000_000]
)
def test_mbtiles_are_refused(tmp_path, tile):
    _mbtiles(tmp_path / "x", tile)
    said, more_mb = _read(tmp_path / "x")
    assert str(tmp_path / "x") in said[0]
    assert more_mb < MORE_MB, f"{more_mb} MB"


@pytest.mark.parametrize("zoom", ["x", None, 1e300, -5, 2**40, b"\0"])
def test_levels_that_are_none_cover_nothing(tmp_path, zoom):
    _mbtiles(tmp_path / "x", png(), zoom)
    assert "does not cover" in _read(tmp_path / "x")[0][0]
