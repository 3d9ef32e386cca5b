import gzip
import struct
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from pmtiles.tile import Compression, TileType
from pyproj import CRS

from logger.core.errors import ConfigError
from postproc.basemap import Area, draw_tile, is_pmtiles, layers_of, open_ground, open_pmtiles
from tests.kit.vector_tiles import feature, layer, tile_at, write_pmtiles

LAT, LON = 52.5, 13.4


def _area(size_m=200.0):
    x, y = 391_000.0, 5_818_000.0
    grid = np.meshgrid(np.linspace(x, x + size_m, 5), np.linspace(y + size_m, y, 5))
    return Area(CRS.from_epsg(32633), np.stack(grid), 0.2)


def _places(zoom):
    column, row = tile_at(LAT, LON, zoom)
    return [(zoom, column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]


def _png(colour):
    file = BytesIO()
    Image.new("RGB", (64, 64), colour).save(file, "PNG")
    return file.getvalue()


def test_pictures_of_the_finest_level(tmp_path):
    tiles = {place: _png((200, 40, 40)) for place in _places(12)}
    tiles |= {place: _png((40, 40, 200)) for place in _places(15)}
    path = write_pmtiles(tmp_path / "x.pmtiles", tiles, TileType.PNG)
    ground = open_pmtiles(path, _area())
    assert is_pmtiles(path)
    assert tuple(ground.pixels[5, 5]) == (40, 40, 200, 255)


def test_directories_may_be_without_compression(tmp_path):
    tiles = {place: _png((40, 40, 200)) for place in _places(15)}
    path = write_pmtiles(tmp_path / "x.pmtiles", tiles, TileType.PNG)
    data = bytearray(path.read_bytes())
    at, length = struct.unpack_from("<QQ", data, 8)
    root = gzip.decompress(data[at : at + length])
    struct.pack_into("<QQ", data, 8, len(data), len(root))
    data[97] = Compression.NONE.value  # of the directories
    path.write_bytes(data + root)
    assert tuple(open_pmtiles(path, _area()).pixels[5, 5]) == (40, 40, 200, 255)


def test_vector_tiles_are_drawn(tmp_path):
    streets = layer("roads", [feature("line", [[(x, 0), (x, 4096)]]) for x in range(0, 4096, 99)])
    path = write_pmtiles(tmp_path / "x.pmtiles", dict.fromkeys(_places(14), streets))
    assert open_pmtiles(path, _area()).pixels[..., 0].std() > 5.0


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"PMTiles\x03", "cannot be read"),
        (b"PMTiles\x03" + b"\xff" * 400, "cannot be read"),
    ],
)
def test_a_damaged_file_is_an_error(tmp_path, data, says):
    (tmp_path / "x.pmtiles").write_bytes(data)
    with pytest.raises(ConfigError, match=says):
        open_pmtiles(tmp_path / "x.pmtiles", _area())


def test_damaged_tiles_are_an_error(tmp_path):
    tiles = dict.fromkeys(_places(14), b"\x1a\xff")
    path = write_pmtiles(tmp_path / "x.pmtiles", tiles)
    with pytest.raises(ConfigError, match="no vector tile"):
        open_pmtiles(path, _area())
    pictures = dict.fromkeys(_places(14), gzip.compress(b"x"))
    path = write_pmtiles(tmp_path / "y.pmtiles", pictures, TileType.PNG)
    with pytest.raises(ConfigError, match="no picture"):
        open_pmtiles(path, _area())


def test_a_place_without_tiles_is_an_error(tmp_path):
    path = write_pmtiles(tmp_path / "x.pmtiles", {(14, 1, 1): layer("roads", [])})
    assert open_pmtiles(path, _area()) is None
    with pytest.raises(ConfigError, match="does not cover"):
        open_ground(path, _area())


SQUARE = [(0, 0), (2000, 0), (2000, 2000), (0, 2000)]
HOLE = [(500, 500), (500, 1500), (1500, 1500), (1500, 500)]


def test_water_with_an_island_and_a_street(tmp_path):
    street = feature("line", [[(3000, 0), (3000, 4096)]], [0, 0])
    tile = layer("water", [feature("polygon", [SQUARE, HOLE])])
    tile += layer("roads", [street], ["kind"], ["major_road"])
    picture = draw_tile(layers_of(tile), 512)
    paper = picture.getpixel((450, 400))
    assert picture.getpixel((30, 30)) != paper  # water
    assert picture.getpixel((125, 125)) == paper  # the island
    assert picture.getpixel((375, 300)) not in {paper, picture.getpixel((30, 30))}


def test_layers_of_another_schema_and_unknown_ones():
    tile = layer("transportation", [feature("line", [[(0, 2048), (4096, 2048)]])])
    tile += layer("somewhere", [feature("point", [[(1, 1)]])])
    picture = draw_tile(layers_of(tile), 256)
    assert picture.getpixel((128, 128)) != picture.getpixel((128, 20))
