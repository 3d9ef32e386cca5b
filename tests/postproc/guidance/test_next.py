import csv
import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from logger.core.errors import EstimationError
from logger.core.guidance.routes import Route
from logger.core.model.prior import Prior
from logger.core.places import Utm
from postproc.cli import main
from postproc.guidance.cli import _readings_of
from postproc.guidance.next_walk import draw_map, next_walk
from tests.kit.guided_walks import LAT_DEG, LON_DEG, line, rows
from tests.kit.suspicion_walks import gsm, write_walk
from tests.kit.walks import observations
from tests.postproc.baseline import walks as city_walks

EMITTER_M = (150.0, 90.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A straight walk past a transmitter: its mirror image is as probable."""
    folder = tmp_path_factory.mktemp("next")
    walk = list(rows(line((0.0, 0.0), (300.0, 0.0)), EMITTER_M))
    with (folder / "walk.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [*walk[0], "cell", "rat", "acc_m"])
        writer.writeheader()
        writer.writerows(row | {"cell": "262-01-1-7", "rat": "GSM", "acc_m": "4"} for row in walk)
    assert main(["import", str(folder / "walk.csv"), "-o", str(folder / "run.h5")]) == 0
    return folder / "run.h5"


def _json(capsys, *arguments):
    capsys.readouterr()
    assert main(["next", "--json", *map(str, arguments)]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_best_route_leaves_the_line_of_the_walk(run, capsys):
    document = _json(capsys, run)
    assert document["cell"] == "262-01-1-7"
    best, *others = document["routes"]
    assert len(others) >= 2
    # one that leads nearer may say a little less on a kilometre
    assert best["nats_per_km"] >= 0.9 * max(one["nats_per_km"] for one in others)
    assert best["r95_after_m"] < document["best"]["r95_m"]
    utm = Utm.at(LAT_DEG, LON_DEG)
    y_m = [utm.to_xy(*point)[1] for point in best["points"]]
    assert np.ptp(y_m) > 50.0
    assert "optimistic" in document["note"]


def test_the_answer_is_that_of_smooth(run, capsys):
    document = _json(capsys, run)
    assert main(["smooth", str(run), "--json"]) == 0
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert document["best"]["r95_m"] == pytest.approx(cell["best"]["r95_m"])
    assert document["best"]["lat"] == pytest.approx(cell["best"]["lat"], abs=1e-9)
    assert document["verdict"] == cell["verdict"]


def test_the_radii_come_with_what_they_suppose(run, tmp_path, capsys):
    noise = np.random.default_rng(1).integers(-3, 4, 60).tolist()
    path = city_walks.write_walk(
        tmp_path, 1, lambda k: (city_walks.cell(1, -90.0 + k // 20 + noise[k]),), n=60
    )
    assert _json(capsys, path)["supposition"] == "if it is no distant mast"
    assert _json(capsys, run)["supposition"] is None


def test_the_sentence_has_the_places_of_the_answer():
    """A walk that a sample of the posterior takes for one place, and one it takes for several."""
    for to_m, emitter_m in (((900.0, 0.0), (150.0, 90.0)), ((300.0, 0.0), (-300.0, 200.0))):
        rng = np.random.default_rng(1)
        x_m, y_m = np.array(line((0.0, 0.0), to_m)).T
        away_m = np.maximum(np.hypot(x_m - emitter_m[0], y_m - emitter_m[1]), 5.0)
        level_dbm = np.round(-25.0 - 28.0 * np.log10(away_m) + 4.0 * rng.normal(size=len(x_m)))
        found = next_walk(observations(x_m, y_m, level_dbm, 4.0), Prior())
        places = found.answer.place.likely_modes
        assert ("two places fit" in found.text) == (len(places) == 2)
        assert ("places fit" in found.text) == (len(places) > 1)


def test_the_next_walk_is_in_one_place(tmp_path, capsys):
    """Networks use channels and codes again: each place has an answer of its own."""
    lines = ["t_s,lat,lon,rsrp_dbm,rat,arfcn,pci"]
    for place, lon in enumerate((13.4, 14.4)):
        for k, row in enumerate(rows(line((0.0, 0.0), (300.0, 0.0)), EMITTER_M)):
            east = float(row["lon"]) - LON_DEG + lon
            level_dbm = float(row["rssi_dbm"]) - 20.0
            t_s = 7200 * place + k
            lines.append(f"{t_s},{row['lat']},{east},{level_dbm},LTE,1300,210")
    (tmp_path / "walk.csv").write_text("\n".join([*lines, ""]))
    path = tmp_path / "run.h5"
    assert main(["import", str(tmp_path / "walk.csv"), "-o", str(path)]) == 0
    for asked, lon in (((), 13.4), (("--from", f"{LAT_DEG},14.4"), 14.4)):
        document = _json(capsys, path, *asked)
        assert document["best"]["r95_m"] < 5000.0
        assert document["best"]["lon"] == pytest.approx(lon, abs=0.05)


def test_the_sentence_has_the_metres_to_the_first_turn(run, capsys, tmp_path):
    path = tmp_path / "streets.geojson"
    north, east = [LON_DEG, LAT_DEG + 0.0008], [LON_DEG + 0.004, LAT_DEG + 0.0008]
    path.write_text(
        json.dumps({"type": "LineString", "coordinates": [[LON_DEG, LAT_DEG], north, east]})
    )
    document = _json(capsys, run, "--streets", path, "--from", f"{LAT_DEG},{LON_DEG}")
    assert document["routes"][0]["length_m"] > 150.0
    assert document["text"].startswith("go, north, 89 m: ")


def test_the_map_shows_all_of_the_best_route(run, tmp_path, monkeypatch):
    axes = []
    monkeypatch.setattr(
        "postproc.pictures.plots.save_figure", lambda figure, _: axes.append(figure.axes[0])
    )
    walk = next_walk(_readings_of([run], None), Prior())
    best = walk.routes[0]
    far = best._replace(route=Route(walk.start.xy_m[:, 0] + np.array([[0.0, 0.0], [0.0, 1400.0]])))
    draw_map(walk._replace(routes=(far,)), tmp_path / "next.png")
    (shown,) = axes
    assert min(*shown.get_xlim(), *shown.get_ylim()) < -1400.0
    assert max(*shown.get_xlim(), *shown.get_ylim()) > 1400.0


def test_a_suspicious_cell_comes_before_a_stronger_one(tmp_path, capsys):
    homely = [gsm(cid, -60 - cid) for cid in range(10, 16)]
    write_walk(tmp_path / "run.journal", [*homely, gsm(99, -90, mcc="310", mnc="260")])
    assert _json(capsys, tmp_path / "run.journal")["cell"] == "310-260-1201-99"
    write_walk(tmp_path / "homely.journal", homely)
    assert _json(capsys, tmp_path / "homely.journal")["cell"] == "232-01-1201-10"


def test_a_start_may_be_named(run, capsys):
    document = _json(capsys, run, "--from", "52.501,13.402")
    assert (document["start"]["lat"], document["start"]["lon"]) == (
        pytest.approx(52.501),
        pytest.approx(13.402),
    )
    assert document["routes"][0]["points"][0] == pytest.approx([52.501, 13.402])


def test_routes_and_map_are_written(run, capsys, tmp_path):
    gpx, picture = tmp_path / "next.gpx", tmp_path / "next.png"
    document = _json(capsys, run, "--routes", gpx, "--map", picture)
    names = {"g": "http://www.topografix.com/GPX/1/1"}
    routes = ET.parse(gpx).getroot().findall("g:rte", names)
    assert len(routes) == len(document["routes"])
    points = [
        [float(point.get("lat")), float(point.get("lon"))]
        for point in routes[0].findall("g:rtept", names)
    ]
    assert np.abs(np.array(points) - document["routes"][0]["points"]).max() < 1e-6
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_routes_of_one_place_are_streets_of_a_map(run, capsys, tmp_path):
    path = tmp_path / "streets.geojson"
    lon = [LON_DEG + 0.0012 * k for k in range(-2, 7)]
    lat = [LAT_DEG + 0.0008 * k for k in range(-4, 5)]
    lines = [[[x, lat[0]], [x, lat[-1]]] for x in lon] + [[[lon[0], y], [lon[-1], y]] for y in lat]
    path.write_text(json.dumps({"type": "MultiLineString", "coordinates": lines}))
    document = _json(capsys, run, "--streets", path)
    ends = [tuple(round(degrees, 5) for degrees in one["points"][-1]) for one in document["routes"]]
    assert len(set(ends)) == len(ends) > 2
    for y, x in document["routes"][0]["points"]:
        is_on = min(abs(x - one) for one in lon) < 1e-6 or min(abs(y - one) for one in lat) < 1e-6
        assert is_on


def test_the_table_is_readable(run, capsys):
    capsys.readouterr()
    assert main(["next", str(run)]) == 0
    out = capsys.readouterr().out
    assert "surely within, after it" in out
    assert "optimistic" in out


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--cell", "262-01-1-8"], "no readings of 262-01-1-8"),
        (["--from", "here"], "is no position: LAT,LON is wanted"),
        (["--from", "95,13"], "no position on Earth"),
        (["--from", "13.4,52.5"], "km from the end of the walk; latitude comes first"),
        (["--map", "next.xyz"], "a picture ends in"),
        (["--routes", "/nowhere/next.gpx"], "/nowhere"),
    ],
)
def test_a_mistake_is_one_line(run, capsys, arguments, reason):
    capsys.readouterr()
    assert main(["next", str(run), *arguments]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert reason in err
    assert "error of this program" not in err


def test_a_cell_of_too_few_readings_has_no_route(run):
    """As `smooth`, which has no position of it."""
    few = _readings_of([run], None).part(slice(4))
    with pytest.raises(
        EstimationError, match="only 4 .* at least 5 are needed; heard best at .*; walk there"
    ):
        next_walk(few, Prior())


def test_files_that_are_written_are_named(run, tmp_path, capsys):
    routes, picture = tmp_path / "routes.gpx", tmp_path / "map.png"
    assert main(["next", str(run), "--routes", str(routes), "--map", str(picture)]) == 0
    assert capsys.readouterr().err == f"written: {routes}\nwritten: {picture}\n"


def test_no_route_makes_the_region_larger(tmp_path, capsys):
    """From a few steps nothing is known, and the sample of positions is coarse."""
    walk = list(rows(line((0.0, 0.0), (30.0, 0.0)), (-200.0, -300.0)))
    with (tmp_path / "walk.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [*walk[0], "cell", "rat", "acc_m"])
        writer.writeheader()
        writer.writerows(row | {"cell": "262-01-1-7", "rat": "GSM", "acc_m": "4"} for row in walk)
    assert main(["import", str(tmp_path / "walk.csv"), "-o", str(tmp_path / "run.h5")]) == 0
    document = _json(capsys, tmp_path / "run.h5")
    assert max(one["r95_after_m"] for one in document["routes"]) <= document["best"]["r95_m"]
