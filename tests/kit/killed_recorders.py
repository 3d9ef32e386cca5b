"""Recorders that are killed with SIGKILL at random moments."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_KILL = """
import mmap, os, random, signal, struct, sys, threading, time
from pathlib import Path
from logger.core.live_settings import LiveSettings
from logger.core.runfile import RunWriter
from logger.device.clock import Clock
from logger.device.link import Inbox
from logger.device.recorder import Recorder
from logger.core.types import RawBytes, Record
from tests.kit import runs

def record(path, shared, parent):
    inbox, clock = Inbox(), Clock()
    durable = lambda: struct.pack_into("<Q", shared, 0, recorder.counts["RawBytes"])
    writer = RunWriter(path, runs.meta())
    recorder = Recorder(writer, LiveSettings(), inbox, clock, threading.Event(), durable=durable)
    threading.Thread(target=recorder.run).start()
    n = 0
    for record_on_the_walk in walk:
        inbox.put(Record(clock.now_ns(), "count", RawBytes(n.to_bytes(8, "little"))))
        inbox.put(record_on_the_walk)
        n += 1
        time.sleep(0.01)
        if os.getppid() != parent:
            os._exit(1)  # nobody is left to kill it

folder, kills, at_once, seed = Path(sys.argv[1]), *map(int, sys.argv[2:])
rng, walk = random.Random(seed), runs.records(400)
for first in range(0, kills, at_once):
    children = {}
    for i in range(first, min(first + at_once, kills)):
        shared = mmap.mmap(-1, 8)
        pid = os.fork()
        if pid == 0:
            record(folder / f"run-{i + 1:06d}.journal", shared, os.getppid())
            os._exit(1)
        # one in ten at any moment, the others at some time after their journal has begun
        due = time.monotonic() + rng.uniform(0.02, 1.0) if i % 10 == 0 else None
        children[i] = (due, rng.uniform(0.0, 3.0), pid, shared)
    while children:
        for i, (due, lives_s, pid, shared) in list(children.items()):
            journal = folder / f"run-{i + 1:06d}.journal"
            if due is None and journal.exists() and journal.stat().st_size:
                children[i] = (time.monotonic() + lives_s, lives_s, pid, shared)
            elif due is not None and time.monotonic() >= due:
                killed_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)
                print(i + 1, killed_ns, struct.unpack("<Q", shared)[0], flush=True)
                del children[i]
        time.sleep(0.005)
"""


@dataclass(frozen=True)
class Killed:
    """A killed recorder: its journal, the time, and the number of acknowledged records."""

    journal: Path
    killed_ns: int
    n_durable: int


def kill_recorders(folder: Path, kills: int, at_once: int = 16, seed: int = 1) -> Iterator[Killed]:
    """Start recorders and kill -9 them at random moments."""
    command = [sys.executable, "-c", _KILL, str(folder), str(kills), str(at_once), str(seed)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            number, killed_ns, n_durable = map(int, line.split())
            yield Killed(folder / f"run-{number:06d}.journal", killed_ns, n_durable)
    assert process.returncode == 0
