"""The start of `fieldlogger run`, watched from inside: what happens at the first flush that makes a
frame durable.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_WATCHED = """
import os, sys
framed = False

def pwrite(fd, data, offset, real=os.pwrite):
    global framed
    framed = framed or bytes(data[:4]) == b"CWJ1"
    return real(fd, data, offset)

def flushing(real):
    def flush(fd):
        real(fd)
        if framed:
            os.write(1, ("durable " + " ".join(sys.modules) + "\\n").encode())
            os.fsync, os.fdatasync = flushes
    return flush

flushes = os.fsync, os.fdatasync
os.pwrite, os.fsync, os.fdatasync = pwrite, *map(flushing, flushes)
from logger.cli import main
sys.exit(main())
"""


@contextmanager
def starting(config: Path) -> Iterator[subprocess.Popen[bytes]]:
    """`fieldlogger run`, which writes a line `durable MODULES...` at that flush; it does not
    outlive the test.
    """
    command = [sys.executable, "-c", _WATCHED, "run", "--config", str(config)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        try:
            yield process
        finally:
            process.kill()


def modules_when_durable(process: subprocess.Popen[bytes]) -> list[str]:
    """The modules imported by then."""
    assert process.stdout is not None
    word, *modules = process.stdout.readline().decode().split()
    assert word == "durable"
    return modules
