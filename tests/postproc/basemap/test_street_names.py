import pytest
from pmtiles.tile import TileType

from logger.core.certainty import OnMap
from logger.core.errors import ConfigError
from postproc.basemap import street_at
from tests.kit.vector_tiles import feature, layer, tile_at, write_pmtiles

LAT, LON = 52.5, 13.4
ZOOM = 15

HERE = OnMap(lat=LAT, lon=LON)


def _file(path, data):
    return write_pmtiles(path, {(ZOOM, *tile_at(LAT, LON, ZOOM)): data})


def _street(x, y, *, name):
    """A street from west to east through a point of the tile."""
    line = feature("line", [[(x - 300, y), (x + 300, y)]], [0, 0] if name else [])
    return layer("roads", [line], ["name"], [name])


def _place():
    """The position in the units of its tile."""
    column, row = tile_at(LAT, LON, ZOOM + 12)
    return column % 4096, row % 4096


def test_the_nearest_street_that_has_a_name(tmp_path):
    x, y = _place()
    data = _street(x, y + 40, name="Nahe Straße") + _street(x, y - 60, name="Ferne Straße")
    path = _file(tmp_path / "x.pmtiles", data + _street(x, y + 1, name=""))
    assert street_at(path, HERE) == "Nahe Straße"


def test_streets_are_near_within_100_m(tmp_path):
    x, y = _place()
    units = 4096 / 744.5  # a metre at this latitude
    for metres, name in ((95, "x"), (105, None)):
        street = _street(x, y - round(metres * units), name="x")
        assert street_at(_file(tmp_path / f"{metres}.pmtiles", street), HERE) == name


def test_files_without_names(tmp_path):
    picture = {(ZOOM, *tile_at(LAT, LON, ZOOM)): b"x"}
    path = write_pmtiles(tmp_path / "x.pmtiles", picture, TileType.PNG)
    assert street_at(path, HERE) is None
    assert street_at(path, OnMap(lat=0.0, lon=0.0)) is None
    (tmp_path / "x.png").write_bytes(b"\x89PNG")
    assert street_at(tmp_path / "x.png", HERE) is None


def test_a_damaged_tile_is_an_error(tmp_path):
    with pytest.raises(ConfigError, match="no vector tile"):
        street_at(_file(tmp_path / "x.pmtiles", b"\x1a\xff"), HERE)
