"""Runs of strangers: refused in one line, or read without harm; and whatever was altered is
named.
"""

import os
import shutil
from contextlib import suppress

import h5py
import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import convert_journal, read_run, sealing_of
from postproc.cli import main
from tests.kit import hostile_runs, runs
from tests.kit.own_memory import run_alone


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    folder = tmp_path_factory.mktemp("honest")
    runs.write_journal(folder / "a.journal", runs.records(60), sync_every=7, config_text="[run]\n")
    convert_journal(folder / "a.journal", folder / "a.h5")
    return folder / "a.h5"


@pytest.fixture
def crafted_file(honest, tmp_path):
    """Makes a run with something changed."""

    def craft(change):
        path, secret = tmp_path / "crafted.h5", tmp_path / "secret"
        secret.write_bytes(hostile_runs.SECRET)
        shutil.copy(honest, path)
        with h5py.File(path, "r+") as file:
            change(file, secret)
        return path

    return craft


def _one_line(capsys):
    said = capsys.readouterr()
    assert hostile_runs.SECRET.decode() not in said.out + said.err
    assert len(said.err.splitlines()) == 1, said.err
    return said.err


@pytest.mark.parametrize("name", hostile_runs.ELSEWHERE)
def test_what_leads_out_of_the_file_is_refused(crafted_file, capsys, name):
    path = crafted_file(hostile_runs.ELSEWHERE[name])
    for more in ([], ["--verify"], ["--json"]):
        assert main(["info", str(path), *more]) == 2
        assert "it is not read" in _one_line(capsys)


@pytest.mark.parametrize("name", hostile_runs.UNREADABLE)
def test_what_is_no_run_is_one_line(crafted_file, capsys, name):
    path = crafted_file(hostile_runs.UNREADABLE[name])
    for more in ([], ["--verify"]):
        assert main(["info", str(path), *more]) == 2
        assert str(path) in _one_line(capsys)


@pytest.mark.parametrize("name", hostile_runs.ALTERED)
def test_what_was_altered_is_named(crafted_file, capsys, name):
    change, word = hostile_runs.ALTERED[name]
    path = crafted_file(change)
    assert main(["info", "--verify", str(path)]) == 3
    failed = [line for line in capsys.readouterr().out.splitlines() if line.startswith("FAIL")]
    assert any(word in line for line in failed), failed
    assert main(["info", str(path)]) == 0


def test_an_honest_run_of_either_version_of_frames_verifies(honest, crafted_file, capsys):
    """Frames had no checksums before; then what was altered is found, not named."""

    def without_checksums(file, _):
        rows = file["frames"][...]
        names = [name for name in rows.dtype.names if name != "crc32"]
        old = rows[names].astype([(name, rows.dtype[name]) for name in names])
        hostile_runs.replace_dataset(file, "frames", data=old, chunks=(64,), maxshape=(None,))

    assert main(["info", "--verify", str(honest)]) == 0
    path = crafted_file(without_checksums)
    assert main(["info", "--verify", str(path)]) == 0
    with h5py.File(path, "r+") as file:
        file["raw_bytes"][0] += 1
    assert main(["info", "--verify", str(path)]) == 3
    assert "chain: altered" in capsys.readouterr().out


def test_a_noted_digest_is_what_a_forger_cannot_meet(honest, tmp_path, capsys):
    """Recorded anew with other words, every check holds, but that one."""
    runs.write_journal(tmp_path / "b.journal", runs.records(59), config_text="[run]\n")
    noted = sealing_of(honest).recomputed_digest
    for path, code in ((honest, 0), (tmp_path / "b.journal", 3)):
        assert main(["info", "--verify", str(path)]) == 0
        assert "proves no author" in capsys.readouterr().out
        assert main(["info", "--verify", str(path), "--digest", f" {noted.upper()} "]) == code
        assert ("FAIL  digest" in capsys.readouterr().out) == bool(code)
    assert main(["info", str(honest), "--digest", "12ab"]) == 2
    assert "--digest" in capsys.readouterr().err


def _more_mb(*argv):
    done = run_alone("postproc.cli:main", *argv)
    assert done.code in {0, 2, 3}, done.err
    assert "Traceback" not in done.err
    return done.more_mb


def test_bytes_that_memory_should_not_hold_are_counted_and_left(crafted_file):
    """A port that is stuck sends zeros for hours, which pack to nothing: the rest of such a run is
    read.
    """
    path = crafted_file(
        lambda file, _: hostile_runs.pack_rows(file, "raw_bytes", 600 << 20, 1 << 20, "u1")
    )
    run = read_run(path)
    assert (len(run.raw_bytes), run.n_raw_bytes) == (0, 600 << 20)
    assert len(run.tables["readings"]) == 120
    for more in ([], ["--verify"]):
        assert _more_mb("info", path, *more) < 512


def test_many_rows_take_no_more_memory_than_they_need(crafted_file):
    path = crafted_file(
        lambda file, _: hostile_runs.pack_rows(
            file, "readings", 200_000, 16_384, file["readings"].dtype
        )
    )
    for more in ([], ["--verify"]):
        assert _more_mb("info", path, *more) < 512


@pytest.mark.parametrize("part", ["link", "folder", "pipe"])
def test_a_journal_does_not_go_on_elsewhere(tmp_path, capsys, part):
    runs.write_journal(tmp_path / "a.journal", runs.records(9))
    other = tmp_path / "a.journal.2"
    if part == "link":
        other.symlink_to("/etc/passwd")
    elif part == "folder":
        other.mkdir()
    else:
        os.mkfifo(other)
    for argv in (
        ["info", "a.journal"],
        ["info", "--verify", "a.journal"],
        ["recover", "a.journal"],
    ):
        assert main([*argv[:-1], str(tmp_path / argv[-1])]) == 2
        assert "a.journal.2" in _one_line(capsys)


@pytest.mark.parametrize("what", ["pipe", "folder", "empty", "long", "nul", "none", "denied"])
def test_what_is_no_file_is_one_line(tmp_path, capsys, what):
    path = tmp_path / "x.h5"
    match what:
        case "pipe":
            os.mkfifo(path)
        case "folder":
            path.mkdir()
        case "empty":
            path.touch()
        case "long":
            path = tmp_path / ("x" * 3000)
        case "nul":
            path = f"{path}\0"
        case "denied":
            path = "/proc/1/mem" if os.geteuid() else "/proc/self/attr/none"
    for command in (["info"], ["info", "--verify"], ["smooth"], ["replay"], ["recover"]):
        if what == "folder" and command == ["recover"]:
            continue
        assert main([*command, str(path)]) == 2
        _one_line(capsys)


@pytest.mark.parametrize("count", [15, pytest.param(300, marks=pytest.mark.slow)])
def test_a_damaged_file_does_not_end_the_program(honest, tmp_path, count):
    """Some bytes of the structure changed, which HDF5 may end with a segmentation fault over."""
    import random

    data, rng = honest.read_bytes(), random.Random(5)
    spots = [
        at
        for word in (b"TREE", b"SNOD", b"HEAP")
        for at in range(len(data))
        if data.startswith(word, at)
    ]
    for _ in range(count):
        spoiled = bytearray(data)
        for _ in range(rng.randrange(1, 4)):
            at = rng.choice(spots) + rng.randrange(600)
            spoiled[at : at + 8] = rng.choice([b"\xff" * 8, bytes(8), rng.randbytes(8)])
        (tmp_path / "spoiled.h5").write_bytes(spoiled)
        for read in (read_run, sealing_of):
            with suppress(RunFileError):
                read(tmp_path / "spoiled.h5")
