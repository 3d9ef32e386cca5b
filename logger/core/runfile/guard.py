"""HDF5 files of strangers are read in a process of their own.

The HDF5 library trusts its files: of 2900 runs with some bytes of their structure changed, five ended it with a
segmentation fault and three took gigabytes. What ends the other process is one error here.
"""

import faulthandler
import os
import resource
import select
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import h5py
import msgspec
import numpy as np
import numpy.typing as npt
from h5py._objects import phil

from logger.core.errors import RunFileError
from logger.core.runfile.limits import most_cpu_s, most_kept_bytes

Arrays = dict[str, npt.NDArray[Any]]
Task = Callable[[], tuple[Any, Arrays]]
"""Gives a value that JSON can hold, and arrays."""

_WORKING_BYTES = 192 << 20
"""For HDF5 and numpy, beyond what is read twice: as it is stored, and as it is given back."""
_PATIENCE = 20
"""Real seconds for each second of computing: a busy machine has no more for us. Only a hang-up takes so long."""
_HEAD_BYTES = 8
_SIGKILL, _SIGXCPU = 9, 24


class _Reply(msgspec.Struct):
    """What comes before the arrays: a value, or what was wrong."""

    value: Any = None
    arrays: list[tuple[str, Any, int]] = []
    error: str = ""


def guarded(path: Path, task: Task) -> tuple[Any, Arrays]:
    """Run a task that reads a file in another process, and give what it gives.

    Raises `RunFileError`: the task's own, or one that says how the process ended.
    """
    size = path.stat().st_size
    reading, writing = os.pipe()
    with warnings.catch_warnings(), phil:  # no other thread is within HDF5 while this process is copied
        warnings.simplefilter("ignore", DeprecationWarning)  # of other threads, which the copy has not
        process = os.fork()
    if not process:
        os.close(reading)
        _work(writing, size, path, task)
    os.close(writing)
    try:
        with os.fdopen(reading, "rb", buffering=0) as pipe:
            reply, arrays = _received(pipe, _PATIENCE * most_cpu_s(size))
    except EOFError:
        raise RunFileError(_ending(path, os.waitpid(process, 0)[1])) from None
    except TimeoutError:
        _end(process)
        raise RunFileError(_too_long(path)) from None
    except BaseException:
        _end(process)
        raise
    _end(process)
    if reply.error:
        raise RunFileError(reply.error)
    return reply.value, arrays


def _work(pipe: int, size: int, path: Path, task: Task) -> NoReturn:
    """All that the other process does; nothing of what it has copied is cleaned up or flushed twice."""
    try:
        # copies of files, locks and ports of other threads are not held on to
        os.closerange(3, pipe)
        os.closerange(pipe + 1, os.sysconf("SC_OPEN_MAX"))
        _limit(size)
        with os.fdopen(pipe, "wb", buffering=0) as out:
            _send(out, *_outcome(path, task))
    finally:
        os._exit(0)


def _outcome(path: Path, task: Task) -> tuple[_Reply, Arrays]:
    try:
        value, arrays = task()
    except RunFileError as error:
        return _Reply(error=str(error)), {}
    except MemoryError:
        return _Reply(error=f"{path} takes more memory than any run of its size"), {}
    except Exception as error:  # noqa: BLE001 (whatever HDF5 makes of a damaged file)
        return _Reply(error=f"{path} is damaged: {error}"), {}
    told = [(name, _dtype_text(array.dtype), len(array)) for name, array in arrays.items()]
    return _Reply(value, told), arrays


def _limit(size: int) -> None:
    """Bound memory and time; what the library prints while it dies goes nowhere, and no plug-in is loaded."""
    faulthandler.disable()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    limits = {resource.RLIMIT_CORE: 0, resource.RLIMIT_CPU: most_cpu_s(size)}
    if memory := _address_space():
        limits[resource.RLIMIT_AS] = memory + 3 * most_kept_bytes(size) + _WORKING_BYTES
    for what, most in limits.items():
        with suppress(ValueError, OSError):  # where a lower limit stands already
            resource.setrlimit(what, (most, resource.getrlimit(what)[1]))
    for _ in range(h5py.h5pl.size()):
        h5py.h5pl.remove(0)


def _address_space() -> int:
    """Bytes of this process, 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except OSError:
        return 0


def _send(out: BinaryIO, reply: _Reply, arrays: Arrays) -> None:
    head = msgspec.json.encode(reply)
    _write(out, len(head).to_bytes(_HEAD_BYTES, "little") + head)
    for array in arrays.values():
        _write(out, np.ascontiguousarray(array).view("u1").data if array.nbytes else b"")


def _write(out: BinaryIO, data: bytes | memoryview) -> None:
    view = memoryview(data)
    while view:
        view = view[out.write(view) :]


def _received(pipe: BinaryIO, patience_s: float) -> tuple[_Reply, Arrays]:
    head = bytearray(_HEAD_BYTES)
    _fill(pipe, memoryview(head), patience_s)
    told = bytearray(int.from_bytes(head, "little"))
    _fill(pipe, memoryview(told), patience_s)
    reply = msgspec.json.decode(told, type=_Reply)
    arrays: Arrays = {}
    for name, kind, length in reply.arrays:
        array = np.empty(length, kind if isinstance(kind, str) else np.dtype([tuple(column) for column in kind]))
        if array.nbytes:
            _fill(pipe, memoryview(array.view("u1").data), patience_s)
        arrays[name] = array
    return reply, arrays


def _fill(pipe: BinaryIO, view: memoryview, patience_s: float) -> None:
    """Read as much as there is room for; raises EOFError where less comes, TimeoutError where nothing does."""
    poll = select.poll()
    poll.register(pipe, select.POLLIN)
    while view:
        if not poll.poll(1000 * patience_s):
            raise TimeoutError
        n = pipe.readinto(view)  # type: ignore[attr-defined]
        if not n:
            raise EOFError
        view = view[n:]


def _end(process: int) -> None:
    """End a process that has nothing more to do."""
    with suppress(ProcessLookupError):
        os.kill(process, _SIGKILL)
    os.waitpid(process, 0)


def _ending(path: Path, status: int) -> str:
    """How the other process ended without a word."""
    number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    if number in {_SIGXCPU, _SIGKILL}:
        return _too_long(path)
    how = f"with signal {number}" if number else "without a word"
    return f"{path} is damaged: the HDF5 library ended {how} while reading it"


def _too_long(path: Path) -> str:
    return f"{path} takes longer to read than any run of its size"


def _dtype_text(dtype: np.dtype[Any]) -> Any:
    # h5py's types of text carry notes of its own, which `descr` would tell too
    return [(name, dtype[name].str) for name in dtype.names] if dtype.names else dtype.str
