"""The process that reads untrusted files (`logger.core.runfile.isolation`), and its early start.

It imports for 0.2 s. A command that will read a run starts it before its own imports, and both
import at once; nothing is imported here that takes long.
"""

import atexit
import os
import signal
import socket
import subprocess
import sys
from contextlib import suppress

_PROGRAM = "from logger.core.runfile.isolated_reader import main; main()"


class ReaderProcess:
    """A process with a socket for its jobs; `owner` is the process that started it."""

    def __init__(self) -> None:
        self.owner = os.getpid()
        self.socket, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 (this Python)
                # nothing is imported from the folder that we are in
                [sys.executable, "-P", "-c", _PROGRAM],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,  # the library prints while it dies
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                start_new_session=True,  # of its own, to be ended with its fork
            )

    def close(self) -> None:
        """End it and its fork; a copy of it in a forked process is only forgotten."""
        self.socket.close()
        if self.owner == os.getpid():
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()


_idle: list[ReaderProcess] = []
"""Those without a job: there are as many as threads have read at once."""


def start_ahead() -> None:
    """Start one for a file that will be read, unless one waits already."""
    if not _idle:
        _idle.append(ReaderProcess())


def take_idle() -> ReaderProcess | None:
    """One that this process has started; a fork only forgets those of its parent."""
    while _idle:
        reader = _idle.pop()
        if reader.owner == os.getpid():
            return reader
        reader.close()
    return None


def give_back(reader: ReaderProcess) -> None:
    """It waits for further files."""
    _idle.append(reader)


@atexit.register
def close_all() -> None:
    """End the processes that wait for further files; the next file starts one anew."""
    while _idle:
        _idle.pop().close()
