import csv
import json
import subprocess
from dataclasses import fields, replace
from shutil import which

import pyarrow.parquet as pq
import pytest

from logger.core import answer
from logger.core.runfile import RunWriter, convert_journal, read_run
from logger.core.suspicion.rule import Finding
from logger.core.suspicion.rules import RULES
from logger.core.types import Broadcast, CellReading, Fix, Record, Scan
from postproc import results
from postproc.cli import main
from postproc.interop.exporting import walk_of_run, write_answers
from postproc.interop.writers import names
from tests.kit import sample_results as kit
from tests.kit.runs import UTC0_NS, meta

SECRETS = ("alice", "490154203237518", "/dev/ttyUSB7", "home-pi")


def _main(capsys, *argv, code=0):
    assert main([str(a) for a in argv]) == code
    return capsys.readouterr()


@pytest.fixture
def run(tmp_path):
    """A walk of several technologies on a machine with secrets; cells without identity, levels
    without dBm.
    """
    private = {
        "config_text": f"owner = {SECRETS[0]}",
        "boot_id": SECRETS[3],
        "versions": {"host": SECRETS[3]},
    }
    writer = RunWriter(tmp_path / "walk.journal", meta(started_ns=7 * 10**9, **private))
    for i in range(30):
        t_ns = (7 + i) * 10**9
        fix = Fix(
            True, UTC0_NS + t_ns, 52.0 + i * 1e-5, 13.0 + i * 2e-5, 34.5, hdop=0.9, speed_mps=1.25
        )
        writer.append(Record(t_ns, "gnss", fix))
        cells = (
            CellReading(
                "serving", "GSM", "262", "01", 4711, 17, arfcn=62, bsic=10, rssi_dbm=-60.0 - i, ta=1
            ),
            CellReading("neighbour", "GSM", "262", "01", 4711, 18, rxlev_raw=20 + i),
            CellReading(
                "scan",
                "LTE",
                "310",
                "410",
                tac=9,
                cid=2**28 - 2,
                pci=5,
                rsrp_dbm=-99.0,
                rsrq_db=-11.5,
            ),
            CellReading(
                "scan", "WCDMA", "262", "03", 6, 70000, psc=9, rscp_dbm=-88.0, ecio_db=-8.0
            ),
            CellReading("neighbour", "GSM", arfcn=63, rssi_dbm=-90.0),
        )
        writer.append(Record(t_ns + 300_000_123, SECRETS[2][-7:], Scan(t_ns + 100_000_000, cells)))
    writer.close(40 * 10**9, "test")
    convert_journal(tmp_path / "walk.journal", tmp_path / "walk.h5")
    return tmp_path / "walk.h5"


def _plain(walk):
    return [(one.t_ns - walk.start_ns, one.fix, one.reading) for one in walk.sightings]


def test_levels_stand_between_the_fixes_and_keep_what_is_known(run):
    walk = walk_of_run(read_run(run))
    assert (
        len(walk.sightings),
        walk.n_without_identity,
        walk.n_without_position,
        walk.has_utc,
    ) == (
        120,
        30,
        0,
        True,
    )
    one = walk.sightings[4]
    assert one.t_ns == 8 * 10**9 + 200_000_061
    assert one.lat_deg == pytest.approx(52.0 + 1.2e-5, abs=1e-8)
    assert one.fix.utc_ns == pytest.approx(UTC0_NS + one.t_ns, abs=1000)
    assert (one.fix.alt_m, one.fix.speed_mps, one.reading.ta) == (34.5, 1.25, 1)
    assert [h.reading.cell for h in walk_of_run(read_run(run), ["262-01-4711-18"]).sightings] == [
        "262-01-4711-18"
    ] * 30


def test_csv_comes_back_equal_and_is_then_the_same_file(tmp_path, run, capsys):
    _main(capsys, "export", run, "-o", tmp_path / "a.csv")
    _main(capsys, "import", tmp_path / "a.csv", "-o", tmp_path / "back.h5")
    before, after = walk_of_run(read_run(run)), walk_of_run(read_run(tmp_path / "back.h5"))
    assert _plain(after) == _plain(before)
    _main(capsys, "export", tmp_path / "back.h5", "-o", tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_text() == (tmp_path / "a.csv").read_text()


@pytest.mark.parametrize("name", ["wigle", "opencellid-csv", "opencellid-json"])
def test_other_formats_come_back_equal_in_what_they_hold(tmp_path, run, capsys, name):
    _main(capsys, "export", run, "-o", tmp_path / "a", "--format", name)
    _main(capsys, "import", tmp_path / "a", "-o", tmp_path / "back.h5")
    before, after = walk_of_run(read_run(run)), walk_of_run(read_run(tmp_path / "back.h5"))

    def content_of(walk):
        unit_ns = 10**9 if name == "wigle" else 10**6
        return sorted(
            (one.fix.utc_ns // unit_ns, one.reading.cell, one.reading.rat, one.rssi_dbm)
            for one in walk.sightings
        )

    def places(walk):
        return sorted((one.reading.cell, one.lat_deg, one.lon_deg) for one in walk.sightings)

    assert content_of(after) == content_of(before)
    if name != "wigle":  # which has whole seconds, so that two places may have one time
        assert places(after) == places(before)
    _main(capsys, "export", tmp_path / "back.h5", "-o", tmp_path / "b", "--format", name)
    assert (tmp_path / "b").read_text() == (tmp_path / "a").read_text()


def test_parquet_has_types_and_units(tmp_path, run, capsys):
    _main(capsys, "export", run, "-o", tmp_path / "a.parquet")
    table = pq.read_table(tmp_path / "a.parquet")
    walk = walk_of_run(read_run(run))
    assert table["cid"].to_pylist() == [one.reading.cid for one in walk.sightings]
    assert table["level_dbm"].to_pylist() == [one.rssi_dbm for one in walk.sightings]
    assert table["lat_deg"].to_pylist() == [one.lat_deg for one in walk.sightings]
    assert [when.timestamp() * 1e9 for when in table["utc"].to_pylist()[:9]] == pytest.approx(
        [one.fix.utc_ns for one in walk.sightings[:9]], abs=1000
    )
    assert table.schema.field("rsrp_dbm").metadata[b"unit"] == b"dBm, LTE and later"
    columns = set(table.column_names)
    assert {f.name for f in fields(CellReading)} - columns == {"broadcast", "label", "more"}
    assert {f.name for f in fields(Broadcast)} <= columns


@pytest.mark.parametrize("name", names())
def test_nothing_of_the_walker_is_exported(tmp_path, run, capsys, name):
    _main(capsys, "export", run, "-o", tmp_path / "a", "--format", name)
    data = (tmp_path / "a").read_bytes()
    assert not [secret for secret in SECRETS if secret.encode() in data]
    assert read_run(run).meta.run_id.encode() not in data


@pytest.mark.parametrize("name", ["wigle", "opencellid-csv", "opencellid-json"])
def test_a_format_of_identities_says_that_a_run_has_none(tmp_path, capsys, name):
    (tmp_path / "a.csv").write_text(
        "time_utc,lat,lon,rssi_dbm,cell\n2024-05-14T09:00:00Z,52.0,13.0,-70,own\n"
    )
    _main(capsys, "import", tmp_path / "a.csv", "-o", tmp_path / "a.h5")
    output = _main(
        capsys, "export", tmp_path / "a.h5", "-o", tmp_path / "a", "--format", name, code=2
    )
    assert "no level has the complete identity of a cell" in output.err


@pytest.mark.parametrize("name", ["wigle", "opencellid-csv", "opencellid-json"])
def test_without_utc_a_format_that_needs_it_says_so(tmp_path, capsys, name):
    kit.write_run(tmp_path / "a.journal", seconds=20, cells=1, utc=False)
    output = _main(
        capsys, "export", tmp_path / "a.journal", "-o", tmp_path / "a", "--format", name, code=2
    )
    assert "needs UTC" in output.err
    assert not (tmp_path / "a").exists()
    output = _main(capsys, "export", tmp_path / "a.journal", "-o", tmp_path / "a.csv", "--json")
    assert json.loads(output.out)["left_out"] == ["times in UTC: the receiver never reported UTC"]


def test_a_track_alone_is_not_counted_as_levels(tmp_path, run, capsys):
    assert main(["export", str(run), "-o", str(tmp_path / "walk.gpx")]) == 0
    said = capsys.readouterr()
    assert ": 0 levels, " in said.out
    assert "left out: all levels: gpx has none" in said.err


def test_readings_without_a_level_are_counted(tmp_path, capsys):
    lines = [
        f"{i},52.5,13.4,{-60 if i % 3 else -120},GSM,262,01,4711,{7 + i % 2}" for i in range(60)
    ]
    text = "\n".join(["t_s,lat,lon,rssi_dbm,rat,mcc,mnc,lac,cid", *lines])
    (tmp_path / "walk.csv").write_text(text)
    _main(capsys, "import", tmp_path / "walk.csv", "-o", tmp_path / "run.h5")
    argv = "export", tmp_path / "run.h5", "-o", tmp_path / "a.csv"
    assert "left out: 20 readings without a level" in "".join(_main(capsys, *argv))
    said = json.loads(_main(capsys, *argv, "--cell", "262-01-4711-7", "--json").out)
    assert said["n_levels"] == 20
    assert "10 readings without a level" in said["left_out"]


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["-o", "a.xyz"], "--format"),
        (["-o", "a.json"], "--format"),
        (["-o", "a.parquet", "--estimates"], "measurements only"),
        (["walk.h5", "-o", "a.csv"], "one run a file"),
        (["-o", "none/a.csv"], "no such folder"),
        (["-o", "walk.h5", "--format", "csv"], "is a run"),
        (["-o", "a.csv", "--cell", "x"], "was not observed"),
    ],
)
def test_mistakes_are_one_line(tmp_path, run, capsys, monkeypatch, argv, says):
    monkeypatch.chdir(tmp_path)
    before = run.read_bytes()
    output = _main(capsys, "export", run, *argv, code=2)
    assert says in output.err
    assert output.err.count("\n") == 1
    assert run.read_bytes() == before


def test_estimates_are_computed_or_taken_from_beside_the_run(tmp_path, capsys):
    run = kit.write_run(tmp_path / "walk.journal", seconds=60, cells=1)
    output = _main(capsys, "export", run.path, "-o", tmp_path / "a.csv", "--estimates")
    assert "a.csv: 1 cell (csv)" in output.out
    assert "estimates are those of" not in output.err
    found = kit.sample_result(run)
    results.write(found, kit.json_of(found), results.path_beside([run.path]))
    output = _main(capsys, "export", run.path, "-o", tmp_path / "b.csv", "--estimates")
    assert "estimates are those of" in output.err
    (mine,), (stored,) = (rows_of(tmp_path / name) for name in ("a.csv", "b.csv"))
    assert mine["cell"] == stored["cell"] == kit.cell_name(0)
    assert mine["latitude_deg"] != stored["latitude_deg"]
    assert mine["word"] == "nothing unusual"


@pytest.fixture
def cells(tmp_path):
    """Cells with a place, without one, suspicious, and with names of which a spreadsheet must not
    run anything; the walk stands elsewhere.
    """
    run = kit.write_run(tmp_path / "=walk.journal", seconds=120, cells=5)
    result = kit.sample_result(run, verdict="ambiguous", places=2)
    first, *rest = (replace(cell, heard_utc_ns=(UTC0_NS, UTC0_NS + 10**9)) for cell in result.cells)
    names = ['=HYPERLINK("http://x")', "+1-2", "-2+3", "@SUM(1)"]
    named = [replace(first, cell=name) for name in names]
    rule = next(iter(RULES.values()))
    finding = Finding(rule, first.cell, 0, None, None, '=1+1, "a\nb"', {}, 9.0)
    words = {first.cell: answer.Word("suspicious", 9.0, (finding,), first.cell)}
    return replace(result, cells=(first, *named, *rest), words=words)


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_row_says_what_its_radii_suppose(tmp_path, cells):
    first, *others = cells.cells
    distant = replace(cells, cells=(kit.as_if_distant(first), *others))
    write_answers([distant], tmp_path / "cells.csv", "csv")
    of_first, *_, last = rows_of(tmp_path / "cells.csv")
    assert (of_first["supposition"], last["supposition"]) == ("if it is no distant mast", "")


def test_cells_come_back_from_csv(tmp_path, cells):
    exported, answers = write_answers([cells], tmp_path / "cells.csv", "csv")
    rows = rows_of(tmp_path / "cells.csv")
    assert exported.n_estimates == len(answers) == len(rows) == len(cells.cells)
    first, last = rows[0], rows[-1]
    place = cells.cells[0].place
    assert float(first["latitude_deg"]) == pytest.approx(place.lat, abs=1e-6)
    assert float(first["longitude_deg"]) == pytest.approx(place.lon, abs=1e-6)
    assert float(first["r50_m"]) == pytest.approx(place.r50_m, abs=0.05)
    assert float(first["r95_m"]) == pytest.approx(place.r95_m, abs=0.05)
    assert (first["word"], first["verdict"], first["n_places"]) == ("suspicious", "ambiguous", "2")
    assert (first["first_utc"], first["last_utc"]) == (
        "2026-09-21T14:13:20Z",
        "2026-09-21T14:13:21Z",
    )
    assert (last["latitude_deg"], last["word"], last["n_places"]) == ("", "", "0")
    walk = walk_of_run(cells.runs[0].run).sightings[0]
    assert abs(float(first["latitude_deg"]) - walk.lat_deg) > 1e-4  # the cell's, not the walk's
    # nothing that a spreadsheet would take for a formula
    for value in (
        value for row in rows for name, value in row.items() if not name.endswith("_deg")
    ):
        assert not value.startswith(("=", "+", "-", "@"))
    assert [row["cell"] for row in rows[1:5]] == [f"'{cell.cell}" for cell in cells.cells[1:5]]


def test_every_estimator_stands_in_columns_of_its_own(tmp_path, cells):
    write_answers([cells], tmp_path / "cells.csv", "csv", every=True)
    rows = rows_of(tmp_path / "cells.csv")
    end = cells.answer(cells.cells[0]).paths.ends["ekf"]
    assert rows[0]["ekf_latitude_deg"] == str(round(end.lat, 6))  # as the position of the cell
    assert rows[-1]["ekf_latitude_deg"] == ""


def test_cells_come_back_from_geopandas(tmp_path, cells):
    geopandas = pytest.importorskip("geopandas", reason="GeoPandas comes with `survey`")
    pyogrio = pytest.importorskip("pyogrio", reason="GeoPandas comes with `survey`")
    kinds = {"geojson": {"Point"}, "kml": {"Point", "MultiPolygon"}, "gpx": {"Point"}}
    for name, expected in kinds.items():
        path = tmp_path / f"cells.{name}"
        write_answers([cells], path, name)
        seen = set()
        for layer, _ in pyogrio.list_layers(path):
            frame = geopandas.read_file(path, layer=layer)
            kind = set(frame.geometry.dropna().geom_type)
            assert len(kind) <= 1, (name, layer)
            seen |= kind
            if name != "gpx" and layer.startswith("cells"):
                assert frame["cell"].iloc[0] == cells.cells[0].cell
                assert frame["r95_m"].dtype == float
                assert frame.crs == "EPSG:4326"
                assert len(frame) == len(cells.cells)
        assert seen == expected


def test_cells_come_back_from_ogrinfo(tmp_path, cells):
    if which("ogrinfo") is None:
        pytest.skip("ogrinfo is not installed: apt-get install gdal-bin")
    write_answers([cells], tmp_path / "cells.geojson", "geojson")
    write_answers([cells], tmp_path / "cells.csv", "csv")
    for name, says in (("geojson", "Geometry: Point"), ("csv", "longitude_deg")):
        command = ["ogrinfo", "-so", "-al", tmp_path / f"cells.{name}"]
        out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert says in out
        assert f"Feature Count: {len(cells.cells)}" in out


def test_cells_of_several_results_are_in_one_file(tmp_path, cells):
    exported, _ = write_answers([cells, cells], tmp_path / "cells.csv", "csv")
    assert exported.n_estimates == len(rows_of(tmp_path / "cells.csv")) == 2 * len(cells.cells)


def test_a_run_without_a_fix_has_nothing_to_export(tmp_path, capsys):
    writer = RunWriter(tmp_path / "a.journal", meta())
    writer.append(Record(0, "modem", Scan(0, (CellReading("serving", rssi_dbm=-70.0, label="x"),))))
    writer.close(0, "test")
    assert (
        "no position fix"
        in _main(capsys, "export", tmp_path / "a.journal", "-o", tmp_path / "a.kml", code=2).err
    )
