import json

import pytest
import shapely

from postproc.interop.writers import geojson
from tests.postproc.interop import walks


def _write(tmp_path, walk, found=()):
    geojson.write(walk, found, tmp_path / "w.geojson")
    return json.loads(
        (tmp_path / "w.geojson").read_text(encoding="utf-8"), parse_constant=pytest.fail
    )


def _of_kind(collection, kind):
    return [f for f in collection["features"] if f["properties"]["kind"] == kind]


def check_rfc7946(collection):
    """Structure, order and range of coordinates, closed and valid rings wound to the right, none
    over 180 degrees.
    """
    assert (collection["type"], "crs" in collection) == ("FeatureCollection", False)
    for feature in collection["features"]:
        assert feature.keys() == {"type", "geometry", "properties"}
        shape = shapely.geometry.shape(feature["geometry"])
        west, south, east, north = shape.bounds
        assert -180.0 <= west <= east <= 180.0
        assert -90.0 <= south <= north <= 90.0
        assert east - west < 180.0 or len(getattr(shape, "geoms", [])) > 1
        assert shape.is_valid
        for polygon in getattr(shape, "geoms", []) if shape.geom_type == "MultiPolygon" else []:
            assert polygon.exterior.is_ccw
            assert not any(ring.is_ccw for ring in polygon.interiors)
    for feature in _of_kind(collection, "region") + _of_kind(collection, "ellipse95"):
        for rings in feature["geometry"]["coordinates"]:
            assert all(ring[0] == ring[-1] and len(ring) >= 4 for ring in rings)


def test_the_checker_finds_what_is_wrong():
    def area(ring):
        shape = {"type": "MultiPolygon", "coordinates": [[ring]]}
        return {
            "type": "FeatureCollection",
            "features": [{"type": "Feature", "geometry": shape, "properties": {"kind": "region"}}],
        }

    right = [[0, 0], [1, 0], [1, 1], [0, 0]]
    check_rfc7946(area(right))
    for wrong in (
        right[::-1],
        [[x + 179.5, y] for x, y in right],
        [[0, 0], [2, 2], [2, 0], [0, 2], [0, 0]],
    ):
        with pytest.raises(AssertionError):
            check_rfc7946(area(wrong))


def test_walk_levels_and_estimates(tmp_path):
    run, walk, found = walks.around_a_square(tmp_path)
    collection = _write(tmp_path, walk, found)
    check_rfc7946(collection)
    levels = _of_kind(collection, "level")
    assert len(levels) == len(run.tables["readings"]) == 120
    assert [f["properties"]["level_dbm"] for f in levels] == [
        one.rssi_dbm for one in walk.sightings
    ]
    first = levels[0]["properties"]
    assert (first["cell"], first["rat"], first["t_s"]) == ("262-01-4711-100", "GSM", 0.0)
    assert (first["utc"], first["acc_m"]) == (
        "2026-09-21T14:13:25.100Z",
        walk.sightings[0].fix.acc_m,
    )
    (track,) = _of_kind(collection, "walk")
    assert sum(map(len, track["geometry"]["coordinates"])) == 120
    assert len(_of_kind(collection, "region")) == 2
    assert [f["properties"]["probability"] for f in _of_kind(collection, "place")][:2] == [0.5, 0.5]
    region95, region50 = (
        shapely.geometry.shape(f["geometry"]) for f in _of_kind(collection, "region")
    )
    assert region95.buffer(1e-6).contains(region50)
    place = shapely.geometry.shape(_of_kind(collection, "place")[0]["geometry"])
    assert region50.contains(place)
    assert _of_kind(collection, "ellipse95") == []


def test_all_estimators_come_with_ellipses_and_without_the_verdict(tmp_path):
    _, walk, found = walks.around_a_square(tmp_path, every=True, verdict="located")
    collection = _write(tmp_path, walk, found)
    check_rfc7946(collection)
    places = _of_kind(collection, "place")
    assert [f["properties"]["name"] for f in places if f["properties"]["verdict"]] == [
        "best position"
    ]
    ellipse, place = _of_kind(collection, "ellipse95")[0], places[1]
    assert ellipse["properties"]["name"] == place["properties"]["name"] == "posterior, position 1"
    assert shapely.geometry.shape(ellipse["geometry"]).contains(
        shapely.geometry.shape(place["geometry"])
    )


def test_without_utc_there_are_seconds_only(tmp_path):
    _, walk, _ = walks.around_a_square(tmp_path, utc=False)
    collection = _write(tmp_path, walk)
    assert {f["properties"]["utc"] for f in collection["features"]} == {None}
    assert _of_kind(collection, "level")[1]["properties"]["t_s"] == 0.0
    assert _of_kind(collection, "level")[-1]["properties"]["t_s"] == 118.0


def test_over_the_date_line(tmp_path):
    collection = _write(tmp_path, walks.over_the_date_line(tmp_path))
    check_rfc7946(collection)
    (track,) = _of_kind(collection, "walk")
    assert [(part[0][0], part[-1][0]) for part in track["geometry"]["coordinates"]] == [
        (179.999, 180.0), (-180.0, -179.9981), (-179.998, -179.9971),
    ]  # fmt: skip
