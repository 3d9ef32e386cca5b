"""Untrusted HDF5 files are read in a separate process.

The HDF5 library trusts its files: of 2900 runs with some bytes of their structure changed, five
ended it with a segmentation fault and three took gigabytes. What ends the other process is one
error here. It is started anew and not forked: this one may have threads, and a copy of a process
has the locks that they hold.
"""

import os
import pickle
import select
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np
import numpy.typing as npt

from logger.core.errors import RunFileError
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
"""Length of the reply's first part, little-endian."""
_SIGKILL, _SIGXCPU = 9, 24
_PROGRAM = "from logger.core.runfile.isolated_reader import main; main()"


class Reply(msgspec.Struct):
    """What precedes the arrays: a value, or an error."""

    value: Any = None
    arrays: list[tuple[str, Any, int]] = []
    error: str = ""


class Job(msgspec.Struct, frozen=True):
    """The task of the other process, and its limits of time and memory."""

    path: Path
    task: Task
    arguments: tuple[Any, ...]
    cpu_s: int
    memory_bytes: int


def run_isolated(path: Path, task: Task, *arguments: Any) -> tuple[Any, Arrays]:
    """Run `task(path, *arguments)`, which reads a file, in another process, and return its result.

    Raises `RunFileError`: that of the task, or one that states how the process ended.
    Raises OSError if there is no such file.
    """
    size = path.stat().st_size
    job = Job(path, task, arguments, most_cpu_s(size), 3 * most_memory_bytes(size) + _WORKING_BYTES)
    patience_s = _START_S + _PATIENCE * job.cpu_s
    process = subprocess.Popen(  # noqa: S603 (this Python)
        [
            sys.executable,
            "-P",
            "-c",
            _PROGRAM,
        ],  # nothing is imported from the folder that we are in
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # the library prints while it dies
        bufsize=0,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    with process:
        try:
            reply, arrays = _run_task(process, pickle.dumps(job), patience_s)
        except EOFError:
            raise RunFileError(_ending(path, process.wait())) from None
        except TimeoutError:
            raise RunFileError(_too_long(path)) from None
        finally:
            process.kill()
    if reply.error:
        raise RunFileError(reply.error)
    return reply.value, arrays


def _run_task(
    process: subprocess.Popen[bytes], job: bytes, patience_s: float
) -> tuple[Reply, Arrays]:
    if process.stdin is None or process.stdout is None:
        raise EOFError
    with suppress(BrokenPipeError), process.stdin as stdin:
        stdin.write(job)
    return _receive_reply(process.stdout, patience_s)  # type: ignore[arg-type]


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
    if -code in {_SIGXCPU, _SIGKILL}:
        return _too_long(path)
    how = f"with signal {-code}" if code < 0 else "without a reply"
    return f"{path} is damaged: the HDF5 library ended {how} while reading it"


def _too_long(path: Path) -> str:
    return f"{path} takes longer to read than any run of its size"
