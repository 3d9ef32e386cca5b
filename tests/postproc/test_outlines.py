"""Lines and polygons of maps: cut at the antimeridian, valid, wound."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from postproc.outlines import lines, polygons


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
