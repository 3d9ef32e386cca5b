"""How long after its start a process has the first bytes of a run on the card.

    python benchmarks/start.py [--times 20] [--busy 4] [--tree PATH]

`fieldlogger run` is started anew each time, as it stands in `--tree` (default: here), beside so
many busy loops. Its `os.pwrite`, `os.fsync` and `os.fdatasync` are watched: durable is the first
flush that returns after a frame was written.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_WATCHED = """
import os, sys, time
told, framed = int(sys.argv.pop()), False

def pwrite(fd, data, offset, real=os.pwrite):
    global framed
    framed = framed or bytes(data[:4]) == b"CWJ1"
    return real(fd, data, offset)

def flushing(real):
    def flush(fd):
        real(fd)
        if framed:
            os.write(told, b"%d\\n" % time.clock_gettime_ns(time.CLOCK_BOOTTIME))
    return flush

os.pwrite, os.fsync, os.fdatasync = pwrite, flushing(os.fsync), flushing(os.fdatasync)
from logger.cli import main
main()
"""

_SITE = """
[run]
directory = "{folder}"
[modem]
port = "{folder}/no-modem"
[gnss]
port = "{folder}/no-receiver"
"""


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """So many processes that do nothing but take the processor."""
    running = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(loops)]
    try:
        yield
    finally:
        for process in running:
            process.kill()
            process.wait()


def start_s(folder: Path, tree: Path) -> float:
    """Seconds from the start of a process to its first durable bytes; it is killed then."""
    site = folder / "site.toml"
    site.write_text(_SITE.format(folder=folder))
    heard, told = os.pipe()
    command = [sys.executable, "-c", _WATCHED, "run", "--config", str(site), str(told)]
    begun_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    environment = os.environ | {"PYTHONPATH": str(tree)}
    # the current folder comes first in the path, before the tree
    with subprocess.Popen(
        command, pass_fds=[told], env=environment, cwd=folder, stderr=subprocess.DEVNULL
    ) as process:
        os.close(told)
        with os.fdopen(heard) as lines:
            first = lines.readline()
        process.kill()
    return (int(first) - begun_ns) / 1e9


def main() -> None:
    """Print median and worst."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--busy", type=int, default=0)
    parser.add_argument("--tree", type=Path, default=Path(__file__).parents[1])
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, busy(arguments.busy):
        found = sorted(start_s(Path(folder), arguments.tree) for _ in range(arguments.times))
    print(
        f"start to first durable byte, beside {arguments.busy} busy loops, {len(found)} starts: "
        f"median {statistics.median(found):.2f} s, worst {found[-1]:.2f} s"
    )


if __name__ == "__main__":
    main()
