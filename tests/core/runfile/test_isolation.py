"""Whatever ends the process that reads a file is one error in the one that asked."""

import os

import pytest

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


def test_no_process_is_left(file):
    isolation.run_isolated(file, isolated_tasks.chatter)
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)
