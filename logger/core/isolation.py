"""Untrusted HDF5 files are read in another process, of limited memory and time.

The HDF5 library trusts its files: of 2900 runs with some bytes of their structure changed, five
ended it with a segmentation fault and three took gigabytes. What ends the other process is one
error here. It reads no file after one that it could not read; else it waits a while for the next
one, because starting takes longer than reading a walk. It is no fork, since this process may have
threads, and a copy has the locks that they hold.

A command that will read a run starts the process before its own imports, and both import at once;
so this module imports nothing that takes long.
"""

import atexit
import json
import math
import os
import pkgutil
import resource
import select
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from logger.core.errors import RunFileError

Outcome = tuple[Any, dict[str, tuple[Any, bytearray]]]
"""A value of JSON, and arrays by name: description of the dtype, and the bytes."""

_PROGRAM = "import {}; from logger.core.isolation import serve; serve()"
"""The module of the tasks is imported while the process waits for its files."""
_MB = 1 << 20
_WORKING_BYTES = 192 * _MB
"""For HDF5 and numpy, beyond what is read twice: as stored and as given back."""
_PATIENCE = 20
"""Real seconds allowed for each second of computing: the machine may be busy."""
_START_S = 30
"""Real seconds that the process may wait in addition, for card or processor."""
_LENGTH_BYTES = 8
"""Of the first part of a reply; little-endian."""

_IDLE_S = 10.0
"""A program that reads several runs reads the next one by then."""
_UNUSED = 75
"""Exit code of a process that has read nothing since its last reply."""

_ready: dict[int, list[subprocess.Popen[bytes]]] = {}
"""Those that wait for a file, by the process that started them: a fork leaves them alone."""


def most_memory_bytes(file_bytes: int) -> int:
    """Of tables, or of raw bytes, that are held in memory at once.

    A file of some megabytes that claims gigabytes is no walk. Honest files, packed, hold 4 to 5
    times their size, 35 times where all levels are the same, and 90 times in a simulated run
    without raw bytes, most of whose columns are unknown.
    """
    return 64 * _MB + 120 * file_bytes


def most_unpacked_bytes(file_bytes: int) -> int:
    """Limit of all unpacked blocks of a file together.

    A port that is stuck for a day gives 1 GB of zeros, which pack to 1 MB.
    """
    return 1024 * _MB + 100 * file_bytes


def most_cpu_s(file_bytes: int) -> int:
    """Of reading; a Raspberry Pi reads an honest file twenty times faster."""
    return 4 + round(0.4 * file_bytes / 1e6)


def start_ahead(module: str) -> None:
    """Start the process for a file that tasks of `module` will read, unless one waits."""
    waiting = _ready.setdefault(os.getpid(), [])
    if not waiting:
        waiting.append(_start(module))


def run_isolated(task: str, path: Path, *arguments: Any) -> Outcome:
    """Run a task that reads a file in another process, and return its result.

    `task` is "module:function", called with the path and the arguments; it returns a value for
    JSON, and arrays of one dimension. Raises `RunFileError`: that of the task, or one that states
    how the process ended.
    """
    folder = "" if path.is_absolute() else str(Path.cwd())
    job = json.dumps([task, folder, str(path), arguments]).encode() + b"\n"
    module = task.partition(":")[0]
    process = _waiting() or _start(module)
    if (found := _ask(process, job)) == _UNUSED:  # it ended as the job came
        process = _start(module)
        found = _ask(process, job)
    if isinstance(found, int):
        raise RunFileError(_ending(path, found))
    if isinstance(found, str):
        raise RunFileError(found)
    _ready.setdefault(os.getpid(), []).append(process)
    return found


@atexit.register
def end_all() -> None:
    """End the waiting processes; the next file starts one anew."""
    for process in _ready.pop(os.getpid(), []):
        with suppress(KeyboardInterrupt):  # the answer is out, and a killed process needs no wait
            _end(process)


def _waiting() -> subprocess.Popen[bytes] | None:
    waiting = _ready.get(os.getpid())
    while waiting:
        process = waiting.pop()
        if process.poll() is None:
            return process
        _end(process)
    return None


def _start(module: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(  # noqa: S603 (this Python)
        # nothing is imported from the folder that we are in
        [sys.executable, "-P", "-c", _PROGRAM.format(module)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # the library prints while it dies
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            "HDF5_PLUGIN_PRELOAD": "::",  # load no plug-in
        },
        start_new_session=True,  # an interrupt is ours to answer
    )


def _ask(process: subprocess.Popen[bytes], job: bytes) -> Outcome | str | int:
    """A result, an error, or the code of a process that ended without a reply.

    After anything but a result the process is ended.
    """
    assert process.stdin
    assert process.stdout
    found: Outcome | str | int = ""
    try:
        with suppress(BrokenPipeError):  # its end is seen below
            process.stdin.write(job)
            process.stdin.flush()
        n_bytes = int.from_bytes(_read(process.stdout, _LENGTH_BYTES), "little")
        error, value, described = json.loads(_read(process.stdout, n_bytes))
        arrays = {name: (dtype, _read(process.stdout, n)) for name, dtype, n in described}
        found = error or (value, arrays)
    except EOFError:
        found = process.wait()
    finally:
        if not isinstance(found, tuple):  # an interrupt or want of memory too
            _end(process)
    return found


def _end(process: subprocess.Popen[bytes]) -> None:
    with suppress(BrokenPipeError), process:  # closes its pipes and waits for its end
        process.kill()


def _read(pipe: IO[bytes], n_bytes: int) -> bytearray:
    """Raises EOFError if fewer bytes come."""
    data = bytearray(n_bytes)
    if pipe.readinto(data) < n_bytes:  # type: ignore[attr-defined]
        raise EOFError
    return data


def _ending(path: Path, code: int) -> str:
    if -code in {signal.SIGXCPU, signal.SIGALRM, signal.SIGKILL}:
        return f"{path} takes longer to read than any run of its size"
    how = f"with signal {-code}" if code < 0 else "without a reply"
    return f"{path} is damaged: the HDF5 library ended {how} while reading it"


def serve() -> None:
    """Be the other process: read the files named on stdin, and reply on stdout."""
    with os.fdopen(os.dup(1), "wb") as out:
        os.dup2(2, 1)  # what a library prints is no part of a reply
        error = ""
        while not error and select.select([0], [], [], _IDLE_S)[0]:
            if not (job := sys.stdin.buffer.readline()):
                break
            (error, value, described), arrays = _outcome(*json.loads(job))
            signal.alarm(0)  # who asked may take its time now
            head = json.dumps([error, value, described], ensure_ascii=False).encode()
            out.write(len(head).to_bytes(_LENGTH_BYTES, "little") + head)
            for array in arrays:
                out.write(array.view("u1").data)
            out.flush()
    os._exit(_UNUSED)  # what a damaged file has left in the library is not cleaned up


def _outcome(
    task: str, folder: str, name: str, arguments: list[Any]
) -> tuple[tuple[str, Any, list[Any]], list[Any]]:
    """The first part of a reply (error, value, descriptions of the arrays), and the arrays."""
    path = Path(name)
    try:
        if folder:
            os.chdir(folder)
        read = pkgutil.resolve_name(task)
        _limit(path.stat().st_size)
        value, arrays = read(path, *arguments)
    except RunFileError as error:
        return (str(error), None, []), []
    except OSError as error:
        return (f"{path} cannot be read: {error.strerror or error}", None, []), []
    except MemoryError:
        return (f"{path} takes more memory than any run of its size", None, []), []
    except Exception as error:  # noqa: BLE001 (whatever HDF5 makes of a damaged file)
        return (f"{path} is damaged: {error}", None, []), []
    described = [(name, _dtype_text(array.dtype), array.nbytes) for name, array in arrays.items()]
    return ("", value, described), [array for array in arrays.values() if array.nbytes]


def _limit(file_bytes: int) -> None:
    cpu_s = most_cpu_s(file_bytes)
    limits = {
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_CPU: 1 + math.ceil(sum(os.times()[:2])) + cpu_s,
    }
    with suppress(OSError):  # a system without /proc has no limit of the address space
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        memory_bytes = 3 * most_memory_bytes(file_bytes) + _WORKING_BYTES
        limits[resource.RLIMIT_AS] = pages * resource.getpagesize() + memory_bytes
    for what, most in limits.items():
        with suppress(ValueError, OSError):  # where a lower limit stands already
            resource.setrlimit(what, (most, resource.getrlimit(what)[1]))
    signal.alarm(_START_S + _PATIENCE * cpu_s)


def _dtype_text(dtype: Any) -> Any:
    # h5py's text types carry metadata, which `descr` would include
    return [(name, dtype[name].str) for name in dtype.names] if dtype.names else dtype.str
