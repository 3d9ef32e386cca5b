import json
from dataclasses import replace

import pytest

from logger.core.runfile import convert_journal, finish_journal, read_run
from logger.core.types import Fix, Note, Record, Scan
from postproc.cli import main
from tests.kit import runs

HEADER = "t_s,lat,lon,rssi_dbm,cell,acc_m,rat,remark\n"


def _fails(capsys, *argv):
    assert main([str(a) for a in argv]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 1, errors
    return errors[0]


def _json(capsys, *argv):
    assert main([str(a) for a in (*argv, "--json")]) == 0
    return json.loads(capsys.readouterr().out)


def _run(tmp_path, records, name="run.h5"):
    runs.write_journal(tmp_path / "a.journal", records)
    convert_journal(tmp_path / "a.journal", tmp_path / name)
    (tmp_path / "a.journal").unlink()
    return tmp_path / name


@pytest.fixture
def csv(tmp_path):
    def write(text):
        (tmp_path / "walk.csv").write_text(text)
        return tmp_path / "walk.csv"

    return write


def test_info_of_both_forms(tmp_path, capsys):
    runs.write_journal(tmp_path / "a.journal", runs.records(30), close=False)
    cut = _json(capsys, "info", tmp_path / "a.journal")
    assert (cut["form"], cut["stopped"], cut["n_fixes"], cut["n_readings"]) == (
        "journal",
        None,
        30,
        60,
    )
    assert cut["started_utc"] == "2026-09-21T14:13:20Z"
    assert [cell["cell"] for cell in cut["cells"]] == ["262-01-4711-1", "262-01-4711-2"]
    finished = _json(capsys, "info", finish_journal(tmp_path / "a.journal"))
    assert {k: v for k, v in finished.items() if k not in {"path", "form"}} == {
        k: v for k, v in cut.items() if k not in {"path", "form"}
    }
    assert main(["info", str(tmp_path / "a.h5")]) == 0
    assert "the plug was pulled" in capsys.readouterr().out


def test_times_that_contradict_each_other_are_not_called_missing(tmp_path, capsys):
    """A receiver whose date is a day behind in some fixes."""
    stream = runs.records(30)
    for k, record in enumerate(stream):
        if isinstance(record.value, Fix) and k % 2:
            fix = replace(record.value, utc_ns=record.value.utc_ns - 86_400 * 10**9)
            stream[k] = replace(record, value=fix)
    runs.write_journal(tmp_path / "a.journal", stream)
    why = "the times of the receiver contradict each other"
    assert main(["info", str(tmp_path / "a.journal")]) == 0
    assert f"at an unknown time ({why})" in capsys.readouterr().out
    argv = "export", tmp_path / "a.journal", "-o", tmp_path / "a"
    assert _json(capsys, *argv, "--format", "csv")["left_out"] == [f"times in UTC: {why}"]
    assert main([*map(str, argv), "--format", "wigle"]) == 2
    assert f"the format needs UTC, and {why}" in capsys.readouterr().err


def test_recover_makes_hdf5_of_a_cut_journal(tmp_path, capsys):
    runs.write_journal(tmp_path / "a.journal", runs.records(30), close=False)
    assert main(["recover", str(tmp_path / "a.journal")]) == 0
    assert len(read_run(tmp_path / "a.h5").tables["fixes"]) == 30


def test_import_reads_what_the_contract_says(csv, tmp_path, capsys):
    text = (
        HEADER
        + "3,52.0,13.0002,-72,,,,\n1,52.0,13.0,-70.5,a,4,2G,hello\n2,52.0,13.0001,-71,b,,LTE,\n"
    )
    output = _json(capsys, "import", csv(text), "-o", tmp_path / "run.h5")
    assert (output["rows"], output["sorted"], output["bad_rows"]) == (3, True, [])
    run = read_run(tmp_path / "run.h5")
    values = [record.value for _, record in run.records("fixes", "scans")]
    fixes = [value for value in values if isinstance(value, Fix)]
    cells = [value.readings[0] for value in values if isinstance(value, Scan)]
    assert [(f.lat_deg, f.lon_deg, f.acc_m) for f in fixes] == [
        (52.0, 13.0, 4.0),
        (52.0, 13.0001, None),
        (52.0, 13.0002, None),
    ]
    assert [(c.cell, c.rat, c.rssi_dbm) for c in cells] == [
        ("a", "GSM", -70.5),
        ("b", "LTE", -71.0),
        ("target", None, -72.0),
    ]


def test_import_of_iso_times(csv, tmp_path, capsys):
    text = (
        "time_utc,lat,lon,rssi_dbm\n2026-03-01T12:00:00Z,52,13,-70\n"
        "2026-03-01T13:00:01.5+01:00,52,13,-71\n"
    )
    main(["import", str(csv(text)), "-o", str(tmp_path / "run.h5")])
    capsys.readouterr()
    info = _json(capsys, "info", tmp_path / "run.h5")
    assert (info["started_utc"], info["duration_s"]) == ("2026-03-01T12:00:00Z", 1.5)


def test_import_names_bad_rows_by_line(csv, tmp_path, capsys):
    rows = [
        "0,52,13,-70",
        "x,52,13,-70",
        "2,95,13,-70",
        "3,52,13,",
        "4,52,13,nan",
        "5,52",
        "6,52,13,-999",
        "7,86,13,-70",
        "",
    ]
    output = _json(
        capsys, "import", csv("t_s,lat,lon,rssi_dbm\n" + "\n".join(rows)), "-o", tmp_path / "run.h5"
    )
    assert [bad["line"] for bad in output["bad_rows"]] == [3, 4, 6, 7, 8, 9]
    assert "no number" in output["bad_rows"][0]["why"]
    assert "84 deg" in output["bad_rows"][5]["why"]
    assert (output["rows"], output["position_rows"]) == (1, 1)
    notes = [
        r.value
        for _, r in read_run(tmp_path / "run.h5").records("notes")
        if isinstance(r.value, Note)
    ]
    assert sum(note.code == "bad-row" for note in notes) == 6


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t_s,lat,lon,rssi_dbm\n", "no usable row"),
        ("", "I read an empty file"),
        ("lat,lon,rssi_dbm\n1,2,3\n", "level is 3"),
        ("t_s,lat,lon\n1,2,3\n", "rssi_dbm"),
        ("t_s,lat,lon,rssi_dbm\n1,2,3,x\n", "line 2: rssi_dbm is no number"),
    ],
)
def test_import_of_what_is_no_walk(csv, tmp_path, capsys, text, says):
    assert says in _fails(capsys, "import", csv(text), "-o", tmp_path / "run.h5")
    assert not (tmp_path / "run.h5").exists()


def test_nothing_but_an_earlier_import_is_overwritten(csv, tmp_path, capsys):
    walk = csv("t_s,lat,lon,rssi_dbm\n0,52,13,-70\n")
    for _ in range(2):
        assert main(["import", str(walk), "-o", str(tmp_path / "run.h5")]) == 0
    capsys.readouterr()
    recorded = _run(tmp_path, runs.records(3), "walk.h5")
    for precious in (recorded, walk):
        before = precious.read_bytes()
        assert str(precious) in _fails(capsys, "import", walk, "-o", precious)
        assert precious.read_bytes() == before
    assert ".rrd" in _fails(capsys, "view", recorded, "--save", recorded)


def test_a_run_where_nothing_can_be_written_is_answered_all_the_same(tmp_path, capsys):
    path = _run(tmp_path, runs.records(2))
    (tmp_path / "run.post.h5").mkdir()
    assert main(["smooth", str(path), "--json"]) == 3
    output = capsys.readouterr()
    assert json.loads(output.out)["cells"]
    assert "cannot write" in output.err


def test_import_to_nowhere(csv, tmp_path, capsys):
    assert "no such folder" in _fails(capsys, "import", csv("x"), "-o", tmp_path / "none/run.h5")
    assert "No such file" in _fails(
        capsys, "import", tmp_path / "none.csv", "-o", tmp_path / "run.h5"
    )


CONTRACT = {
    "cell",
    "n",
    "best",
    "modes",
    "region95",
    "reference_ekf",
    "ekf",
    "rts",
    "batch",
    "verdict",
    "warnings",
}
BEST = {"lat", "lon", "r50_m", "r95_m", "drms_m", "may_be_distant", "strongest"}
BEST |= {"p0_dbm", "p0_sigma_db", "eta", "eta_sigma"}


def test_smooth_keeps_its_contract_and_the_run(tmp_path, capsys):
    path = _run(tmp_path, runs.records(40))
    before = path.read_bytes()
    found = _json(capsys, "smooth", path)
    assert path.read_bytes() == before
    assert (tmp_path / "run.post.h5").exists()
    assert found["run"]["n_fixes"] == 40
    for cell in found["cells"]:
        assert set(cell) >= CONTRACT
        assert set(cell["best"]) == BEST
        assert cell["verdict"] in {"located", "ambiguous", "cannot tell"}
        assert sum(mode["probability"] for mode in cell["modes"]) <= 1.0 + 1e-9
        assert set(cell["modes"][0]["ellipse95"]) == {"semi_major_m", "semi_minor_m", "azimuth_deg"}
        assert cell["region95"]["geojson"]["type"] in {"Polygon", "MultiPolygon"}
        assert cell["region95"]["area_m2"] > 0
        assert cell["n"] == 40
    # forty seconds past two cells whose levels hardly change say nothing
    assert {cell["verdict"] for cell in found["cells"]} == {"cannot tell"}
    assert main(["smooth", str(path), "--cell", "262-01-4711-1"]) == 0
    assert "cannot tell" in capsys.readouterr().out
    assert "was not observed" in _fails(capsys, "smooth", path, "--cell", "none")


@pytest.mark.parametrize(
    ("records", "says"),
    [
        ([], "no position fix"),
        ([Record(1, "modem", Scan(0, (runs.reading(1, -70.0),)))], "no position fix"),
        ([Record(1, "gnss", Fix(True, None, 52.0, 13.0))], "no cell with an identity"),
    ],
)
def test_runs_that_hold_no_answer_say_so(tmp_path, capsys, records, says):
    path = _run(tmp_path, records)
    found = _json(capsys, "smooth", path)
    assert any(says in warning for warning in found["run"]["warnings"])
    assert {cell["verdict"] for cell in found["cells"]} <= {"cannot tell"}
    for command in ("info", "replay", "smooth"):
        assert main([command, str(path)]) == 0
    capsys.readouterr()


def test_a_cell_seen_twice_cannot_be_told(tmp_path, capsys):
    path = _run(tmp_path, runs.records(2))
    cell, _ = _json(capsys, "smooth", path)["cells"]
    assert (cell["n"], cell["verdict"], cell["best"]["lat"]) == (2, "cannot tell", None)
    assert "only 2 readings" in cell["warnings"][0]


def test_results_that_a_pattern_names_are_no_runs(tmp_path, capsys):
    run = _run(tmp_path, runs.records(30))
    assert main(["smooth", str(run)]) == 0
    capsys.readouterr()
    (stored,) = tmp_path.glob("*.post.h5")
    said = _fails(capsys, "suspect", stored)
    assert said.endswith("holds results of `postproc smooth`: name the run beside it")
    assert main(["suspect", str(run), str(stored)]) == 0
    assert capsys.readouterr().err == f"left out, as results are no runs: {stored.name}\n"


def test_a_number_or_a_name_without_its_end_is_understood(tmp_path, capsys):
    run = _run(tmp_path, runs.records(2), "run-000017.h5")
    for name in ("17", "run-000017"):
        said = _fails(capsys, "info", tmp_path / name)
        assert said == f"postproc: {tmp_path / name}: no such file; did you mean {run}?"
    assert _fails(capsys, "info", tmp_path / ("x" * 255)).endswith(": no such file")


def test_a_dash_is_no_file_to_write(tmp_path, capsys):
    run = _run(tmp_path, runs.records(2))
    assert "'-' names no file" in _fails(capsys, "export", run, "-o", "-", "--format", "csv")


@pytest.mark.parametrize("command", ["info", "replay", "smooth", "view", "plot", "recover"])
def test_a_text_file_given_as_run_is_one_line(tmp_path, capsys, command):
    (tmp_path / "run.h5").write_text("lat,lon\n1,2\n")
    said = _fails(capsys, command, tmp_path / "run.h5")
    assert "no cellwalk run; `postproc import` makes one of a log" in said


def test_polar_run_is_refused_in_one_line(tmp_path, capsys):
    path = _run(
        tmp_path,
        [
            Record(0, "gnss", Fix(True, None, 88.0, 0.0)),
            Record(1, "m", Scan(0, (runs.reading(1, -7.0),))),
        ],
    )
    assert "84 deg" in _fails(capsys, "smooth", path)


def test_replay_tells_of_a_difference(tmp_path, capsys):
    from logger.core.types import LiveEstimate

    wrong = LiveEstimate(2, "reference-ekf", "262-01-4711-1", 1, 33, *[1.0] * 17)
    found = [*runs.records(3), Record(9, "live", wrong)]
    assert main(["replay", str(_run(tmp_path, found)), "--json"]) == 1
    output = json.loads(capsys.readouterr().out)
    assert (output["equal"], output["n_recorded"]) == (False, 1)
