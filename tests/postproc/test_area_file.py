import json

import pytest

from logger.core.errors import ConfigError
from postproc.area_file import area_of, read_area

RING = [[13.0, 52.0], [13.1, 52.0], [13.1, 52.1], [13.0, 52.0]]
CROSSED = [[13.0, 52.0], [13.1, 52.1], [13.1, 52.0], [13.0, 52.1], [13.0, 52.0]]
SQUARE = {"type": "Polygon", "coordinates": [RING]}


def feature(geometry):
    return {"type": "Feature", "properties": {"name": "a"}, "geometry": geometry}


@pytest.fixture
def write(tmp_path):
    def write_block(content):
        text = content if isinstance(content, str) else json.dumps(content)
        (tmp_path / "block.geojson").write_text(text)
        return tmp_path / "block.geojson"

    return write_block


@pytest.mark.parametrize(
    ("content", "count"),
    [
        (SQUARE, 1),
        (feature(SQUARE), 1),
        ({"type": "MultiPolygon", "coordinates": [[RING], [RING, RING]]}, 2),
        ({"type": "FeatureCollection", "features": [feature(SQUARE), feature(None)]}, 1),
        ({"type": "GeometryCollection", "geometries": [SQUARE, SQUARE]}, 2),
    ],
)
def test_polygons_are_read_wherever_they_stand(write, content, count):
    area = read_area(write(content))
    assert area.text == "inside block.geojson"
    assert len(area.polygons) == count
    assert area.polygons[0][0][1] == (13.1, 52.0)


def test_heights_are_passed_over(write):
    with_height = [[*point, 100.0] for point in RING]
    area = read_area(write({"type": "Polygon", "coordinates": [with_height]}))
    assert area.polygons[0][0][0] == (13.0, 52.0)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("", "is no GeoJSON with polygons"),
        ("{}", "is no GeoJSON with polygons"),
        ("[" * 100_000, "is no GeoJSON with polygons"),
        ({"type": "Polygon"}, "is no GeoJSON with polygons"),
        ({"type": "Polygon", "coordinates": [[[1]]]}, "is no GeoJSON with polygons"),
        ({"type": "FeatureCollection", "features": []}, "has no polygon"),
        ({"type": "Point", "coordinates": [13.0, 52.0]}, "a Point is no area: use a Polygon"),
        ({"type": "Polygon", "coordinates": [RING[:2]]}, "at least three corners"),
        ({"type": "Polygon", "coordinates": [[[0, 91], [1, 92], [2, 90]]]}, "latitude"),
        ({"type": "MultiPolygon", "coordinates": [[]]}, "no ring"),
        ({"type": "Polygon", "coordinates": [CROSSED]}, "crosses itself"),
        ({"type": "Polygon", "coordinates": [RING * 6000]}, "24000 corners, of which 20000"),
    ],
)
def test_what_is_no_area_is_refused_in_one_line(write, content, why):
    with pytest.raises(ConfigError, match=why) as error:
        read_area(write(content))
    assert "\n" not in str(error.value)
    assert "block.geojson" in str(error.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"none.geojson: No such file"):
        area_of(None, tmp_path / "none.geojson")


def test_an_area_is_metres_or_a_file():
    assert area_of(None, None) is None
    assert area_of(300.0, None).text == "within 300 m of the walk"
    with pytest.raises(ConfigError, match="not allowed with"):
        area_of(300.0, "block.geojson")
    with pytest.raises(ConfigError, match="there is no place"):
        area_of(-1.0, None)
