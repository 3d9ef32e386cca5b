"""Stored results are used where they are what would be computed, and nowhere else."""

import errno
import os
import subprocess
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from logger.core.errors import RunFileError
from logger.core.model.prior import prior_for
from logger.core.runfile import read_sound_run
from postproc import results
from postproc.cli import main
from postproc.result import Options
from postproc.results import encode
from postproc.smoothing import smooth_runs
from tests.kit import sample_results as kit
from tests.kit.faulty_card import small_file_system

SECONDS = 120


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """A run with two cells and its result, stored beside it."""
    folder = tmp_path_factory.mktemp("walk")
    kit.write_run(folder / "walk.journal", seconds=SECONDS, cells=2)
    run = read_sound_run(folder / "walk.journal")
    result = smooth_runs([run])
    path = results.path_beside([run.path])
    results.write(result, kit.json_of(result), path)
    return run, result, path


@pytest.fixture
def copy(walk, tmp_path):
    """A copy of both files, to be changed."""
    run, _, path = walk
    for source in (run.path, path):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    return tmp_path / run.path.name


def assert_equal(found, expected):
    """Values and arrays are equal in every bit."""
    (values, arrays), (expected_values, expected_arrays) = encode(found), encode(expected)
    assert values == expected_values
    assert arrays.keys() == expected_arrays.keys()
    for name, array in expected_arrays.items():
        assert arrays[name].dtype == array.dtype
        assert arrays[name].tobytes() == array.tobytes(), name


def why_not(path, run, only=None, options=Options()):
    with pytest.raises(results.NotStored) as reason:
        results.read(path, [run], only, options)
    return str(reason.value)


def test_a_stored_result_is_the_computed_one(walk):
    run, result, path = walk
    stored = results.read(path, [run], None, Options())
    assert_equal(stored, result)
    assert stored.cells[0].posterior.modes[0].ellipse == result.cells[0].posterior.modes[0].ellipse
    assert kit.json_of(stored) == kit.json_of(result)


def test_nothing_is_left_on_a_full_disk(walk, tmp_path, monkeypatch):
    """Asked before: HDF5 ends with a segmentation fault where a file cannot be closed."""
    _, result, path = walk
    room = path.stat().st_size - 1
    disk = SimpleNamespace(free=room)
    monkeypatch.setattr(results.shutil, "disk_usage", lambda _: disk)
    with pytest.raises(RunFileError, match=f"cannot write .*: {os.strerror(errno.ENOSPC)}"):
        results.write(result, kit.json_of(result), tmp_path / "a.post.h5")
    assert not list(tmp_path.iterdir())


def test_it_holds_for_some_of_its_cells(walk):
    run, _, path = walk
    name = kit.cell_name(1)
    assert_equal(results.read(path, [run], [name], Options()), smooth_runs([run], [name]))


def test_several_runs(walk, tmp_path):
    first = walk[0]
    second = kit.write_run(
        tmp_path / "b.journal", seconds=SECONDS, cells=1, run_id="b", config_text="[modem]"
    )
    runs = [first, read_sound_run(second.path)]
    result = smooth_runs(runs, [kit.cell_name(0)])
    assert result.cells[0].without
    results.write(result, kit.json_of(result), tmp_path / "x.h5", [kit.cell_name(0)])
    for named in (runs, runs[::-1]):
        stored = results.read(tmp_path / "x.h5", named, [kit.cell_name(0)], Options())
        assert_equal(stored, result)
        assert [one.run.path for one in stored.runs] == [run.path for run in runs]
    why = why_not(tmp_path / "x.h5", first)
    assert why == "it was made from other data"
    with pytest.raises(results.NotStored, match="lacks the cell"):
        results.read(tmp_path / "x.h5", runs, None, Options())


def test_a_run_that_was_changed_is_estimated_again(walk):
    run, _, path = walk
    readings = run.tables["readings"].copy()
    readings["rssi_dbm"][7] += 1.0
    changed = replace(run, tables={**run.tables, "readings": readings})
    assert why_not(path, changed) == "it was made from other data"


@pytest.mark.parametrize(
    "options",
    [
        Options(prior_for("urban")),
        Options(prior_for("any", height_m=30.0)),
        Options(prior_for("any", antenna="sector")),
        Options(loss="huber"),
    ],
)
def test_other_options_are_estimated_with(walk, options):
    run, _, path = walk
    assert why_not(path, run, options=options) == "it was made with other options"


def test_another_version_of_the_program_estimates_again(walk, monkeypatch):
    run, _, path = walk
    monkeypatch.setattr(results, "program_digest", lambda: "0.0.1 0123456789abcdef")
    assert why_not(path, run) == "it is of another version of the program"


def test_the_program_is_known_by_its_source(monkeypatch, tmp_path):
    before = results.program_digest()
    (tmp_path / "estimators").mkdir()
    (tmp_path / "estimators" / "new.py").write_text("")
    monkeypatch.setattr(results, "__file__", str(tmp_path / "results.py"))
    results.program_digest.cache_clear()
    try:
        assert results.program_digest() != before
    finally:
        results.program_digest.cache_clear()


def test_without_a_file_there_is_nothing_to_tell(walk, tmp_path):
    assert why_not(tmp_path / "none.h5", walk[0]) == ""


@pytest.mark.parametrize("what", ["values", "array", "digest", "half", "no HDF5", "a run"])
def test_a_damaged_file_is_not_trusted(walk, tmp_path, what):
    run, result, path = walk
    content = bytearray(path.read_bytes())
    match what:
        case "values":
            content[content.index(encode(result)[0][-64:]) + 8] ^= 1
        case "array":
            content[content.index(result.cells[1].residuals.residual_db.tobytes()) + 80] ^= 1
        case "digest":
            with h5py.File(path) as file:
                content[content.index(file.attrs["digest"].encode())] ^= 1
        case "half":
            del content[len(content) // 2 :]
        case "no HDF5":
            content[:8] = bytes(8)
        case "a run":
            content = bytearray(run.path.read_bytes())
    (tmp_path / "x.h5").write_bytes(content)
    assert why_not(tmp_path / "x.h5", run).startswith("it is damaged")


@pytest.mark.parametrize("link", ["external", "soft", "itself", "text", "no values"])
def test_a_file_made_to_deceive_is_not_trusted(walk, copy, link):
    run, _, path = walk
    target = results.path_beside([copy])
    with h5py.File(target, "r+") as file:
        name = "values" if link == "no values" else "cells/0/residuals/residual_db"
        del file[name]
        match link:
            case "external":
                file[name] = h5py.ExternalLink(str(path), name)
            case "soft":
                file[name] = h5py.SoftLink("/cells/0/obs/x_m")
            case "itself":
                file[name] = file["cells"]
            case "text":
                file[name] = np.bytes_(b"x" * 500)
    assert why_not(target, run).startswith("it is damaged")


COMMANDS = {
    "report": ["report", "RUN", "-o", "OUT.html"],
    "plot": ["plot", "RUN", "-o", "OUT.png"],
    "view": ["view", "RUN", "--save", "OUT.rrd"],
    "export": ["export", "RUN", "--estimates", "-o", "OUT.kml"],
    "verify": ["verify", "RUN", "--claim", "52.5,13.4"],
}


def _run(command, run, folder):
    words = {"RUN": str(run)}
    return main([words.get(w, w.replace("OUT", str(folder / "out"))) for w in COMMANDS[command]])


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_use_what_smooth_has_stored(copy, tmp_path, capsys, monkeypatch, command):
    monkeypatch.setattr(
        "postproc.smoothing.smooth_runs", lambda *_, **__: pytest.fail("estimated again")
    )
    assert _run(command, copy, tmp_path) == 0
    assert f"estimates are those of {results.path_beside([copy])}" in capsys.readouterr().err


def test_the_order_of_runs_does_not_matter(copy, tmp_path, capsys, monkeypatch):
    kit.write_run(tmp_path / "a.journal", seconds=SECONDS, cells=1, run_id="e" * 32)
    named = [str(copy), str(tmp_path / "a.journal")]
    assert main(["smooth", *named]) == 0
    monkeypatch.setattr(
        "postproc.smoothing.smooth_runs", lambda *_, **__: pytest.fail("estimated again")
    )
    for order in (named, named[::-1]):
        capsys.readouterr()
        assert main(["report", *order, "-o", str(tmp_path / "out.html")]) == 0
        assert f"those of {tmp_path / 'a.together.post.h5'}" in capsys.readouterr().err


def test_a_page_from_stored_results_is_the_same(copy, walk, tmp_path, capsys):
    assert _run("report", copy, tmp_path) == 0
    results.path_beside([copy]).rename(tmp_path / "away.h5")
    (tmp_path / "out.html").rename(tmp_path / "stored.html")
    assert _run("report", copy, tmp_path) == 0
    assert (tmp_path / "out.html").read_bytes() == (tmp_path / "stored.html").read_bytes()


def test_a_command_tells_why_it_estimates_again(copy, tmp_path, capsys):
    argv = ["export", str(copy), "--estimates", "-o", str(tmp_path / "a.kml")]
    with h5py.File(results.path_beside([copy]), "r+") as file:
        file["values"][5] ^= 1
    assert main([*argv, "--cell", kit.cell_name(1)]) == 0
    output = capsys.readouterr().err.splitlines()
    assert [line for line in output if "post.h5" in line] == [
        f"{results.path_beside([copy])} is not used: it is damaged"
    ]


def test_a_few_cells_are_those_that_are_stored_and_do_not_replace_all(copy, capsys, monkeypatch):
    stored = results.path_beside([copy]).read_bytes()
    with monkeypatch.context() as patched:
        patched.setattr("postproc.smoothing.smooth_runs", lambda *_, **__: pytest.fail("estimated"))
        assert main(["smooth", str(copy), "--cell", kit.cell_name(1)]) == 0
    assert f"estimates are those of {results.path_beside([copy])}" in capsys.readouterr().err
    assert main(["smooth", str(copy), "--cell", kit.cell_name(1), "--height", "5"]) == 0
    assert results.path_beside([copy]).read_bytes() == stored


def test_smooth_always_estimates(copy, monkeypatch, capsys):
    monkeypatch.setattr("postproc.smoothing.smooth_runs", lambda *_, **__: pytest.fail("estimated"))
    with pytest.raises(BaseException, match="estimated"):
        main(["smooth", str(copy)])


def test_equal_results_are_equal(walk):
    run, result, path = walk
    stored = results.read(path, [run], None, Options())
    assert stored == result
    assert stored.cells[0] == result.cells[0]
    assert result.cells[0] != result.cells[1]
    assert result != replace(result, options=Options(within_m=60.0))
    assert result != "a result"


def test_where_nothing_can_be_stored_the_answer_is_given(walk, tmp_path, capsys):
    run, _, _ = walk
    with small_file_system(tmp_path / "card", "size=8m") as card:
        (card / run.path.name).write_bytes(run.path.read_bytes())
        subprocess.run(["mount", "-o", "remount,ro", card], check=True)
        assert main(["smooth", str(card / run.path.name)]) == 3
    shown = capsys.readouterr()
    assert kit.cell_name(1) in shown.out
    *_, line = shown.err.splitlines()
    assert line.startswith("not stored, so other commands estimate again: cannot write")
    assert line.endswith("Read-only file system")
