"""The journalist's task: runs of several cities, and one invented cell in two of them."""

import contextlib
import gzip
import io
import json
import shutil
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from logger.core.errors import ConfigError, GeoError
from logger.core.runfile import RunWriter, Truth, read_run
from logger.core.suspicion.rule import WORDS
from logger.core.types import CellReading, Fix, Record, Scan
from logger.sim.scenario import GRAZ, city
from logger.sim.walk import Walk
from logger.sim.world import Radio, World
from postproc.cli import main
from postproc.ground import by_place, groups_with
from postproc.smoothing import smooth_runs
from tests.kit.runs import UTC0_NS, meta

CITIES = {
    "graz": (47.0707, 15.4395),
    "cork": (51.8980, -8.4706),
    "surat": (21.1702, 72.8311),
    "lima": (-12.0464, -77.0428),
}
ROGUE, ROGUE_IN = GRAZ.rogue, ("graz", "lima")
ROGUE_NAME = f"{ROGUE.mcc}-{ROGUE.mnc}-{ROGUE.lac}-{ROGUE.cid}"
DECODED_DBM = -100.0
DAY_NS = 86_400 * 10**9
SCHEMA = Path(__file__).parents[2] / "docs" / "result.schema.json"


def walk_in(path, name, number, cells):
    """A fix and a scan every 14 s, day `number` of the journey."""
    rng = np.random.default_rng(number)
    world = World.build(cells, *CITIES[name], Radio(3.0, 30.0, 2.0), rng)
    way = Walk(GRAZ.walk[:6])
    t_s = np.arange(0.0, way.duration_s, 14.0)
    east_m, north_m = way.positions(t_s)
    levels_dbm = world.received_dbm(east_m, north_m, rng)
    truth = tuple(Truth(name_of(one), *world.to_latlon(one.east_m, one.north_m)) for one in cells)
    writer = RunWriter(path, meta(run_id=f"{number:032x}", truth=truth, boot_id=f"boot {number}"))
    for k, t in enumerate(t_s.tolist()):
        t_ns = round(t * 1e9)
        lat_deg, lon_deg = world.to_latlon(float(east_m[k]), float(north_m[k]))
        utc_ns = UTC0_NS + number * DAY_NS + t_ns
        seq = writer.append(Record(t_ns, "gnss", Fix(True, utc_ns, lat_deg, lon_deg, acc_m=3.0)))
        readings = tuple(
            CellReading("neighbour", "GSM", one.mcc, one.mnc, one.lac, one.cid, one.arfcn,
                        bsic=one.bsic, rssi_dbm=float(level))
            for one, level in zip(cells, levels_dbm[:, k], strict=True)
            if level > DECODED_DBM
        )  # fmt: skip
        writer.append(Record(t_ns + 10**6, "modem", Scan(t_ns, readings, seq, seq)))
    writer.close(round(t_s[-1] * 1e9) + 10**9, "test")


def name_of(one):
    return f"{one.mcc}-{one.mnc}-{one.lac}-{one.cid}"


def own_cell(at):
    """The nearest to the walk, loud enough for all of it."""
    cells = city(np.random.default_rng(at))
    nearest = min(cells, key=lambda one: np.hypot(one.east_m, one.north_m))
    return replace(nearest, cid=100 + at, p0_dbm=0.0)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Five runs in four cities, one cell of its own each; the second of Graz has the rogue only."""
    folder, paths = tmp_path_factory.mktemp("cities"), []
    for number, name in enumerate([*CITIES, "graz"]):
        at = list(CITIES).index(name)
        cells = (own_cell(at), ROGUE) if name in ROGUE_IN else (own_cell(at),)
        cells = cells if number < len(CITIES) else (ROGUE,)
        path = folder / f"{number}-{name}.journal"
        walk_in(path, name, number, cells)
        paths.append(path)
    return paths


@pytest.fixture(scope="module")
def answer(files):
    """As `smooth --json` prints."""
    return run_json("smooth", *files)


def run_json(*argv):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main([*map(str, argv), "--json"]) == 0
    return json.loads(out.getvalue())


def test_one_command_names_the_invented_cell_its_cities_and_its_days(answer):
    (found,) = answer["several_places"]
    assert found["cell"] == ROGUE_NAME
    graz, lima = found["places"]
    for place, name in ((graz, "graz"), (lima, "lima")):
        assert (place["lat"], place["lon"]) == pytest.approx(CITIES[name], abs=0.01)
    assert graz["runs"] == ["0-graz.journal", "4-graz.journal"]
    assert lima["runs"] == ["3-lima.journal"]
    assert (graz["first_utc"][:10], graz["last_utc"][:10]) == ("2026-09-21", "2026-09-25")
    assert lima["first_utc"][:10] == lima["last_utc"][:10] == "2026-09-24"


def test_nothing_is_said_of_cells_that_were_not_asked_for(files):
    groups = by_place([read_run(path) for path in files])
    for cell, several in ((ROGUE_NAME, [ROGUE_NAME]), (name_of(own_cell(0)), [])):
        for group in groups_with(groups, [cell]):
            assert list(group.several) == several


def test_each_city_has_its_own_answer(answer):
    groups = answer["groups"]
    assert [group["place"] for group in groups] == [
        "47.07° N, 15.44° E", "51.90° N, 8.47° W", "21.17° N, 72.83° E", "12.05° S, 77.04° W",
    ]  # fmt: skip
    rows = {(k, row["cell"]): row for k, group in enumerate(groups) for row in group["cells"]}
    assert sorted(k for k, name in rows if name == ROGUE_NAME) == [0, 3]
    assert len(rows) == 6
    for (k, name), row in rows.items():
        lat, lon = list(CITIES.values())[k]
        place = row["best"]
        assert (place["lat"], place["lon"]) == pytest.approx((lat, lon), abs=0.05)
        assert row["truth"]["inside_region95"]
        assert any("heard in 2 places" in text for text in row["warnings"]) == (name == ROGUE_NAME)
    assert rows[0, ROGUE_NAME]["runs"] == ["0-graz.journal", "4-graz.journal"]
    assert rows[0, ROGUE_NAME]["n"] > rows[3, ROGUE_NAME]["n"]


def test_an_area_in_one_city_leaves_the_others_out(files, tmp_path, capsys):
    lat, lon = CITIES["graz"]
    ring = [[lon + east, lat + north] for east, north in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    area = tmp_path / "styria.geojson"
    area.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    files = [shutil.copy(file, tmp_path) for file in files]  # beside them the answer is stored
    found = run_json("smooth", *files, "--area", area)
    said = capsys.readouterr().err
    assert {row["runs"][0] for row in found["cells"]} <= {"0-graz.journal", "4-graz.journal"}
    assert said.count("is not near the area inside styria.geojson: left out") == 3
    assert main(["smooth", *map(str, files), "--area", str(area)]) == 0
    assert "Positions are those of a cell inside styria.geojson." in capsys.readouterr().out


def test_several_groups_are_in_the_published_schema(answer):
    jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text())).validate(answer)


def test_the_terminal_has_a_heading_for_each_city(files, answer, capsys):
    assert main(["suspect", *map(str, files)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("4 places: 47.07° N, 15.44° E (2 runs, 2026-09-21 to 2026-09-25)")
    (finding,) = [line for line in lines if "one was carried" in line]
    assert finding.startswith(f"{ROGUE_NAME} is heard in 2 places, 11")
    assert "km apart, farther than any cell reaches: 47.07° N, 15.44° E (0-graz.journal" in finding
    for group in answer["groups"]:
        assert sum(line.startswith(f"{group['place']} (") for line in lines) == 1
    said = run_json("suspect", *files)
    for k, group in enumerate(said["groups"]):
        rules = {cell["cell"]: [one["rule"] for one in cell["findings"]] for cell in group["cells"]}
        assert ("S11" in rules.get(ROGUE_NAME, [])) == (k in {0, 3})
        words = {cell["cell"]: cell["word"] for cell in group["cells"]}
        assert (words.get(ROGUE_NAME) in WORDS[1:]) == (k in {0, 3})


def test_a_page_for_each_city_of_what_smooth_has_stored(files, answer, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "postproc.smoothing.smooth_runs", lambda *_, **__: pytest.fail("estimated again")
    )
    said = run_json("report", *files, "--cell", ROGUE_NAME, "-o", tmp_path / "a.html")
    pages = [Path(group["path"]) for group in said["groups"]]
    assert [page.name for page in pages] == ["a-47.07N-15.44E.html", "a-12.05S-77.04W.html"]
    for page in pages:
        assert "heard in 2 places" in page.read_text()


def test_first_runs_of_two_loggers_are_told_apart(files, tmp_path, capsys):
    paths = [tmp_path / folder / "run-000001.journal" for folder in ("pi", "spare")]
    for file, path in zip((files[0], files[4]), paths, strict=True):
        path.parent.mkdir()
        path.write_bytes(file.read_bytes())
    names = ["pi/run-000001.journal", "spare/run-000001.journal"]
    paths.append(files[3])
    graz, lima = run_json("suspect", *paths)["groups"]
    heard = {row["cell"]: row["runs"] for row in graz["cells"]}
    assert heard == {ROGUE_NAME: names, name_of(own_cell(0)): names[:1]}
    assert "runs" not in lima["cells"][0]  # there is one
    assert main(["suspect", *map(str, paths)]) == 0
    text = capsys.readouterr().out
    assert f"  heard in {', '.join(names)}, 2026-09-21 to 2026-09-25\n" in text
    csv = tmp_path / "cells.csv"
    assert main(["export", *map(str, paths), "--estimates", "-o", str(csv)]) == 0
    row, _ = (line for line in csv.read_text().splitlines() if line.startswith(ROGUE_NAME))
    assert "; ".join(names) in row


def test_a_cell_is_asked_in_the_cities_that_name_it(files):
    groups = by_place([read_run(path) for path in files])
    (alone,) = groups_with(groups, [name_of(own_cell(1))])
    assert (alone.name, alone.cells) == ("51.90° N, 8.47° W", (name_of(own_cell(1)),))
    both = [name_of(own_cell(0)), ROGUE_NAME]
    assert [group.cells for group in groups_with(groups, both)] == [tuple(both), (ROGUE_NAME,)]
    assert [group.cells for group in groups_with(groups, [])] == [(), (), (), ()]
    with pytest.raises(ConfigError, match="was not observed"):
        list(groups_with(groups, ["1-1-1-1"]))


def test_python_says_that_the_runs_are_of_several_places(files):
    with pytest.raises(GeoError, match="4 places"):
        smooth_runs([read_run(path) for path in files])


@pytest.fixture(scope="module")
def drives(cells, tmp_path_factory):
    """Imported drive tests of four cities, with an invented cell in Ottawa and in Cork."""
    folder, paths = tmp_path_factory.mktemp("drives"), []
    logs = "cork_driving_2019.11.21_10", "india_umts", "losangeles_att", "ottawa_lacolyoc_2020083"
    for name in logs:
        log = min(cells.glob(f"{name}*.csv.gz"), key=lambda path: path.stat().st_size)
        lines = gzip.decompress(log.read_bytes()).decode().splitlines()
        if name.startswith(("cork", "ottawa")):
            for k in range(len(lines) - 1, 0, -4):
                where = lines[k].split(",")[:3]
                lines.insert(k + 1, ",".join([*where, "LTE,302,720,999,4242,,77,-95,0,"]))
        (folder / f"{name}.csv").write_text("\n".join(lines))
        paths.append(folder / f"{name}.h5")
        assert main(["import", str(folder / f"{name}.csv"), "-o", str(paths[-1])]) == 0
    return paths


def test_real_logs_of_four_cities(drives, capsys):
    said = run_json("suspect", *drives)
    (found,) = said["several_places"]
    cork, ottawa = found["places"]
    assert found["cell"] == "302-720-999-4242"
    assert (cork["first_utc"][:10], ottawa["first_utc"][:10]) == ("2019-11-21", "2020-08-30")
    assert (cork["runs"], ottawa["runs"]) == ([drives[0].name], [drives[3].name])
    assert [group["place"].split(".")[0] for group in said["groups"]] == ["51", "22", "34", "45"]
    assert {"S11"} <= {
        finding["rule"]
        for group in said["groups"]
        for cell in group["cells"]
        if cell["cell"] == found["cell"]
        for finding in cell["findings"]
    }
