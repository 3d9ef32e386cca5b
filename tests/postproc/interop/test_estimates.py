"""What of the estimates is exported."""

import json
from xml.etree import ElementTree as ET

import pytest

from logger.core.geo import Utm
from postproc.interop import geojson, gpx, kml
from postproc.interop.estimates import estimates
from tests.kit import sample_results as kit
from tests.postproc.interop import walks

PEERS = ("ekf", "rts", "batch")


def _cell(tmp_path, verdict="located", places=1):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=1)
    return kit.json_of(kit.sample_result(run, verdict=verdict, places=places))


def _estimates(found, **options):
    return estimates(json.dumps(found), kit.UTM, **options)


@pytest.mark.parametrize(
    ("verdict", "names"),
    [
        ("located", ["best position"]),
        ("cannot tell", ["best guess"]),
        ("ambiguous", ["possible position 1", "possible position 2"]),
    ],
)
def test_by_default_the_answer_and_its_region_alone(tmp_path, verdict, names):
    (found,) = _estimates(_cell(tmp_path, verdict, places=2))
    assert [position.name for position in found.positions] == names
    assert {position.verdict for position in found.positions} == {verdict}
    assert [position.ellipse95 for position in found.positions] == [()] * len(names)
    assert set(found.regions) == {95, 50}


def test_a_place_of_no_probability_is_no_part_of_an_ambiguous_answer(tmp_path):
    found = _cell(tmp_path, "ambiguous", places=2)
    found["cells"][0]["modes"][1] |= {"probability": 0.004, "percent": None}
    assert len(_estimates(found)[0].positions) == 1
    for mode in found["cells"][0]["modes"]:
        del mode["percent"]  # as an earlier version has stored it
    assert len(_estimates(found)[0].positions) == 1


@pytest.mark.parametrize("verdict", ["located", "cannot tell", "ambiguous"])
def test_of_all_estimators_the_answer_alone_has_the_verdict(tmp_path, verdict):
    found = _cell(tmp_path, verdict, places=2)
    (plain,), (every,) = _estimates(found), _estimates(found, every=True)
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
        told = [
            f["properties"].get("verdict")
            for f in features
            if f["properties"]["kind"] in {"place", "ellipse95"}
        ]
    else:
        told = [
            e.text
            for e in ET.parse(tmp_path / "out").iter()
            if e.text and e.tag.endswith(("desc", "description"))
        ]
    assert sum("located" in (text or "") for text in told) == 1


GARBAGE = [
    {"converged": False} | dict.fromkeys(("lat", "lon", "ellipse95")),
    {
        "lat": None,
        "lon": None,
        "ellipse95": {"semi_major_m": 1.0, "semi_minor_m": 1.0, "azimuth_deg": 0.0},
    },
    {"ellipse95": {"semi_major_m": None, "semi_minor_m": None, "azimuth_deg": None}},
    {"ellipse95": {"semi_major_m": 49908042.0, "semi_minor_m": 35141876.0, "azimuth_deg": 3.0}},
    {"ellipse95": None},
    {
        "bounded": False,
        "ellipse95": {"semi_major_m": 30000.0, "semi_minor_m": 20.0, "azimuth_deg": 3.0},
    },
]


@pytest.mark.parametrize("garbage", GARBAGE)
@pytest.mark.parametrize("key", PEERS)
def test_what_did_not_converge_is_left_out_and_named(tmp_path, garbage, key):
    """As an earlier version has stored it too: infinity is null in JSON."""
    found = _cell(tmp_path)
    found["cells"][0][key] = found["cells"][0][key] | garbage
    (every,) = _estimates(found, every=True)
    assert len(every.positions) == 4
    if found["cells"][0][key]["lat"] is not None:
        assert len(every.left_out) == 1


def test_an_ellipse_at_the_edge_of_the_map_is_drawn(tmp_path):
    found = _cell(tmp_path)
    (every,) = estimates(json.dumps(found), Utm(32), every=True)
    assert all(position.ellipse95 for position in every.positions if not position.verdict)
