"""Whatever ends the process that reads a file is one error in the one that asked."""

import os
import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from logger.core import reader_process
from logger.core.errors import RunFileError
from logger.core.runfile import isolation
from tests.kit import isolated_tasks


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "some.h5"
    path.write_bytes(bytes(1000))
    return path


def test_a_value_and_arrays_come_back(file):
    value, found = isolation.run_isolated(file, isolated_tasks.succeed, {"a": [1, None]})
    assert value == {"a": [1, None]}
    for name, array in isolated_tasks.ARRAYS.items():
        assert found[name].tobytes() == array.tobytes()
        assert found[name].dtype == array.dtype
    found["rows"]["n"] = 7  # theirs to change


def test_the_folder_that_we_are_in_may_be_gone(file, tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert isolation.run_isolated(file, isolated_tasks.succeed, 1)[0] == 1


@pytest.mark.parametrize(
    ("task", "message"),
    [
        (isolated_tasks.crash, "signal 11"),
        (isolated_tasks.abort, "signal 6"),
        (isolated_tasks.leave, "without a reply"),
        (isolated_tasks.fill_bytes, "memory"),
        (isolated_tasks.fill_array, "memory"),
        (isolated_tasks.refuse, "message of the task"),
        (isolated_tasks.no_row, "is damaged: no row"),
        (isolated_tasks.too_deep, "is damaged: too deep"),
    ],
)
def test_an_end_is_an_error(file, capfd, task, message):
    with pytest.raises(RunFileError, match=message):
        isolation.run_isolated(file, task)
    assert capfd.readouterr() == ("", "")


def test_what_never_ends_is_ended(file, monkeypatch):
    monkeypatch.setattr(isolation, "most_cpu_s", lambda _: 1)
    with pytest.raises(RunFileError, match="longer"):
        isolation.run_isolated(file, isolated_tasks.compute)


def test_what_waits_for_ever_is_ended(file, monkeypatch):
    monkeypatch.setattr(isolation, "_PATIENCE", 0.0)
    monkeypatch.setattr(isolation, "_START_S", 3.0)
    with pytest.raises(RunFileError, match="longer"):
        isolation.run_isolated(file, isolated_tasks.wait)


def test_what_a_library_prints_is_no_part_of_the_reply(file, capfd):
    assert isolation.run_isolated(file, isolated_tasks.chatter) == (None, {})
    assert capfd.readouterr() == ("", "")


def test_locks_of_this_process_are_not_waited_for(file):
    """A forked copy has the locks that other threads hold, and nobody to free them."""
    with isolated_tasks.LOCK:
        assert isolation.run_isolated(file, isolated_tasks.under_lock) == (None, {})


def test_nothing_is_imported_from_the_folder_of_the_file(file, monkeypatch):
    """Runs come with other files: one that is called as a module of ours must not be executed."""
    for name in ("logger", "numpy", "pickle"):
        (file.parent / f"{name}.py").write_text("raise SystemExit('a program of a stranger')")
    monkeypatch.chdir(file.parent)
    assert isolation.run_isolated(file, isolated_tasks.chatter) == (None, {})


def test_one_server_forks_for_all_files(file):
    parents = {isolation.run_isolated(file, isolated_tasks.parent)[0] for _ in range(3)}
    assert parents == {reader_process._idle[-1]._process.pid}


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_a_server_that_has_ended_is_started_again(file, end):
    first, _ = isolation.run_isolated(file, isolated_tasks.parent)
    os.kill(first, end)
    second, _ = isolation.run_isolated(file, isolated_tasks.parent)
    assert second != first


def test_a_server_without_jobs_ends_by_itself(file, monkeypatch):
    reader_process.close_all()
    program = "from logger.core.runfile import isolated_reader as r; r._IDLE_S = 0.1; r.main()"
    monkeypatch.setattr(reader_process, "_PROGRAM", program)
    assert isolation.run_isolated(file, isolated_tasks.chatter) == (None, {})
    assert reader_process._idle[-1]._process.wait(10) == 0
    assert isolation.run_isolated(file, isolated_tasks.chatter) == (None, {})
    reader_process.close_all()


def test_a_path_is_relative_to_the_folder_of_now(file, monkeypatch):
    isolation.run_isolated(file, isolated_tasks.chatter)
    monkeypatch.chdir(file.parent)
    length, _ = isolation.run_isolated(Path(file.name), isolated_tasks.length)
    assert length == 1000


def test_threads_have_servers_of_their_own(file):
    with ThreadPoolExecutor(4) as pool:
        asked = [
            pool.submit(isolation.run_isolated, file, isolated_tasks.succeed, i) for i in range(20)
        ]
        assert [one.result()[0] for one in asked] == list(range(20))


def test_a_forked_process_has_a_server_of_its_own(file):
    ours, _ = isolation.run_isolated(file, isolated_tasks.parent)
    reading, writing = os.pipe()
    fork = os.fork()
    if not fork:
        theirs, _ = isolation.run_isolated(file, isolated_tasks.parent)
        reader_process.close_all()
        os.write(writing, str(theirs).encode())
        os._exit(0)
    assert os.waitpid(fork, 0)[1] == 0
    theirs = int(os.read(reading, 100))
    os.close(reading)
    os.close(writing)
    assert theirs != ours
    assert isolation.run_isolated(file, isolated_tasks.parent)[0] == ours


def test_one_that_was_started_ahead_takes_the_first_job(file):
    reader_process.close_all()
    reader_process.start_ahead()
    (ahead,) = reader_process._idle
    reader_process.start_ahead()  # one is enough
    assert reader_process._idle == [ahead]
    server, _ = isolation.run_isolated(file, isolated_tasks.parent)
    assert server == ahead._process.pid
    assert reader_process._idle == [ahead]


def test_no_process_is_left(file):
    isolation.run_isolated(file, isolated_tasks.chatter)
    reader_process.close_all()
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)
