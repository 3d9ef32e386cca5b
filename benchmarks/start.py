"""Time from the start of a process to the first durable bytes of a run.

python benchmarks/start.py [--times 20] [--busy 4] [--tree PATH]

`fieldlogger run` of the source tree `--tree` is started `--times` times, beside `--busy` busy
loops. The first durable bytes are those of the first flush that returns after a frame was written.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.kit.first_flush import ROOT, first_flush, instrumented_service

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
    """Run processes that only use the processor."""
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(loops)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def start_s(folder: Path, tree: Path) -> float:
    """Seconds from the start of a process to its first durable bytes."""
    site = folder / "site.toml"
    site.write_text(_SITE.format(folder=folder))
    start_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    with instrumented_service(site, tree) as process:
        return (first_flush(process).boottime_ns - start_ns) / 1e9


def main() -> None:
    """Print the median and the longest time."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--busy", type=int, default=0)
    parser.add_argument("--tree", type=Path, default=ROOT)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, busy(options.busy):
        times_s = sorted(start_s(Path(folder), options.tree) for _ in range(options.times))
    print(
        f"start to first durable byte, beside {options.busy} busy loops, {len(times_s)} starts: "
        f"median {statistics.median(times_s):.2f} s, longest {times_s[-1]:.2f} s"
    )


if __name__ == "__main__":
    main()
