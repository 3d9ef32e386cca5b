import json
import re

import pytest
import shapely

from postproc.interop.exporting import write_answers
from postproc.interop.writers import geojson
from postproc.result import COLUMNS
from tests.postproc.interop import walks


def _write(tmp_path, walk):
    geojson.write(walk, tmp_path / "w.geojson")
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


def test_walk_and_levels(tmp_path):
    run, walk, _ = walks.around_a_square(tmp_path)
    collection = _write(tmp_path, walk)
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


def test_a_cell_is_a_point_and_one_without_a_place_has_no_geometry(tmp_path):
    _, _, result = walks.around_a_square(tmp_path)
    write_answers([result], tmp_path / "w.geojson", "geojson")
    first, second = json.loads((tmp_path / "w.geojson").read_text(encoding="utf-8"))["features"]
    place = result.cells[0].place.in_short()
    assert first["geometry"] == {"type": "Point", "coordinates": [place.lon, place.lat]}
    assert second["geometry"] is None
    assert list(first["properties"]) == list(second["properties"]) == list(COLUMNS)
    assert first["properties"]["n_places"] == 2
    assert re.fullmatch(r"50 %: 52\.\d+ 13\.\d+", first["properties"]["other_places"])


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
