"""What of the estimates is exported."""

import json
from math import inf, nan
from xml.etree import ElementTree as ET

import msgspec
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from logger.core.ellipse import Ellipse
from logger.core.places import Utm
from postproc.interop.estimates import ellipse, estimate_of, lines, polygons
from postproc.interop.writers import geojson, gpx, kml
from postproc.summary import summarise
from tests.kit import sample_results as kit
from tests.postproc.interop import walks

PEERS = ("ekf", "rts", "batch")


def _cell(tmp_path, verdict="located", places=1):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=1)
    (cell,) = summarise(kit.sample_result(run, verdict=verdict, places=places)).cells
    return cell


@pytest.mark.parametrize(
    ("verdict", "names"),
    [
        ("located", ["best position"]),
        ("cannot tell", ["best guess"]),
        ("ambiguous", ["possible position 1", "possible position 2"]),
    ],
)
def test_by_default_the_answer_and_its_region_alone(tmp_path, verdict, names):
    found = estimate_of(_cell(tmp_path, verdict, places=2), kit.UTM)
    assert [position.name for position in found.positions] == names
    assert {position.verdict for position in found.positions} == {verdict}
    assert [position.ellipse95 for position in found.positions] == [()] * len(names)
    assert set(found.regions) == {95, 50}


def test_a_place_of_no_probability_is_no_part_of_an_ambiguous_answer(tmp_path):
    cell = _cell(tmp_path, "ambiguous", places=2)
    cell.modes[1] = msgspec.structs.replace(cell.modes[1], probability=0.004, percent=None)
    assert len(estimate_of(cell, kit.UTM).positions) == 1


@pytest.mark.parametrize("verdict", ["located", "cannot tell", "ambiguous"])
def test_of_all_estimators_the_answer_alone_has_the_verdict(tmp_path, verdict):
    cell = _cell(tmp_path, verdict, places=2)
    plain, every = (estimate_of(cell, kit.UTM, every=every) for every in (False, True))
    assert [position for position in every.positions if position.verdict] == list(plain.positions)
    assert {"EKF", "RTS", "least squares"} < {position.name for position in every.positions}
    assert all(position.ellipse95 for position in every.positions if not position.verdict)


@pytest.mark.parametrize("write", [kml.write, geojson.write, gpx.write])
@pytest.mark.parametrize("every", [False, True])
def test_a_file_says_located_once(tmp_path, write, every):
    _, walk, found = walks.around_a_square(tmp_path, verdict="located", every=every)
    write(walk, found, tmp_path / "out")
    if write is geojson.write:
        features = json.loads((tmp_path / "out").read_text())["features"]
        texts = [
            f["properties"].get("verdict")
            for f in features
            if f["properties"]["kind"] in {"place", "ellipse95"}
        ]
    else:
        texts = [
            e.text
            for e in ET.parse(tmp_path / "out").iter()
            if e.text and e.tag.endswith(("desc", "description"))
        ]
    assert sum("located" in (text or "") for text in texts) == 1


GARBAGE = [
    {"converged": False, "lat": None, "lon": None, "ellipse95": None},
    {"lat": None, "ellipse95": Ellipse(1.0, 1.0, 0.0)},
    {"lat": inf, "lon": inf},
    {"ellipse95": Ellipse(nan, nan, nan)},
    {"ellipse95": Ellipse(inf, inf, 0.0)},
    {"ellipse95": Ellipse(49908042.0, 35141876.0, 3.0)},
    {"ellipse95": None},
]
UNBOUNDED = {"bounded": False, "ellipse95": Ellipse(30000.0, 20.0, 3.0)}


@pytest.mark.parametrize(
    ("key", "garbage"),
    [*((key, garbage) for key in PEERS for garbage in GARBAGE), ("batch", UNBOUNDED)],
)
def test_what_did_not_converge_is_left_out_and_named(tmp_path, key, garbage):
    cell = _cell(tmp_path)
    setattr(cell, key, msgspec.structs.replace(getattr(cell, key), **garbage))
    every = estimate_of(cell, kit.UTM, every=True)
    assert len(every.positions) == 4
    if getattr(cell, key).lat is not None:
        assert len(every.left_out) == 1


def test_an_ellipse_at_the_edge_of_the_map_is_drawn(tmp_path):
    every = estimate_of(_cell(tmp_path), Utm(32), every=True)
    assert all(position.ellipse95 for position in every.positions if not position.verdict)


GEOD = Geod(ellps="WGS84")


def _shape(found):
    return shapely.MultiPolygon([(rings[0], rings[1:]) for rings in found])


def test_a_line_is_cut_at_the_antimeridian():
    west, east = lines([(179.0, 10.0), (-179.0, 12.0), (-178.0, 12.0)])
    assert west == [(179.0, 10.0), (180.0, 11.0)]
    assert east == [(-180.0, 11.0), (-179.0, 12.0), (-178.0, 12.0)]
    there_and_back = lines([(179.9, 0.0), (-179.9, 0.0), (179.9, 1.0)])
    assert [line[0][0] for line in there_and_back if len(line) == 2] == [179.9, 180.0]
    assert {abs(lon) <= 180.0 for line in there_and_back for lon, _ in line} == {True}
    assert sum(shapely.LineString(line).length for line in there_and_back) > 0.4


def test_no_line_without_two_places():
    assert lines([]) == lines([(1.0, 2.0)]) == lines([(1.0, 2.0), (1.0, 2.0)]) == []


def test_a_ring_is_cut_with_its_hole_and_wound():
    outer = [(179.0, 0.0), (179.0, 2.0), (-179.0, 2.0), (-179.0, 0.0), (179.0, 0.0)]  # clockwise
    hole = [(-179.8, 0.5), (-179.2, 0.5), (-179.2, 1.5), (-179.8, 1.5), (-179.8, 0.5)]
    found = polygons([[outer, hole]])
    assert len(found) == 2
    assert _shape(found).is_valid
    assert abs(_shape(found).area - (4.0 - 0.6)) < 1e-6
    assert sorted(len(rings) for rings in found) == [1, 2]
    for rings in found:
        assert shapely.LinearRing(rings[0]).is_ccw
        assert not any(shapely.LinearRing(ring).is_ccw for ring in rings[1:])


@given(st.lists(st.floats(0.1, 3.0), min_size=3, max_size=9), st.floats(-180, 180), st.booleans())
@settings(max_examples=60, deadline=None)
def test_any_region_becomes_valid_polygons_of_the_same_area(radii, middle, clockwise):
    angles = np.arange(len(radii)) * (2 * np.pi / len(radii)) * (-1 if clockwise else 1)
    points = [(r * np.cos(a), r * np.sin(a)) for r, a in zip(radii, angles, strict=True)]
    ring = [((middle + x + 180.0) % 360.0 - 180.0, y) for x, y in points]
    found = polygons([[[*ring, ring[0]]]])
    assert (
        abs(sum(shapely.Polygon(r[0], r[1:]).area for r in found) - shapely.Polygon(points).area)
        < 1e-5
    )
    assert all(_is_right(rings) for rings in found)


def test_a_ring_that_crosses_itself_becomes_two():
    found = polygons([[[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0), (0.0, 0.0)]]])
    assert [_is_right(rings) for rings in found] == [True, True]


def _is_right(rings):
    polygon = shapely.Polygon(rings[0], rings[1:])
    closed = all(ring[0] == ring[-1] for ring in rings)
    on_map = np.all(np.abs([lon for lon, _ in rings[0]]) <= 180.0)
    return bool(polygon.is_valid and shapely.LinearRing(rings[0]).is_ccw and closed and on_map)


def test_an_ellipse_has_its_axes_where_they_should_be():
    lat, lon = 52.5, 15.0  # on the central meridian of its zone grid north is north
    ring = ellipse(lat, lon, Utm.at(lat, lon), (300.0, 100.0), 30.0)
    azimuths, _, lengths = GEOD.inv(*np.full((2, len(ring)), [[lon], [lat]]), *np.transpose(ring))
    assert abs(lengths.max() - 300.0) < 0.5
    assert abs(lengths.min() - 100.0) < 0.5
    assert abs(azimuths[np.argmax(lengths)] % 180.0 - 30.0) < 0.5
    assert ring[0] == ring[-1]
