"""Whatever ends the process that reads a file is one error in the one that asked."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from logger.core import isolation
from logger.core.errors import RunFileError
from tests.kit import isolated_tasks

TASKS = "tests.kit.isolated_tasks"


@pytest.fixture(autouse=True)
def no_process():
    """Each test begins and ends without one that waits."""
    isolation.end_all()
    yield
    isolation.end_all()


def quick(change):
    """The program of the other process, with something made quicker."""
    return f"import {{}}; from logger.core import isolation as i; i.{change}; i.serve()"


def run(path, task, *arguments):
    return isolation.run_isolated(f"{TASKS}:{task}", path, *arguments)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "some.h5"
    path.write_bytes(bytes(1000))
    return path


def test_a_value_and_arrays_come_back(file):
    value, found = run(file, "succeed", {"a": [1, None]})
    assert value == {"a": [1, None]}
    for name, array in isolated_tasks.ARRAYS.items():
        kind, data = found[name]
        assert data == array.tobytes()
        wanted = array.dtype.descr if array.dtype.names else array.dtype.str
        assert [*map(tuple, kind)] == wanted if array.dtype.names else kind == wanted


def test_the_folder_that_we_are_in_may_be_gone(file, tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert run(file, "succeed", 1)[0] == 1


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ("crash", "signal 11"),
        ("abort", "signal 6"),
        ("leave", "without a reply"),
        ("fill_bytes", "memory"),
        ("fill_array", "memory"),
        ("refuse", "message of the task"),
        ("no_row", "is damaged: no row"),
        ("too_deep", "is damaged: too deep"),
    ],
)
def test_an_end_is_an_error(file, capfd, task, message):
    with pytest.raises(RunFileError, match=message):
        run(file, task)
    assert capfd.readouterr() == ("", "")


def test_what_never_ends_is_ended(file, monkeypatch):
    monkeypatch.setattr(isolation, "_PROGRAM", quick("most_cpu_s = lambda _: 1"))
    with pytest.raises(RunFileError, match="longer"):
        run(file, "compute")


def test_what_waits_for_ever_is_ended(file, monkeypatch):
    monkeypatch.setattr(isolation, "_PROGRAM", quick("_PATIENCE, i._START_S = 0, 1"))
    with pytest.raises(RunFileError, match="longer"):
        run(file, "wait")


def test_what_a_library_prints_is_no_part_of_the_reply(file, capfd):
    assert run(file, "chatter") == (None, {})
    assert capfd.readouterr() == ("", "")


def test_locks_of_this_process_are_not_waited_for(file):
    """A forked copy has the locks that other threads hold, and nobody to free them."""
    with isolated_tasks.LOCK:
        assert run(file, "under_lock") == (None, {})


def test_nothing_is_imported_from_the_folder_of_the_file(file, monkeypatch):
    """Runs come with other files: one that is called as a module of ours must not be executed."""
    for name in ("logger", "numpy", "pickle"):
        (file.parent / f"{name}.py").write_text("raise SystemExit('a program of a stranger')")
    monkeypatch.chdir(file.parent)
    assert run(file, "chatter") == (None, {})


def test_a_process_reads_files_until_one_ends_it(file):
    """Damage that HDF5 finds ends it too: nobody knows what it has left in the library."""
    isolation.start_ahead(TASKS)
    numbers = []
    for task in ("process", "process", "crash", "process", "no_row", "process", "refuse"):
        with suppress(RunFileError):
            numbers.append(run(file, task)[0])
    assert numbers[0] == numbers[1]
    assert len(set(numbers)) == 3
    assert not isolation._ready[os.getpid()]


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_one_that_was_ended_by_somebody_is_replaced(file, end):
    first, _ = run(file, "process")
    os.kill(first, end)
    isolation._ready[os.getpid()][-1].wait(10)
    assert run(file, "process")[0] != first


def test_one_without_a_file_ends_by_itself(file, monkeypatch):
    monkeypatch.setattr(isolation, "_PROGRAM", quick("_IDLE_S = 0.1"))
    isolation.start_ahead(TASKS)
    ahead = isolation._ready[os.getpid()][-1]
    assert ahead.wait(20) == isolation._UNUSED
    assert run(file, "process")[0] != ahead.pid


def test_a_slow_reader_of_the_reply_is_waited_for(file, monkeypatch):
    """The limit of time is one of reading files."""
    monkeypatch.setattr(isolation, "_PROGRAM", quick("_PATIENCE, i._START_S = 0, 1"))
    receive = isolation._read

    def slowly(pipe, n_bytes):
        time.sleep(0.5)
        return receive(pipe, n_bytes)

    monkeypatch.setattr(isolation, "_read", slowly)
    assert run(file, "succeed", 1)[0] == 1


def test_a_path_is_relative_to_the_folder_of_now(file, monkeypatch):
    run(file, "chatter")
    monkeypatch.chdir(file.parent)
    length, _ = run(Path(file.name), "length")
    assert length == 1000


def test_threads_have_processes_of_their_own(file):
    with ThreadPoolExecutor(4) as pool:
        asked = [pool.submit(run, file, "succeed", i) for i in range(12)]
        assert [one.result()[0] for one in asked] == list(range(12))


def test_one_that_was_started_ahead_takes_the_first_job(file):
    isolation.start_ahead(TASKS)
    (ahead,) = isolation._ready[os.getpid()]
    isolation.start_ahead(TASKS)  # one is enough
    assert isolation._ready[os.getpid()] == [ahead]
    assert run(file, "process")[0] == ahead.pid
    assert isolation._ready[os.getpid()] == [ahead]


def test_one_that_never_gets_a_job_ends_with_its_parent():
    program = (
        "from logger.core import isolation as i; i.start_ahead('tests.kit.isolated_tasks');"
        "print(*(one.pid for some in i._ready.values() for one in some))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=20
    )
    end_s = time.monotonic() + 20
    while Path(f"/proc/{done.stdout.strip()}/cmdline").exists() and time.monotonic() < end_s:
        time.sleep(0.05)
    assert not Path(f"/proc/{done.stdout.strip()}/cmdline").exists()
    assert done.stderr == ""


def test_no_process_is_left(file):
    isolation.end_all()
    before = _children()  # other tests of this process may have some
    run(file, "chatter")
    assert _children() > before
    isolation.end_all()
    assert _children() == before


def _children():
    """Numbers of the processes that this one has started and not waited for."""
    return {
        int(number)
        for task in Path("/proc/self/task").glob("*/children")
        for number in task.read_text().split()
    }


def test_a_forked_process_leaves_it_alone(file):
    ours, _ = run(file, "process")
    reading, writing = os.pipe()
    fork = os.fork()
    if not fork:
        os.write(writing, str(run(file, "process")[0]).encode())
        os._exit(0)
    assert os.waitpid(fork, 0)[1] == 0
    assert int(os.read(reading, 100)) != ours
    os.close(reading)
    os.close(writing)
    assert run(file, "process")[0] == ours


def test_an_interrupt_at_the_end_is_no_error(file):
    run(file, "succeed", 1)

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGCHLD, interrupt)  # while the end of the process is awaited
    try:
        isolation.end_all()
    finally:
        signal.signal(signal.SIGCHLD, before)
