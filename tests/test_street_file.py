import json

import pytest

from logger.core.errors import ConfigError
from logger.street_file import read_lines

LINE = [[13.4, 52.5, 34.0], [13.41, 52.5]]


def _write(tmp_path, text):
    path = tmp_path / "streets"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "geometry",
    [
        {"type": "LineString", "coordinates": LINE},
        {"type": "MultiLineString", "coordinates": [LINE]},
        {
            "type": "GeometryCollection",
            "geometries": [{"type": "LineString", "coordinates": LINE}],
        },
    ],
)
def test_reads_lines_of_geojson(tmp_path, geometry):
    feature = {"type": "Feature", "geometry": geometry, "properties": {}}
    point = {"type": "Feature", "geometry": {"type": "Point", "coordinates": [0, 0]}}
    nothing = {"type": "Feature", "geometry": None}
    collection = {"type": "FeatureCollection", "features": [feature, point, nothing]}
    for document in (collection, feature, geometry):
        lines = list(read_lines(_write(tmp_path, json.dumps(document))))
        assert lines == [[(52.5, 13.4), (52.5, 13.41)]]


def test_reads_tracks_and_routes_of_gpx(tmp_path):
    gpx = (
        '<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1">'
        '<trk><trkseg><trkpt lat="52.5" lon="13.4"><ele>3</ele></trkpt>'
        '<trkpt lat="52.6" lon="13.4"/></trkseg></trk>'
        '<rte><name>r</name><rtept lat="1" lon="2"/><rtept lat="1" lon="3"/></rte>'
        '<wpt lat="5" lon="5"/></gpx>'
    )
    lines = list(read_lines(_write(tmp_path, gpx)))
    assert lines == [[(52.5, 13.4), (52.6, 13.4)], [(1.0, 2.0), (1.0, 3.0)]]


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"type": "LineString", "coordinates": LINE}),
        '<gpx><rte><rtept lat="52.5" lon="13.4"/><rtept lat="52.5" lon="13.41"/></rte></gpx>',
    ],
)
def test_a_byte_order_mark_changes_nothing(tmp_path, text):
    assert list(read_lines(_write(tmp_path, "\ufeff" + text))) == [[(52.5, 13.4), (52.5, 13.41)]]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[1, 2]",
        "<gpx><trk>",
        '{"type": "LineString", "coordinates": [[13.4, 95.0], [13.4, 52.0]]}',
        '{"type": "LineString", "coordinates": [[null, 52.0], [13.4, 52.0]]}',
        '{"type": "LineString"}',
        '{"features": 3}',
        '<gpx><rte><rtept lat="a" lon="1"/><rtept lat="1" lon="1"/></rte></gpx>',
    ],
)
def test_anything_else_is_one_line(tmp_path, text):
    with pytest.raises(ConfigError, match="streets"):
        read_lines(_write(tmp_path, text))


def test_a_missing_file_is_one_line(tmp_path):
    with pytest.raises(ConfigError, match="No such file"):
        read_lines(tmp_path / "none")
