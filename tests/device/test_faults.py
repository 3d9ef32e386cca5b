"""Cards that are full, read-only, failing, out of inodes; cuts at every system call of a recording
and of its HDF5.
"""

import errno
import os
import subprocess
import sys
import time

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import finish_journal, read_run, sealing_of
from logger.core.runfile.frames import HEADER_SIZE, Frame, scan
from logger.core.runfile.journal_reader import SECTOR
from logger.core.runfile.run_names import parts_of
from logger.core.types import Scan
from tests.kit import runs, service
from tests.kit.card_trace import read_trace, replay
from tests.kit.faulty_card import Card, build_preload_library, small_file_system
from tests.kit.recorder_process import raw_counts, running_recorder


@pytest.fixture(scope="session")
def preload(tmp_path_factory):
    return build_preload_library(tmp_path_factory.mktemp("preload"))


@pytest.fixture
def card(tmp_path, preload):
    return Card(tmp_path, preload)


def _codes(run):
    return [code.decode() for code in run.tables["notes"]["code"]]


def _whole(card, n_put):
    """The run on the card holds every record that was put, and is as it was sealed."""
    run = read_run(card.folder / "run-000001.journal")
    assert raw_counts(run) == list(range(n_put))
    assert not run.damage
    assert sealing_of(run.path).holds
    return run


@pytest.mark.parametrize(
    "failing",
    [
        {"pwrite": errno.ENOSPC},
        {"fdatasync": errno.ENOSPC},
        {"pwrite": errno.EDQUOT},
        {"pwrite": errno.EROFS, "create": errno.EROFS},
        {"pwrite": errno.EIO, "create": errno.EIO},
        {"fdatasync": errno.EIO, "create": errno.ENOSPC},
    ],
)
def test_a_card_that_fails_for_a_while_loses_nothing(card, failing):
    # of two errors the second may come before the state of the first was shown
    waiting = {f"waiting for the card: {os.strerror(number)}" for number in failing.values()}
    with running_recorder(card) as recorder:
        recorder.wait_durable(50)
        card.fails(**failing)
        recorder.wait_state(*waiting)
        durable = recorder.durable
        time.sleep(0.3)
        assert recorder.durable == durable
        card.fails()
        recorder.wait_state("recording")
        recorder.wait_durable(50)
        run = _whole(card, recorder.stop())
    assert {"write-failed", "write-resumed"} <= set(_codes(run))


@pytest.mark.parametrize(
    ("operation", "error"),
    [("pwrite", errno.EIO), ("fdatasync", errno.EIO), ("pwrite", errno.EROFS)],
)
def test_after_an_error_of_the_card_the_run_goes_on_in_a_new_file(card, operation, error):
    with running_recorder(card) as recorder:
        recorder.wait_durable(50)
        card.fails(**{operation: error})
        recorder.wait_state(f"waiting for the card: {os.strerror(error)}")
        card.fails()
        recorder.wait_durable(50)
        n_put = recorder.stop()
    run = _whole(card, n_put)
    assert "new-file" in _codes(run)
    first, second = card.folder / "run-000001.journal", card.folder / "run-000001.journal.2"
    assert read_run(second).raw_bytes.tobytes() == run.raw_bytes.tobytes()
    # Linux dropped what it could not write: it stands in the new file
    begins = min(frame.number for frame in scan(second.read_bytes()) if isinstance(frame, Frame))
    data = first.read_bytes()
    lost = next(
        (f.start for f in scan(data) if isinstance(f, Frame) and f.number == begins), len(data)
    )
    first.write_bytes(data[:lost] + bytes(len(data) - lost))
    assert raw_counts(read_run(first)) == list(range(n_put))
    assert raw_counts(read_run(finish_journal(first))) == list(range(n_put))


def test_a_run_whose_file_is_removed_goes_on_in_a_new_file(card):
    with running_recorder(card) as recorder:
        recorder.wait_durable(50)
        (card.folder / "run-000001.journal").unlink()
        second = card.folder / "run-000001.journal.2"
        service.wait_for(second.exists)
        recorder.wait_durable(50)
        n_put = recorder.stop()
    run = read_run(second)
    got = raw_counts(run)
    assert got == list(range(got[0], n_put))
    assert "new-file" in _codes(run)


def test_a_name_that_is_taken_does_not_stop_it(card):
    """An empty file that the failing card did not let go."""
    with running_recorder(card) as recorder:
        recorder.wait_durable(50)
        (card.folder / "run-000001.journal.2").touch()
        card.fails(fdatasync=errno.EIO)
        recorder.wait_state("waiting for the card: File exists")
        card.fails()
        recorder.wait_durable(50)
        _whole(card, recorder.stop())
    assert any(path.stat().st_size for path in parts_of(card.folder / "run-000001.journal")[2:])


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EROFS, errno.EIO])
def test_a_card_that_cannot_make_a_file_at_the_start_is_waited_for(card, error):
    """Out of inodes, read-only or failing before the first byte."""
    card.fails(create=error)
    with running_recorder(card) as recorder:
        service.wait_for(lambda: any("waiting" in state for state in recorder.lines("state")))
        assert not list(card.folder.iterdir())
        card.fails()
        recorder.wait_durable(50)
        _whole(card, recorder.stop())


def test_what_finds_no_room_in_memory_is_counted(card):
    with running_recorder(card, most_waiting=3_000) as recorder:
        recorder.wait_durable(50)
        card.fails(pwrite=errno.ENOSPC)
        recorder.wait_state("waiting for the card: No space left on device")
        recorder.wait_put(2000)
        card.fails()
        recorder.wait_durable(50)
        n_put = recorder.stop()
    run = read_run(card.folder / "run-000001.journal")
    got = raw_counts(run)
    (text,) = [row["text"].decode() for row in run.tables["notes"] if row["code"] == b"overflow"]
    assert got == sorted(set(got))
    assert n_put - len(got) == int(text.split()[0]) > 0
    assert (
        len(run.tables["raw"]) + int(text.split()[0]) + len(run.tables["notes"])
        == run.end.n_records
    )


def test_a_full_file_system_is_waited_out(tmp_path, preload):
    with small_file_system(tmp_path / "card", "size=3m") as folder:
        card = Card(tmp_path, preload)
        with running_recorder(card) as recorder:
            recorder.wait_durable(50)
            filler = folder / "filler"
            with filler.open("wb", buffering=0) as file, pytest.raises(OSError, match="No space"):
                while True:
                    file.write(bytes(4096))
            # the reserve is used up first
            assert recorder.lines("state") == ["recording"]
            recorder.wait_durable(50)
            filler.unlink()
            _whole(card, recorder.stop())


def test_no_inode_left(tmp_path, preload):
    with small_file_system(tmp_path / "card", "size=8m,nr_inodes=3") as folder:
        card = Card(tmp_path, preload)
        for name in "ab":
            (folder / name).touch()
        with running_recorder(card) as recorder:
            recorder.wait_state("waiting for the card: No space left on device")
            (folder / "a").unlink()
            recorder.wait_durable(50)
            _whole(card, recorder.stop())
        with pytest.raises(RunFileError, match="cannot write"):
            finish_journal(folder / "run-000001.journal")
        (folder / "b").unlink()
        assert read_run(finish_journal(folder / "run-000001.journal")).end is not None


def test_every_system_call_boundary_of_a_recording_is_readable(card, tmp_path):
    """The card as it was before each call, and in the middle of each write."""
    with running_recorder(card, trace=True) as recorder:
        recorder.wait_durable(100)
        card.fails(fdatasync=errno.EIO)
        recorder.wait_state("waiting for the card: Input/output error")
        card.fails()
        recorder.wait_durable(100)
        n_put = recorder.stop()
    replayed = tmp_path / "replayed"
    replayed.mkdir()
    operations = read_trace(card.trace)
    seen = synced = n_states = 0
    for operation in operations:
        for _ in replay(operation, replayed):
            # cut in its first write, a run has not begun
            if n_states or operation.name == "fdatasync":
                seen = _readable(replayed, synced)
            n_states += operation.name == "pwrite"
        if operation.name == "fdatasync":
            synced = seen
    assert seen == n_put
    print(f"{len(operations)} calls, {n_states} states of their writes")


def _readable(folder, at_least):
    run = read_run(folder / "run-000001.journal")
    got = raw_counts(run)
    assert got == list(range(len(got)))
    assert len(got) >= at_least
    return len(got)


FINISH = """
import sys
from pathlib import Path
from logger.core.runfile import recover
list(recover(Path(sys.argv[1])))
"""


def test_a_cut_at_any_system_call_of_the_making_of_the_hdf5_loses_nothing(card):
    journal = card.folder / "run-000001.journal"
    found = runs.records(200)
    runs.write_journal(journal, found)
    before = journal.read_bytes()
    command = [sys.executable, "-c", FINISH, str(card.folder)]
    subprocess.run(command, check=True, env=card.environment(trace=True))
    n_calls = len(read_trace(card.trace))
    assert n_calls > 10
    for kill_at in sorted({*range(1, n_calls + 1, max(1, n_calls // 8)), n_calls - 1, n_calls}):
        journal.with_suffix(".h5").unlink()
        killed = subprocess.run(command, check=False, env=card.environment(kill_at=kill_at))
        assert killed.returncode == -9
        assert journal.read_bytes() == before
        subprocess.run(command, check=True)
        assert len(list(read_run(journal.with_suffix(".h5")).records())) == len(found)
    assert {path.name for path in card.folder.iterdir()} == {journal.name, "run-000001.h5"}


@pytest.mark.parametrize("where", [0.0, 0.5, 0.99])
def test_a_sector_that_cannot_be_read_costs_the_frames_in_it(card, where):
    journal = card.folder / "run-000001.journal"
    found = runs.records(2000)
    runs.write_journal(journal, found, sync_every=20)
    frames = [frame for frame in scan(journal.read_bytes()) if isinstance(frame, Frame)]
    bad_at = int(where * (frames[-1].start + frames[-1].length))
    sector = range(bad_at // SECTOR * SECTOR, bad_at // SECTOR * SECTOR + SECTOR)
    lost = [
        f
        for f in frames
        if f.start - HEADER_SIZE < sector.stop and f.start + f.length + 4 > sector.start
    ]
    process = subprocess.run(
        [sys.executable, "-c", FINISH, str(card.folder)],
        check=True, capture_output=True, text=True, env=card.environment(bad_at=bad_at),
    )  # fmt: skip
    run = read_run(card.folder / "run-000001.h5")
    kept = dict(run.records())
    assert process.stderr == ""
    assert run.damage.skipped_bytes >= SECTOR / 2
    assert 0 < len(found) - len(kept) <= 20 * len(lost)
    # a scan and its readings stand in frames of their own
    assert all(one == found[seq] for seq, one in kept.items() if not isinstance(one.value, Scan))
