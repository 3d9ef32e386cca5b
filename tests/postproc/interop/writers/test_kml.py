import re
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import xmlschema

from postproc.interop.exporting import ExportWalk, write_answers
from postproc.interop.writers import kml
from postproc.result import COLUMNS
from tests.postproc.interop import walks

KML = {"k": kml.NAMESPACE}


@pytest.fixture(scope="module")
def schema():
    """The schema of the OGC, which fastkml brings along."""
    (folder,) = find_spec("fastkml").submodule_search_locations
    return xmlschema.XMLSchema(Path(folder) / "schema" / "ogckml22.xsd")


def _write(tmp_path, walk):
    kml.write(walk, tmp_path / "w.kml")
    return ET.parse(tmp_path / "w.kml").getroot()


def _folder(root, name):
    return next(
        f
        for f in root.iter(f"{{{kml.NAMESPACE}}}Folder")
        if f.findtext("k:name", namespaces=KML) == name
    )


def _points(element):
    text = " ".join(c.text for c in element.iter(f"{{{kml.NAMESPACE}}}coordinates"))
    return [tuple(map(float, one.split(","))) for one in text.split()]


def test_valid_with_every_level_at_its_place(tmp_path, schema):
    _, walk, _ = walks.around_a_square(tmp_path)
    root = _write(tmp_path, walk)
    schema.validate(tmp_path / "w.kml")
    cell = _folder(root, "262-01-4711-100")
    heard = {
        (round(h.lon_deg, 7), round(h.lat_deg, 7))
        for h in walk.sightings
        if h.reading.cell == "262-01-4711-100"
    }
    assert heard <= set(_points(_folder(cell, "levels")))
    assert len(_points(_folder(root, "walk"))) == 120


def test_cells_are_valid_layers_of_one_geometry_with_their_columns(tmp_path, schema):
    _, _, result = walks.around_a_square(tmp_path)
    write_answers([result], tmp_path / "w.kml", "kml")
    schema.validate(tmp_path / "w.kml")
    root = ET.parse(tmp_path / "w.kml").getroot()
    places = _folder(root, "cells").findall("k:Placemark", KML)
    assert [len(place.findall("k:Point", KML)) for place in places] == [1, 0]
    description = places[0].findtext("k:description", "", KML)
    radii = r"most likely within \d+ m, surely within \d+ m"
    assert re.search(f"^ambiguous: .*; likeliest at 52.50026 13.40108, {radii}$", description)
    assert "&lt;b&gt;not&lt;/b&gt; | markup" in description  # of a run, no markup of a globe
    for name in ("most likely within (50 %)", "surely within (95 %)"):
        (area,) = _folder(root, name).findall("k:Placemark", KML)
        assert area.findall("k:MultiGeometry/k:Polygon", KML)
    fields = {field.get("name") for field in root.iter(f"{{{kml.NAMESPACE}}}SimpleField")}
    used = {data.get("name") for data in root.iter(f"{{{kml.NAMESPACE}}}SimpleData")}
    assert used <= fields == set(COLUMNS)
    styles = {f"#{style.get('id')}" for style in root.iter(f"{{{kml.NAMESPACE}}}Style")}
    assert {url.text for url in root.iter(f"{{{kml.NAMESPACE}}}styleUrl")} <= styles


def test_strips_have_the_class_and_the_time_of_their_levels(tmp_path):
    walk = walks.over_the_date_line(tmp_path)
    found = list(kml.strips(walk.sightings))
    for strip in found:
        assert len({kml.level_class(one.rssi_dbm) for one in strip[:-1]}) <= 1
        assert strip[-1].t_ns - strip[0].t_ns <= 30 * 10**9  # never over the gap
    drawn = {id(one) for strip in found for one in strip}
    assert drawn == {id(one) for one in walk.sightings}
    root = _write(tmp_path, walk)
    first = _folder(root, "levels").find("k:Placemark", KML)
    assert first.findtext("k:TimeSpan/k:begin", namespaces=KML) == "2026-09-21T14:13:20.000Z"
    assert first.findtext("k:TimeSpan/k:end", namespaces=KML) == "2026-09-21T14:13:21.000Z"
    assert first.findtext("k:styleUrl", namespaces=KML) == "#level-0"


def test_over_the_date_line_and_without_utc(tmp_path, schema):
    walk = walks.over_the_date_line(tmp_path)
    root = _write(tmp_path, walk)
    schema.validate(tmp_path / "w.kml")
    for line in root.iter(f"{{{kml.NAMESPACE}}}LineString"):
        lons = [lon for lon, _ in _points(line)]
        assert max(lons) - min(lons) < 1.0
    _, walk, _ = walks.around_a_square(tmp_path, utc=False)
    root = _write(tmp_path, walk)
    schema.validate(tmp_path / "w.kml")
    assert not list(root.iter(f"{{{kml.NAMESPACE}}}TimeSpan"))
    assert "UTC is not known" in root.findtext("k:Document/k:description", namespaces=KML)


def test_names_that_are_no_xml_are_written_all_the_same(tmp_path, schema):
    from dataclasses import replace

    walk = walks.over_the_date_line(tmp_path)
    one = replace(
        walk.sightings[0], reading=replace(walk.sightings[0].reading, label="<b>&\x01\ud800 Café")
    )
    kml.write(ExportWalk((one,), walk.track, 0), tmp_path / "w.kml")
    schema.validate(tmp_path / "w.kml")
    assert _folder(ET.parse(tmp_path / "w.kml").getroot(), "<b>& Café") is not None


def test_the_schema_finds_what_is_wrong(tmp_path, schema):
    walk = walks.over_the_date_line(tmp_path)
    kml.write(walk, tmp_path / "w.kml")
    text = (tmp_path / "w.kml").read_text()
    for right, wrong in (
        ("<tessellate>1", "<tessellate>x"),
        ("#level-0</styleUrl>", "#level-0</styleUrl><name>x</name>"),
    ):
        assert right in text
        assert not schema.is_valid(text.replace(right, wrong))


@pytest.mark.parametrize(
    ("dbm", "name"),
    [
        (-20, "-60 dBm and above"),
        (-60, "-60 dBm and above"),
        (-60.5, "-70 dBm and above"),
        (-111, "below -110 dBm"),
    ],
)
def test_classes(dbm, name):
    assert kml.class_name(kml.level_class(dbm)) == name
