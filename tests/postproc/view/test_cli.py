import json
import subprocess
import sys
from pathlib import Path

import pytest

from logger.core.runfile import finish_journal, read_run
from logger.core.types import Fix
from postproc import verify
from postproc.cli import main
from postproc.result import Options
from postproc.view.cli import _view_model
from tests.kit import runs
from tests.kit import sample_results as kit
from tests.kit.rerun_recordings import chunks, rows, static_columns
from tests.kit.vector_tiles import write_pmtiles
from tests.postproc.test_multi_run import BENT, record_walk

SHOWN, OTHER = kit.cell_name(0), kit.cell_name(1)


def write(path, **wishes):
    kit.write_run(path, seconds=60, cells=2, **wishes)
    return finish_journal(path)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return write(tmp_path_factory.mktemp("view") / "one.journal")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Starting another process takes longer than these walks, and few steps show as much."""
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    monkeypatch.setattr("postproc.view.view_model.MOST_STEPS", 3)


@pytest.fixture
def fails(capsys):
    def fail(*argv):
        assert main(["view", *map(str, argv)]) == 2
        (error,) = capsys.readouterr().err.splitlines()
        return error

    return fail


def test_a_run_is_saved_with_the_cell_that_has_most_to_tell(run, tmp_path, capsys):
    saved = tmp_path / "x.rrd"
    assert main(["view", str(run), "--save", str(saved), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "path": str(saved),
        "bytes": saved.stat().st_size,
    }
    entities = chunks(saved)
    assert f"/plan/cells/{SHOWN}/posterior/region95" in entities
    assert not any(entity.startswith(f"/plan/cells/{OTHER}") for entity in entities)
    assert f"/rssi/{OTHER}" in entities


def test_the_answer_shown_is_the_one_that_smooth_stored_with_the_same_options(tmp_path, capsys):
    own, options = write(tmp_path / "own.journal"), ["--height", "20", "--within", "400"]
    assert main(["smooth", str(own), *options]) == 0
    capsys.readouterr()
    saved = tmp_path / "x.rrd"
    assert main(["view", str(own), "--save", str(saved), *options]) == 0
    assert "estimates are those of" in capsys.readouterr().err
    assert main(["view", str(own), "--save", str(saved)]) == 0
    assert "is not used" in capsys.readouterr().err


def test_several_cells_with_claims(run, tmp_path):
    saved = tmp_path / "x.rrd"
    cells = ["--cell", SHOWN, "--cell", OTHER]
    assert main(["view", str(run), *cells, "--claim", "-52.5,13.4,50", "--save", str(saved)]) == 0
    entities = chunks(saved)
    for cell in (SHOWN, OTHER):
        assert f"/report/{cell}" in entities
        assert f"/plan/cells/{cell}/levels" in entities


def test_modems_of_one_run_are_told_apart(tmp_path):
    run, saved = record_walk(tmp_path / "two.h5", BENT, second_db=-9.0), tmp_path / "x.rrd"
    assert main(["view", str(run), "--save", str(saved)]) == 0
    (report,) = [entity for entity in chunks(saved) if str(entity).startswith("/report/")]
    text = rows(static_columns(saved, report), ":text")[0][0]
    for number in (1, 2):
        assert f"{run.name} (modem {number} of 2) contributed 100 readings" in text


def test_several_runs_are_one_walk(tmp_path):
    paths = [tmp_path / name / "run-000001.journal" for name in ("one", "two")]
    for i, path in enumerate(paths):
        path.parent.mkdir()
        runs.write_journal(path, runs.on_another_day(runs.records(30), i), run_id=str(i) * 32)
    saved, cell = tmp_path / "x.rrd", "262-01-4711-1"
    argv = [*map(str, paths), "--cell", cell]
    assert main(["view", *argv, "--save", str(saved)]) == 0
    entities = chunks(saved)
    for name in ("one", "two"):
        assert rf"/plan/walks/{name}\/run-000001.journal/track" in entities
    assert [chunk.num_rows for chunk in entities[f"/rssi/{cell}"] if not chunk.is_static] == [
        30,
        30,
    ]
    assert [chunk.num_rows for chunk in entities["/plan/walker"] if not chunk.is_static] == [30, 30]
    text = rows(static_columns(saved, f"/report/{cell}"), ":text")[0][0]
    assert "run-000001.journal contributed 30 readings" in text
    assert "without it: cannot tell" in text
    assert main(["view", *argv, "--claim", "52,13", "--save", str(saved)]) == 0


@pytest.mark.parametrize(
    ("argv", "why"),
    [
        (["--save", "x.txt"], "named .rrd"),
        (["--save", "x.rrd", "--port", "80"], "--port goes with --web"),
        (["--save", "x.rrd", "--cell", "nowhere"], "was not observed"),
        (["--save", "x.rrd", "--claim", "north"], "is no position: LAT,LON or LAT,LON,SIGMA_M"),
        (["--save", "x.rrd", "--claim", "95,0"], "latitude"),
        (["--save", "x.rrd", "--basemap", "absent.png"], "no such file"),
        (["--save", "absent/x.rrd"], "no such folder"),
    ],
)
def test_a_mistake_is_one_line(argv, why, run, fails, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert why in fails(run, *argv)
    assert list(tmp_path.iterdir()) == []


def test_claims_about_other_cells_are_not_passed_over(run, fails, tmp_path):
    (tmp_path / "claims.csv").write_text("cell,lat,lon\n262-01-1-1,52.5,13.4\n")
    assert f"claims nothing about {SHOWN}" in fails(
        run, "--claims", tmp_path / "claims.csv", "--save", tmp_path / "x.rrd"
    )


def test_claims_of_a_file_are_drawn(run, tmp_path):
    (tmp_path / "claims.csv").write_text(f"cell,lat,lon,sigma_m\n{SHOWN},52.5,13.4,25\n")
    saved = tmp_path / "x.rrd"
    assert (
        main(["view", str(run), "--claims", str(tmp_path / "claims.csv"), "--save", str(saved)])
        == 0
    )
    assert f"/plan/cells/{SHOWN}/claims/1/two_sigma" in chunks(saved)


def test_claims_are_tested_with_those_about_all_cells(run, tmp_path):
    (tmp_path / "claims.csv").write_text(f"cell,lat,lon\n{SHOWN},52.5,13.4\n{OTHER},52.5,13.4\n")
    tested = verify(run, tmp_path / "claims.csv").cells[0]
    assert tested.q > tested.p
    model = _view_model([read_run(run)], (), Options(), (), tmp_path / "claims.csv")
    assert [claim.q for claim in model.cell_views[0].claims] == [tested.q]


def test_a_missing_screen_is_reported_before_estimating(run, fails, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("postproc.view.cli._view_model", lambda *_: pytest.fail("estimated"))
    assert "--web" in fails(run)


WITHOUT_RERUN = """
import sys
from pathlib import Path
sys.modules["rerun"] = None
from postproc.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(("command", "code"), [("view", 2), ("info", 0)])
def test_everything_else_works_without_rerun(command, code, run, tmp_path):
    argv = [sys.executable, "-c", WITHOUT_RERUN, command, str(run)]
    done = subprocess.run(argv, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    if command == "view":
        assert done.stderr.count("\n") == 1
        assert "cellwalk[view]" in done.stderr


# --- a recording that was saved ---

VIEWER = """#!/bin/sh
[ "$1" = analytics ] && exit 0
for last; do :; done
echo "$*" > {folder}/call
cp "$last" {folder}/shown
"""


@pytest.fixture
def viewer(tmp_path, monkeypatch):
    """A stand-in for the viewer that keeps what it was given."""
    program = tmp_path / "rerun"
    program.write_text(VIEWER.format(folder=tmp_path))
    program.chmod(0o755)
    monkeypatch.setattr("postproc.view.viewer.binary", lambda: program)
    monkeypatch.setenv("DISPLAY", ":0")
    return tmp_path


def test_what_was_saved_is_shown_on_this_machine_only(run, viewer, capsys):
    saved = viewer / "x.rrd"
    assert main(["view", str(run), "--save", str(saved)]) == 0
    assert capsys.readouterr().out.strip() == f"{saved}: `postproc view {saved}` opens it"
    assert main(["view", str(saved)]) == 0
    assert (viewer / "shown").read_bytes() == saved.read_bytes()
    assert "--bind 127.0.0.1" in (viewer / "call").read_text()


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["a.rrd", "b.rrd"], "one recording (.rrd) alone"),
        (["a.rrd", "RUN"], "one recording (.rrd) alone"),
        (["a.rrd", "--cell", "x"], "--cell goes with a run"),
        (["a.rrd", "--claim", "52,13"], "--claim goes with a run"),
        (["a.rrd", "--save", "c.rrd"], "--save goes with a run"),
        (["a.rrd", "--reach", "far"], "its estimates do not change"),
        (["a.rrd", "--within-walk", "100"], "its estimates do not change"),
        (["b.rrd"], "not a rerun recording"),
        (["none.rrd"], "No such file"),
    ],
)
def test_a_recording_takes_no_options_of_a_run(run, viewer, monkeypatch, fails, argv, says):
    monkeypatch.chdir(viewer)
    (viewer / "a.rrd").write_bytes(b"RRF2....")
    (viewer / "b.rrd").write_bytes(b"lat,lon")
    assert says in fails(*(run if word == "RUN" else word for word in argv))
    assert not (viewer / "call").exists()


def test_no_text_of_ours_sends_people_to_the_bare_viewer():
    """It counts its users and listens on all interfaces."""
    for name in ("README.md", "Makefile"):
        text = (Path(__file__).parents[3] / name).read_text()
        assert "bin/rerun" not in text
        assert "rerun run.rrd" not in text


def test_a_basemap_that_is_not_drawn_is_reported(tmp_path, capsys):
    walk = tmp_path / "lost.journal"
    runs.write_journal(walk, [one for one in runs.records(10) if not isinstance(one.value, Fix)])
    write_pmtiles(tmp_path / "ground.pmtiles", {(14, 3, 3): b""})
    saved = ["--save", str(tmp_path / "lost.rrd"), "--basemap", str(tmp_path / "ground.pmtiles")]
    assert main(["view", str(walk), *saved]) == 0
    assert "ground.pmtiles is not drawn: the walk has no position\n" in capsys.readouterr().err
