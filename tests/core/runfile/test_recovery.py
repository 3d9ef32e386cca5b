"""Recovery from a file or a folder, and room on the card."""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import ANY

import h5py
import pytest

from logger.cli import main as fieldlogger
from logger.core.errors import RunFileError
from logger.core.runfile import (
    RunWriter,
    finish,
    finish_journal,
    free_bytes,
    make_room,
    read_run,
    recover,
    sealing_of,
)
from logger.core.runfile.run_names import first_part, parts_of
from logger.own_baseline import learn
from postproc.cli import main as postproc
from tests.kit import runs
from tests.kit.service import assert_ends

HUGE = 1 << 60


def _cut(path, damage=False):
    runs.write_journal(path, runs.records(20), sync_every=5, close=False)
    data = bytearray(path.read_bytes())
    if damage:
        data[len(bytes(data).rstrip(b"\0")) // 2] ^= 0xFF
    path.write_bytes(data)


@pytest.mark.parametrize("command", [fieldlogger, postproc])
def test_exit_code_says_whether_something_was_lost(tmp_path, capsys, command):
    complete, hit = tmp_path / "run-000001.journal", tmp_path / "run-000002.journal"
    _cut(complete)
    assert command(["recover", str(tmp_path)]) == 0
    assert "run-000001.h5  digest " in capsys.readouterr().out
    assert command(["recover", str(tmp_path)]) == 0
    assert capsys.readouterr().err == f"{tmp_path}: no journal there lacks its HDF5 file\n"
    _cut(hit, damage=True)
    assert command(["recover", str(hit)]) == 3
    assert "1 frames missing" in capsys.readouterr().err
    assert read_run(tmp_path / "run-000002.h5").damage.missing_frames == 1
    hit.with_suffix(".h5").unlink()
    (tmp_path / "run-000003.journal").write_text("rubbish")
    assert command(["recover", str(tmp_path)]) == 3
    assert hit.with_suffix(".h5").exists()
    capsys.readouterr()
    assert command(["recover", "--json", str(tmp_path)]) == 3
    assert json.loads(capsys.readouterr().out) == [
        {"journal": str(tmp_path / "run-000003.journal"), "run": None, "digest": "", "loss": ANY}
    ]
    assert command(["recover", str(tmp_path / "run-000001.h5")]) == 2
    assert command(["recover", str(tmp_path / "none")]) == 2
    assert "no such file" in capsys.readouterr().err


def test_what_is_being_recorded_is_left_alone(tmp_path, capsys):
    writer = RunWriter(tmp_path / "run-000001.journal", runs.meta())
    assert list(recover(tmp_path)) == []
    assert postproc(["recover", str(writer.path)]) == 2
    assert "being recorded" in capsys.readouterr().err
    writer.close(0, "test")
    assert len(list(recover(tmp_path))) == 1


def test_a_run_can_be_read_from_the_moment_it_has_its_name(tmp_path, monkeypatch):
    """HDF5 locks what it opens: whoever makes the run must not hold a lock on it then."""
    journal = tmp_path / "run-000001.journal"
    runs.write_journal(journal, runs.records(30))
    run, read = journal.with_suffix(".h5"), []
    monkeypatch.setattr(finish, "sync_folder", lambda _: read.append(read_run(run)))
    finish_journal(journal)
    assert len(read) == 1
    assert {path.name for path in tmp_path.iterdir()} == {"run-000001.h5", "run-000001.journal"}


def test_a_journal_is_recovered_by_several_at_once(tmp_path):
    journal = tmp_path / "run-000001.journal"
    runs.write_journal(journal, runs.records(200), sync_every=5)
    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(finish_journal, [journal] * 8)) == {journal.with_suffix(".h5")}
    assert sealing_of(journal) == sealing_of(journal.with_suffix(".h5"))
    assert len(list(tmp_path.iterdir())) == 2


def test_a_stop_waits_neither_for_learning_nor_for_another_run(tmp_path):
    # on a small Pi either takes minutes, in which an upgrade would record nothing
    _, (second, _) = (_finished_run(tmp_path, n) for n in (1, 2))
    learning = learn(tmp_path)
    next(learning)  # under way
    third = tmp_path / "run-000003.journal"
    runs.write_journal(third, runs.records(20))
    with _another_makes(second):
        assert_ends(lambda: finish_journal(third), 20.0)
    learning.close()
    assert sealing_of(third) == sealing_of(third.with_suffix(".h5"))


@contextmanager
def _another_makes(journal):
    # the HDF5 file, in a process that takes its time
    slow = (
        "import sys, time; from pathlib import Path; from logger.core.runfile import finish\n"
        "def write(*_): print('writes', flush=True); time.sleep(1000)\n"
        "finish.write_hdf5 = write; finish.finish_journal(Path(sys.argv[1]))"
    )
    with subprocess.Popen([sys.executable, "-c", slow, journal], stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        yield
        process.kill()


def test_what_a_cut_left_of_a_run_that_was_being_made_is_replaced(tmp_path):
    journal, run = _finished_run(tmp_path, 1)
    whole = run.read_bytes()
    run.unlink()
    with _another_makes(journal):
        assert (tmp_path / "run-000001.h5.part").exists()
    assert finish_journal(journal).read_bytes()[:100] == whole[:100]
    assert sealing_of(journal) == sealing_of(run)
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_a_folder_of_another_user_and_what_he_left_in_ones_own():
    with TemporaryDirectory() as folder:  # others may not look into tmp_path
        journal, part = (Path(folder) / f"run-000001.{end}" for end in ("journal", "h5.part"))
        runs.write_journal(journal, runs.records(20))
        finish_journal(journal).unlink()  # imports what another user may not read
        Path(folder).chmod(0o755)
        with _as_another_user(), pytest.raises(RunFileError, match="Permission denied"):
            finish_journal(journal)
        os.chown(folder, _NOBODY, -1)
        for mode in (0o600, 0o644):
            part.write_bytes(b"x")
            part.chmod(mode)
            with _as_another_user():
                assert finish_journal(journal).stat().st_uid == _NOBODY


_NOBODY = 65534


@contextmanager
def _as_another_user():
    os.seteuid(_NOBODY)
    try:
        yield
    finally:
        os.seteuid(0)


def test_parts_are_found_in_their_order(tmp_path):
    journal = tmp_path / "run-000001.journal"
    names = ["run-000001.journal", *(f"run-000001.journal.{n}" for n in (2, 9, 10))]
    for name in (*names, "run-000001.journal.txt", "run-000001.h5", "run-0000011.journal"):
        (tmp_path / name).touch()
    assert [path.name for path in parts_of(journal)] == names
    assert {first_part(tmp_path / name) for name in names} == {journal}


def test_a_run_in_several_files_is_one(tmp_path):
    """Cut anywhere: frames may stand in both, and either may lack some."""
    found = runs.records(30)
    complete = tmp_path / "whole.journal"
    runs.write_journal(complete, found, sync_every=5)
    data = complete.read_bytes()
    for cut, again in ((5000, 2000), (4000, 3000), (3000, 4000)):
        first, second = tmp_path / "run-000001.journal", tmp_path / "run-000001.journal.2"
        first.write_bytes(data[:cut] + bytes(5000))
        second.write_bytes(data[again:])
        run = read_run(second)
        assert run.path == first
        got = dict(run.records())
        assert bool(run.damage.missing_frames) == (again > cut)
        assert (sorted(got) == list(range(len(found)))) == (again < cut)
        assert run.end is not None


def _finished_run(folder, n):
    path = folder / f"run-{n:06d}.journal"
    runs.write_journal(path, runs.records(20), run_id=str(n))
    (recovered,) = recover(path)
    return path, recovered.run


def test_the_oldest_spare_journal_goes_first_and_a_run_never(tmp_path):
    (first, _), (_, spoiled), (third, _) = (_finished_run(tmp_path, n) for n in (1, 2, 3))
    data = bytearray(spoiled.read_bytes())
    with h5py.File(spoiled) as file:
        data[file["readings"].id.get_chunk_info(0).byte_offset] ^= 0xFF
    spoiled.write_bytes(data)
    _cut(tmp_path / "run-000004.journal")
    _cut(tmp_path / "run-000005.journal", damage=True)
    list(recover(tmp_path / "run-000005.journal"))
    runs.write_journal(tmp_path / "run-000006.journal", runs.records(3))
    first.with_name(first.name + ".2").touch()
    assert next(make_room(tmp_path, HUGE)) == first
    assert list(make_room(tmp_path, 0)) == []
    assert list(make_room(tmp_path, HUGE)) == [third]
    kept = {path.name for path in tmp_path.iterdir()}
    assert kept == {
        *(f"run-00000{n}.h5" for n in (1, 2, 3, 5)),
        *(f"run-00000{n}.journal" for n in (2, 4, 5, 6)),
    }
    assert read_run(tmp_path / "run-000001.h5").end is not None
    assert free_bytes(tmp_path) > 0


def test_a_finished_run_of_another_walk_does_not_free_a_journal(tmp_path):
    (first, run), (_, other) = (_finished_run(tmp_path, n) for n in (1, 2))
    run.write_bytes(other.read_bytes())
    assert first not in list(make_room(tmp_path, HUGE))
