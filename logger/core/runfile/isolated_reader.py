"""The process that forks for each untrusted HDF5 file, and what a fork does (see `isolation`)."""

import os
import pickle
import resource
import socket
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import msgspec
import numpy as np

from logger.core.errors import RunFileError
from logger.core.runfile.isolation import HEAD_BYTES, STATUS_BYTES, Arrays, Job, Reply

_IDLE_S = 10.0
"""A program that reads several runs reads the next one by then; others need no server."""


def main() -> None:
    """Fork for each job that comes through the socket on stdin, until none comes for a while."""
    with socket.socket(fileno=sys.stdin.fileno()) as jobs:
        jobs.settimeout(_IDLE_S)
        with suppress(EOFError, OSError):
            while True:
                job, out = _next_job(jobs)
                fork = os.fork()
                if not fork:
                    _do(job, out)
                os.close(out)
                status = os.waitstatus_to_exitcode(os.waitpid(fork, 0)[1])
                jobs.sendall(status.to_bytes(STATUS_BYTES, "little", signed=True))


def _next_job(jobs: socket.socket) -> tuple[Job, int]:
    """A job and the pipe for its reply; raises EOFError where nobody asks any more."""
    head, pipes, _, _ = socket.recv_fds(jobs, HEAD_BYTES, 1)
    if not head:
        raise EOFError
    jobs.settimeout(None)
    data = jobs.recv(int.from_bytes(head, "little"), socket.MSG_WAITALL)
    jobs.settimeout(_IDLE_S)
    return pickle.loads(data), pipes[0]  # noqa: S301 (from the process that started this one)


def _do(job: Job, pipe: int) -> None:
    """What a fork does, and its end."""
    with os.fdopen(pipe, "wb", buffering=0) as out:
        _limit(job)
        _send(out, *_outcome(job))
    os._exit(0)  # what a damaged file has left in the library is not cleaned up


def _outcome(job: Job) -> tuple[Reply, Arrays]:
    try:
        if job.folder:
            os.chdir(job.folder)
        value, arrays = job.task(job.path, *job.arguments)
    except RunFileError as error:
        return Reply(error=str(error)), {}
    except MemoryError:
        return Reply(error=f"{job.path} takes more memory than any run of its size"), {}
    except Exception as error:  # noqa: BLE001 (whatever HDF5 makes of a damaged file)
        return Reply(error=f"{job.path} is damaged: {error}"), {}
    described = [(name, _dtype_text(array.dtype), len(array)) for name, array in arrays.items()]
    return Reply(value, described), arrays


def _limit(job: Job) -> None:
    """Bound memory and time, and load no plug-in."""
    limits = {resource.RLIMIT_CORE: 0, resource.RLIMIT_CPU: 1 + job.cpu_s}
    if memory := _address_space_bytes():
        limits[resource.RLIMIT_AS] = memory + job.memory_bytes
    for what, most in limits.items():
        with suppress(ValueError, OSError):  # where a lower limit stands already
            resource.setrlimit(what, (most, resource.getrlimit(what)[1]))
    for _ in range(h5py.h5pl.size()):
        h5py.h5pl.remove(0)


def _address_space_bytes() -> int:
    """Size of the address space of this process, 0 if the system does not report it."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except OSError:
        return 0


def _send(out: BinaryIO, reply: Reply, arrays: Arrays) -> None:
    head = msgspec.json.encode(reply)
    _write(out, len(head).to_bytes(HEAD_BYTES, "little") + head)
    for array in arrays.values():
        _write(out, np.ascontiguousarray(array).view("u1").data if array.nbytes else b"")


def _write(out: BinaryIO, data: bytes | memoryview) -> None:
    view = memoryview(data)
    while view:
        view = view[out.write(view) :]


def _dtype_text(dtype: np.dtype[Any]) -> Any:
    # h5py's text types carry metadata, which `descr` would include
    return [(name, dtype[name].str) for name in dtype.names] if dtype.names else dtype.str
