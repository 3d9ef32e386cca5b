"""The start of `fieldlogger run`, up to the first flush that makes a frame durable."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

_INSTRUMENTED = """
import os, sys, time
from importlib.util import _LazyModule
frame_written = False

def pwrite(fd, data, offset, real=os.pwrite):
    global frame_written
    frame_written = frame_written or bytes(data[:4]) == b"CWJ1"
    return real(fd, data, offset)

def reporting(real):
    def flush(fd):
        real(fd)
        if frame_written:
            now_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
            ran = [name for name, module in sys.modules.items() if type(module) is not _LazyModule]
            os.write(1, f"durable {now_ns} {' '.join(ran)}\\n".encode())
            os.fsync, os.fdatasync = flushes
    return flush

flushes = os.fsync, os.fdatasync
os.pwrite, os.fsync, os.fdatasync = pwrite, *map(reporting, flushes)
from logger.cli import main
sys.exit(main())
"""
ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class FirstFlush:
    """Time since boot at the first durable frame, and the modules imported by then."""

    boottime_ns: int
    modules: frozenset[str]


@contextmanager
def instrumented_service(config: Path, tree: Path = ROOT) -> Iterator[subprocess.Popen[bytes]]:
    """Run `fieldlogger run` from a source tree; it is killed at the end of the block.

    It prints one line `durable BOOTTIME_NS MODULES...` at the first durable frame.
    """
    command = [sys.executable, "-c", _INSTRUMENTED, "run", "--config", str(config)]
    environment = os.environ | {"PYTHONPATH": str(tree)}
    # Python puts the current folder before PYTHONPATH, so the service starts beside its
    # configuration, where no other source tree is.
    with subprocess.Popen(
        command,
        cwd=config.parent,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def first_flush(process: subprocess.Popen[bytes]) -> FirstFlush:
    """Wait for the first durable frame."""
    assert process.stdout is not None
    word, boottime_ns, *modules = process.stdout.readline().decode().split()
    assert word == "durable"
    return FirstFlush(int(boottime_ns), frozenset(modules))
