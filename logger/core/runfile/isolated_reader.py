"""The separate process that reads an untrusted HDF5 file (see `isolation`)."""

import os
import pickle
import resource
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import msgspec
import numpy as np

from logger.core.errors import RunFileError
from logger.core.runfile.isolation import HEAD_BYTES, Arrays, Job, Reply


def main() -> None:
    """Do the job on stdin, and write what comes of it to stdout."""
    job: Job = pickle.load(sys.stdin.buffer)  # noqa: S301 (from the process that started this one)
    # what is printed must not come between the parts of the reply
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0) as out:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        _limit(job)
        _send(out, *_outcome(job))
    os._exit(0)  # what a damaged file has left in the library is not cleaned up


def _outcome(job: Job) -> tuple[Reply, Arrays]:
    try:
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
    limits = {resource.RLIMIT_CORE: 0, resource.RLIMIT_CPU: _cpu_s() + job.cpu_s}
    if memory := _address_space_bytes():
        limits[resource.RLIMIT_AS] = memory + job.memory_bytes
    for what, most in limits.items():
        with suppress(ValueError, OSError):  # where a lower limit stands already
            resource.setrlimit(what, (most, resource.getrlimit(what)[1]))
    for _ in range(h5py.h5pl.size()):
        h5py.h5pl.remove(0)


def _cpu_s() -> int:
    """What the start has taken, rounded up."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return int(used.ru_utime + used.ru_stime) + 1


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
