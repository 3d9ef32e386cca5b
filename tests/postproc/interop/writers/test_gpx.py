from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree as ET

import gpxpy
import pytest
import xmlschema

from postproc.interop.exporting import write_answers
from postproc.interop.writers import gpx
from tests.postproc.interop import walks


@pytest.fixture(scope="module")
def schema():
    """The schema of Topografix, which gpx brings along."""
    (folder,) = find_spec("gpx").submodule_search_locations
    return xmlschema.XMLSchema(Path(folder) / "gpx.xsd")


def test_valid_and_read_by_gpxpy(tmp_path, schema):
    _, walk, _ = walks.around_a_square(tmp_path)
    gpx.write(walk, tmp_path / "w.gpx")
    schema.validate(tmp_path / "w.gpx")
    back = gpxpy.parse((tmp_path / "w.gpx").read_text())
    points = back.tracks[0].segments[0].points
    assert len(points) == 120
    for point, (_, fix) in zip(points, walk.track[0], strict=True):
        assert (point.latitude, point.longitude) == (round(fix.lat_deg, 7), round(fix.lon_deg, 7))
        assert round(point.time.timestamp() * 1000) == fix.utc_ns // 10**6
        assert point.horizontal_dilution == 0.9
    assert back.waypoints == []


def test_a_cell_with_a_place_is_a_waypoint(tmp_path, schema):
    _, _, result = walks.around_a_square(tmp_path)
    write_answers([result], tmp_path / "w.gpx", "gpx")
    schema.validate(tmp_path / "w.gpx")
    back = gpxpy.parse((tmp_path / "w.gpx").read_text())
    (waypoint,) = back.waypoints
    place = result.cells[0].place.in_short()
    assert (waypoint.name, back.tracks) == ("262-01-4711-100", [])
    assert (waypoint.latitude, waypoint.longitude) == (place.lat, place.lon)
    assert "surely within" in waypoint.description


def test_a_gap_divides_the_track_and_180_degrees_is_in_the_west(tmp_path, schema):
    walk = walks.over_the_date_line(tmp_path)
    gpx.write(walk, tmp_path / "w.gpx")
    schema.validate(tmp_path / "w.gpx")
    back = gpxpy.parse((tmp_path / "w.gpx").read_text())
    assert [len(segment.points) for segment in back.tracks[0].segments] == [30, 10]
    assert back.tracks[0].segments[0].points[10].longitude == -180.0


def test_without_utc_there_is_no_time_and_it_is_said(tmp_path, schema):
    _, walk, _ = walks.around_a_square(tmp_path, utc=False)
    gpx.write(walk, tmp_path / "w.gpx")
    schema.validate(tmp_path / "w.gpx")
    root = ET.parse(tmp_path / "w.gpx").getroot()
    assert not list(root.iter(f"{{{gpx.NAMESPACE}}}time"))
    assert "UTC is not known" in root.findtext("g:trk/g:desc", namespaces={"g": gpx.NAMESPACE})


def test_the_schema_finds_what_is_wrong(tmp_path, schema):
    gpx.write(walks.over_the_date_line(tmp_path), tmp_path / "w.gpx")
    text = (tmp_path / "w.gpx").read_text()
    for right, wrong in (
        ('lon="-180.0000000"', 'lon="180.0"'),
        ("<hdop>1.00", "<hdop>1e0"),
        ('version="1.1"', ""),
    ):
        assert right in text
        assert not schema.is_valid(text.replace(right, wrong))
