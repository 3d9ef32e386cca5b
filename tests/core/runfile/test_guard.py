"""Whatever ends the process that reads a file is one error in the one that asked."""

import ctypes
import os

import numpy as np
import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import guard


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "some.h5"
    path.write_bytes(bytes(1000))
    return path


def test_a_value_and_arrays_come_back(file):
    rows = np.array([(1, b"a", 0.5), (2, b"b", np.nan)], [("n", "<i8"), ("text", "S3"), ("x", "<f8")])
    arrays = {"rows": rows, "none": rows[:0], "bytes": np.arange(3_000_000, dtype="u1")}
    value, found = guard.guarded(file, lambda: ({"a": [1, None]}, arrays))
    assert value == {"a": [1, None]}
    for name, array in arrays.items():
        assert found[name].tobytes() == array.tobytes()
        assert found[name].dtype == array.dtype
    found["rows"]["n"] = 7  # theirs to change


def _raises(error):
    raise error


@pytest.mark.parametrize(
    ("task", "says"),
    [
        (lambda: ctypes.string_at(0), "signal 11"),
        (os.abort, "signal 6"),
        (lambda: os._exit(0), "without a word"),
        (lambda: bytearray(8 << 30), "memory"),
        (lambda: np.zeros(8 << 30, "u1").sum(), "memory"),
        (lambda: _raises(RunFileError("what the task says")), "what the task says"),
        (lambda: _raises(ValueError("no row")), "is damaged: no row"),
        (lambda: _raises(RecursionError("too deep")), "is damaged: too deep"),
    ],
)
def test_an_end_is_an_error(file, capfd, task, says):
    with pytest.raises(RunFileError, match=says):
        guard.guarded(file, task)
    assert capfd.readouterr() == ("", "")


def test_what_never_ends_is_ended(file, monkeypatch):
    def forever():
        while True:
            pass

    monkeypatch.setattr(guard, "most_cpu_s", lambda _: 1)
    with pytest.raises(RunFileError, match="longer"):
        guard.guarded(file, forever)


def test_what_waits_for_ever_is_ended(file, monkeypatch):
    reading, _ = os.pipe()
    monkeypatch.setattr(guard, "_PATIENCE", 0.1)
    with pytest.raises(RunFileError, match="longer"):
        guard.guarded(file, lambda: os.read(reading, 1))


def test_no_process_is_left(file):
    guard.guarded(file, lambda: (None, {}))
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)
