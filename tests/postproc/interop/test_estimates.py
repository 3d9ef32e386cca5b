"""What of the estimates is exported."""

import json
from math import inf, nan
from xml.etree import ElementTree as ET

import msgspec
import pytest

from logger.core.ellipse import Ellipse
from logger.core.places import Utm
from postproc.interop.estimates import estimate_of
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
