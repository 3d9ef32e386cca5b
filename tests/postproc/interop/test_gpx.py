from xml.etree import ElementTree as ET

import gpxpy
import pytest
import xmlschema

from postproc.interop import gpx
from tests.postproc.interop import walks

# The part of GPX 1.1 that is used here, said again in our own words: order, kinds and ranges of its elements
# (www.topografix.com/GPX/1/1). The schema itself has no licence under which it could stand in this repository.
SCHEMA = """
<schema xmlns="http://www.w3.org/2001/XMLSchema" xmlns:g="http://www.topografix.com/GPX/1/1"
  targetNamespace="http://www.topografix.com/GPX/1/1" elementFormDefault="qualified">
 <simpleType name="lat">
  <restriction base="decimal"><minInclusive value="-90"/><maxInclusive value="90"/></restriction>
 </simpleType>
 <simpleType name="lon">
  <restriction base="decimal"><minInclusive value="-180"/><maxExclusive value="180"/></restriction>
 </simpleType>
 <complexType name="point">
  <sequence>
   <element name="ele" type="decimal" minOccurs="0"/>
   <element name="time" type="dateTime" minOccurs="0"/>
   <element name="name" type="string" minOccurs="0"/>
   <element name="desc" type="string" minOccurs="0"/>
   <element name="type" type="string" minOccurs="0"/>
   <element name="sat" type="nonNegativeInteger" minOccurs="0"/>
   <element name="hdop" type="decimal" minOccurs="0"/>
  </sequence>
  <attribute name="lat" type="g:lat" use="required"/>
  <attribute name="lon" type="g:lon" use="required"/>
 </complexType>
 <complexType name="segment">
  <sequence><element name="trkpt" type="g:point" minOccurs="0" maxOccurs="unbounded"/></sequence>
 </complexType>
 <complexType name="track">
  <sequence>
   <element name="name" type="string" minOccurs="0"/>
   <element name="desc" type="string" minOccurs="0"/>
   <element name="trkseg" type="g:segment" minOccurs="0" maxOccurs="unbounded"/>
  </sequence>
 </complexType>
 <element name="gpx">
  <complexType>
   <sequence>
    <element name="wpt" type="g:point" minOccurs="0" maxOccurs="unbounded"/>
    <element name="trk" type="g:track" minOccurs="0" maxOccurs="unbounded"/>
   </sequence>
   <attribute name="version" type="string" use="required" fixed="1.1"/>
   <attribute name="creator" type="string" use="required"/>
  </complexType>
 </element>
</schema>
"""


@pytest.fixture(scope="module")
def schema():
    return xmlschema.XMLSchema(SCHEMA)


def test_valid_and_read_by_gpxpy(tmp_path, schema):
    _, walk, found = walks.around_a_square(tmp_path)
    gpx.write(walk, found, tmp_path / "w.gpx")
    schema.validate(tmp_path / "w.gpx")
    back = gpxpy.parse((tmp_path / "w.gpx").read_text())
    points = back.tracks[0].segments[0].points
    assert len(points) == 120
    for point, (_, fix) in zip(points, walk.track[0], strict=True):
        assert (point.latitude, point.longitude) == (round(fix.lat_deg, 7), round(fix.lon_deg, 7))
        assert round(point.time.timestamp() * 1000) == fix.utc_ns // 10**6
        assert point.horizontal_dilution == 0.9
    names = [waypoint.name for waypoint in back.waypoints]
    assert names[:2] == ["262-01-4711-100 place 1", "262-01-4711-100 place 2"]


def test_a_gap_divides_the_track_and_180_degrees_is_in_the_west(tmp_path, schema):
    walk = walks.over_the_date_line(tmp_path)
    gpx.write(walk, (), tmp_path / "w.gpx")
    schema.validate(tmp_path / "w.gpx")
    back = gpxpy.parse((tmp_path / "w.gpx").read_text())
    assert [len(segment.points) for segment in back.tracks[0].segments] == [30, 10]
    assert back.tracks[0].segments[0].points[10].longitude == -180.0


def test_without_utc_there_is_no_time_and_it_is_said(tmp_path, schema):
    _, walk, _ = walks.around_a_square(tmp_path, utc=False)
    gpx.write(walk, (), tmp_path / "w.gpx")
    schema.validate(tmp_path / "w.gpx")
    root = ET.parse(tmp_path / "w.gpx").getroot()
    assert not list(root.iter(f"{{{gpx.NAMESPACE}}}time"))
    assert "UTC is not known" in root.findtext("g:trk/g:desc", namespaces={"g": gpx.NAMESPACE})


def test_the_schema_finds_what_is_wrong(tmp_path, schema):
    gpx.write(walks.over_the_date_line(tmp_path), (), tmp_path / "w.gpx")
    text = (tmp_path / "w.gpx").read_text()
    for right, wrong in (('lon="-180.0000000"', 'lon="180.0"'), ("<hdop>1.00", "<hdop>1e0"), ('version="1.1"', "")):
        assert right in text
        assert not schema.is_valid(text.replace(right, wrong))
