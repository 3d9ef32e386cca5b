"""Untrusted HDF5 files are read in a separate process.

The HDF5 library trusts its files: of 2900 runs with some bytes of their structure changed, five
ended it with a segmentation fault and three took gigabytes. What ends the other process is one
error here. It is a fork of a server, which has the imports behind it (0.2 s), and not of this
process: this one may have threads, and a copy of a process has the locks that they hold.
"""

import os
import pickle
import select
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.errors import RunFileError
from logger.core.reader_process import ReaderProcess, give_back, take_idle
from logger.core.runfile.limits import most_cpu_s, most_memory_bytes

Arrays = dict[str, npt.NDArray[Any]]
Task = Callable[..., tuple[Any, Arrays]]
"""Returns a value for JSON, and arrays; a function of a module that the other process imports."""

_WORKING_BYTES = 192 << 20
"""For HDF5 and numpy, beyond what is read twice: as it is stored, and as it is given back."""
_PATIENCE = 20
"""Real seconds for each second of computing: a busy machine has no more for us."""
_START_S = 30
"""Real seconds for each of which the start of the other process may keep us waiting as well."""
HEAD_BYTES = 8
"""Length of a job, and of the reply's first part, little-endian."""
STATUS_BYTES = 4
"""How a fork has ended: its exit code, or minus the signal; little-endian."""


class Reply(msgspec.Struct):
    """What precedes the arrays: a value, or an error."""

    value: Any = None
    arrays: list[tuple[str, Any, int]] = []
    error: str = ""


class Job(msgspec.Struct, frozen=True):
    """The task of the other process, and its limits of time and memory.

    `path` is relative to `folder`.
    """

    path: Path
    folder: str
    task: Task
    arguments: tuple[Any, ...]
    cpu_s: int
    memory_bytes: int


class _ServerEndedError(Exception):
    """The server has ended before it forked: it had nothing to do for a while."""


def _ask(server: socket.socket, job: bytes, patience_s: float) -> tuple[Reply, Arrays] | int:
    """The reply of a fork, or how it ended without one; raises TimeoutError."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb", buffering=0) as pipe:
        try:
            head = len(job).to_bytes(HEAD_BYTES, "little")
            socket.send_fds(server, [head], [writing])
            server.sendall(job)
        except OSError as error:
            raise _ServerEndedError from error
        finally:
            os.close(writing)
        try:
            reply = _receive_reply(pipe, patience_s)
        except EOFError:
            return _status(server, patience_s)
    _status(server, patience_s)
    return reply


def _status(server: socket.socket, patience_s: float) -> int:
    server.settimeout(patience_s)
    try:
        status = server.recv(STATUS_BYTES, socket.MSG_WAITALL)
    except ConnectionError as error:
        raise _ServerEndedError from error
    if not status:
        raise _ServerEndedError
    return int.from_bytes(status, "little", signed=True)


def run_isolated(path: Path, task: Task, *arguments: Any) -> tuple[Any, Arrays]:
    """Run `task(path, *arguments)`, which reads a file, in another process, and return its result.

    Raises `RunFileError`: that of the task, or one that states how the process ended.
    Raises OSError if there is no such file.
    """
    size = path.stat().st_size
    cpu_s, memory_bytes = most_cpu_s(size), 3 * most_memory_bytes(size) + _WORKING_BYTES
    folder = "" if path.is_absolute() else str(Path.cwd())
    job = Job(path, folder, task, arguments, cpu_s, memory_bytes)
    ended = _run_job(job, _START_S + _PATIENCE * cpu_s)
    if isinstance(ended, int):
        raise RunFileError(_ending(path, ended))
    reply, arrays = ended
    if reply.error:
        raise RunFileError(reply.error)
    return reply.value, arrays


def _run_job(job: Job, patience_s: float) -> tuple[Reply, Arrays] | int:
    """The reply to a job, or how the process ended; a server is started if none is idle."""
    data = pickle.dumps(job)
    for is_second_try in (False, True):
        process = (None if is_second_try else take_idle()) or ReaderProcess()
        try:
            ended = _ask(process.socket, data, patience_s)
        except _ServerEndedError:
            process.close()
        except TimeoutError:
            process.close()
            return -signal.SIGKILL
        except BaseException:  # an interrupt: the reply must not be taken for that of another job
            process.close()
            raise
        else:
            give_back(process)
            return ended
    return 1


def _receive_reply(pipe: BinaryIO, patience_s: float) -> tuple[Reply, Arrays]:
    head = bytearray(HEAD_BYTES)
    _fill(pipe, memoryview(head), patience_s)
    text = bytearray(int.from_bytes(head, "little"))
    _fill(pipe, memoryview(text), patience_s)
    reply = msgspec.json.decode(text, type=Reply)
    arrays: Arrays = {}
    for name, kind, length in reply.arrays:
        dtype = np.dtype(kind if isinstance(kind, str) else [tuple(column) for column in kind])
        array = np.empty(length, dtype)
        if array.nbytes:
            _fill(pipe, memoryview(array.view("u1").data), patience_s)
        arrays[name] = array
    return reply, arrays


def _fill(pipe: BinaryIO, view: memoryview, patience_s: float) -> None:
    """Fill a buffer; raises EOFError if less comes, TimeoutError if nothing comes."""
    poll = select.poll()
    poll.register(pipe, select.POLLIN)
    while view:
        if not poll.poll(1000 * patience_s):
            raise TimeoutError
        n = pipe.readinto(view)  # type: ignore[attr-defined]
        if not n:
            raise EOFError
        view = view[n:]


def _ending(path: Path, code: int) -> str:
    """How the other process ended without a reply; a negative code is that of a signal."""
    if -code in {signal.SIGXCPU, signal.SIGKILL}:
        return _too_long(path)
    how = f"with signal {-code}" if code < 0 else "without a reply"
    return f"{path} is damaged: the HDF5 library ended {how} while reading it"


def _too_long(path: Path) -> str:
    return f"{path} takes longer to read than any run of its size"
