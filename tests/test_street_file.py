import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from logger.core.errors import ConfigError
from logger.device.memory import _STREETS_MB
from logger.street_file import MOST_BYTES, MOST_POINTS, read_lines

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


LINE_TEXT = "[[13.4, 52.5], [13.41, 52.5]]"
RTE = '<rte><rtept lat="1" lon="2"/><rtept lat="1" lon="3"/></rte>'


def _string(coordinates):
    return f'{{"type": "LineString", "coordinates": {coordinates}}}'


def _nest(n):
    start = '{"type": "GeometryCollection", "geometries": ['
    return start * n + _string(LINE_TEXT) + "]}" * n


HOSTILE = {
    "collections in each other": _nest(700),
    "lists in each other": "[" * 100_000,
    "objects in each other": '{"a":' * 100_000,
    "400 digits": _string(f"[[13.4, 52.5], [{'1' * 400}, 52.5]]"),
    "a million digits": _string(f"[[13.4, 52.5], [{'1' * 1_000_000}, 52.5]]"),
    "infinity": _string("[[13.4, 52.5], [1e999, 52.5]]"),
    "no number": _string("[[13.4, 52.5], [NaN, 52.5]]"),
    "an object among points": _string('[[13.4, 52.5], {"x": 1}]'),
    "a long text": f'{{"x": "{"a" * 1_000_000}", "y": {_string(LINE_TEXT)}}}',
    "a text of escapes": f'{{"x": "{chr(92) * 1_000_000}", "y": {_string(LINE_TEXT)}}}',
    "cut": json.dumps({"type": "LineString", "coordinates": LINE})[:-2],
    "the wrong bracket": '{"a": [1}]',
    "a bracket too many": _string(LINE_TEXT) + "}",
    "entities": '<!DOCTYPE g [<!ENTITY a "b">]><gpx><name>&a;</name></gpx>',
    "a file of the system": '<!DOCTYPE g [<!ENTITY a SYSTEM "file:///etc/passwd">]><gpx/>',
    "elements in each other": "<gpx>" + "<a>" * 100_000,
    "a long attribute": f'<gpx><rte a="{"x" * 1_000_000}">{RTE}</rte></gpx>',
    "a long comment": f"<gpx><!--{'x' * 1_000_000}-->{RTE}</gpx>",
    "400 digits in GPX": f'<gpx><rte><rtept lat="{"1" * 400}" lon="1"/></rte></gpx>',
    "no number in GPX": '<gpx><rte><rtept lat="nan" lon="1"/></rte></gpx>',
    "no longitude": '<gpx><rte><rtept lat="1"/><rtept lat="1"/></rte></gpx>',
    "UTF-7": '<?xml version="1.0" encoding="UTF-7"?>+ADw-gpx/+AD4-',
    "rot13": '<?xml version="1.0" encoding="rot13"?><gpx/>',
    "NUL": "\0" * 1000,
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_file_is_one_line(tmp_path, text):
    with pytest.raises(ConfigError, match="streets"):
        read_lines(_write(tmp_path, text))


def test_what_never_ends_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for path in (tmp_path / "pipe", tmp_path / "loop", tmp_path, Path("/dev/zero")):
        with pytest.raises(ConfigError, match=re.escape(str(path))):
            read_lines(path)


def _rows(n_points):
    """So many points in lines of 50."""
    line = ", ".join(f"[{13.4 + 1e-4 * k:.4f}, 52.5]" for k in range(50))
    return ", ".join(_string(f"[{line}]") for _ in range(n_points // 50))


def test_a_file_that_is_too_large_says_what_fits(tmp_path):
    features = '{{"type": "FeatureCollection", "features": [{}]}}'
    fits = read_lines(_write(tmp_path, features.format(_rows(MOST_POINTS))))
    assert fits.n_points == MOST_POINTS
    blank = features.format(_rows(50)) + " " * MOST_BYTES
    for text in (features.format(_rows(MOST_POINTS + 50)), blank):
        with pytest.raises(ConfigError, match=r"at most 32 MB and 500000 points; cut out"):
            read_lines(_write(tmp_path, text))


PROGRAM = """
import re, sys
from pathlib import Path
from logger.core.places import Utm
from logger.core.guidance.street_atlas import StreetAtlas
from logger.device.memory import give_back
from logger.street_file import read_lines
give_back()
Utm.at(52.5, 13.4).to_xy(52.5, 13.4)
def peak_mb():
    return int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) / 1024
before_mb = peak_mb()
lines = read_lines(Path(sys.argv[1]))
assert StreetAtlas(lines).near_densest() is not None
print(peak_mb() - before_mb)
"""


def test_the_largest_file_takes_little_memory(tmp_path):
    """30 MB of buildings and streets, in which a map has as many streets as one may have."""
    tags = json.dumps({f"tag {k}": "a text as maps have them" for k in range(5)})
    lines = []
    for k in range(90_000):
        lon_deg, lat_deg = 13.4 + (k % 300) * 3e-4, 52.5 + (k // 300) * 1.5e-4
        line = [[round(lon_deg + d, 6), round(lat_deg + d / 3, 6)] for d in (0.0, 1e-4, 2e-4)]
        geometry = json.dumps({"type": "LineString", "coordinates": line})
        lines.append(f'{{"type": "Feature", "properties": {tags}, "geometry": {geometry}}}')
    path = _write(tmp_path, f'{{"type": "FeatureCollection", "features": [{",".join(lines)}]}}')
    assert 25e6 < path.stat().st_size < MOST_BYTES
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, path], capture_output=True, text=True, check=True
    )
    assert float(process.stdout) < _STREETS_MB


LINE_OBJECT = f'{{"coordinates": {LINE_TEXT}, "type": "LineString"}}'


@pytest.mark.parametrize(
    "text",
    [
        LINE_OBJECT,
        (
            f'{{"bbox": [13.4, 52.5, 13.5, 52.6], "geometry": {LINE_OBJECT}, "type": "Feature",'
            '"properties": {"a": {"b": [1, 2]}}}'
        ),
        '{"type": "LineString", "coordinates": [[13.4,52.5 ] ,\n[ 13.41, 52.5, null]]}',
        (
            '{"features": [{"type": "Polygon", "coordinates": [[[0, 0], [1, 1], [0, 0]]]},'
            f'{{"geometry": {LINE_OBJECT}}}]}}'
        ),
        (
            '{"properties": {"geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 1]]}},'
            f'"geometry": {LINE_OBJECT}}}'
        ),
    ],
    ids=["type last", "bbox", "blanks", "a building", "a line in the properties"],
)
def test_the_order_of_members_and_what_else_there_is_do_not_matter(tmp_path, text):
    assert list(read_lines(_write(tmp_path, text))) == [[(52.5, 13.4), (52.5, 13.41)]]


def test_a_file_is_the_same_wherever_its_parts_end(tmp_path):
    line = _string(LINE_TEXT)
    for spaces in range(65_400, 65_620, 3):
        text = f'{{"features": [{" " * spaces}{{"name": "a {chr(92)}" b", "geometry": {line}}}]}}'
        assert list(read_lines(_write(tmp_path, text))) == [[(52.5, 13.4), (52.5, 13.41)]]
