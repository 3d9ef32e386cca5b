"""Cards that fail: a preloaded library that refuses, traces and kills at system calls; a recorder
on such a card.
"""

import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from logger.core.runfile import Run
from tests.kit import service

SOURCE = Path(__file__).with_name("faulty_card.c")
_HEADER = struct.Struct("@12sIIQ")


def library(folder: Path) -> Path:
    """The fault library, compiled."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is needed to make the fault library")
    target = folder / "faulty_card.so"
    subprocess.run(
        ["gcc", "-shared", "-fPIC", "-O1", "-w", "-o", target, SOURCE, "-ldl"], check=True
    )
    return target


RECORD = """
import os, sys, threading
from pathlib import Path
from logger.core.live_settings import LiveSettings
from logger.core.runfile import RunWriter, journal_path, writer as writer_module
from logger.core.types import RawBytes, Record
from logger.device import recorder as recorder_module
from logger.device.clock import SystemClock
from logger.device.link import Inbox
from tests.kit import runs
recorder_module.TICK_S = 0.05
writer_module.MOST_WAITING_BYTES = int(sys.argv[2])
inbox, clock, ended = Inbox(), SystemClock(), threading.Event()
writer = RunWriter(journal_path(Path(sys.argv[1])), runs.meta())
def say(*words):
    os.write(1, " ".join(map(str, words + ("\\n",))).encode())
def durable():
    say("durable", recorder.counts["RawBytes"])
recorder = recorder_module.Recorder(writer, LiveSettings(), inbox, clock, ended, durable=durable)
thread = threading.Thread(target=recorder.run)
thread.start()
threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
n, state = 0, ""
while not ended.wait(0.002):
    inbox.put(Record(clock.now_ns(), "gnss", RawBytes(n.to_bytes(8, "little"))))
    n += 1
    if n % 500 == 0:
        say("put", n)
    if recorder.state != state:
        state = recorder.state
        say("state", state)
recorder.finish("told to")
thread.join()
say("put", n)
sys.exit(0 if recorder.error is None else 1)
"""


class Card:
    """A folder whose system calls fail as told."""

    def __init__(self, folder: Path, preload: Path) -> None:
        self.folder = folder / "card"
        self.folder.mkdir(exist_ok=True)
        self.trace = folder / "trace"
        self._faults = folder / "faults"
        self._faults.touch()
        self._preload = preload

    def fails(self, **errors: int) -> None:
        """From now on these operations fail with these errors, all others work."""
        text = "".join(f"{operation} {number}\n" for operation, number in errors.items())
        new = self._faults.with_suffix(".new")
        new.write_text(text)
        new.replace(self._faults)

    def environment(
        self, *, trace: bool = False, kill_at: int | None = None, bad_at: int | None = None
    ) -> dict[str, str]:
        found = {
            "LD_PRELOAD": str(self._preload),
            "CARD": str(self.folder),
            "CARD_FAULTS": str(self._faults),
        }
        if trace:
            found["CARD_TRACE"] = str(self.trace)
        if kill_at is not None:
            found["CARD_KILL_AT"] = str(kill_at)
        if bad_at is not None:
            found["CARD_BAD_AT"] = str(bad_at)
        return os.environ | found


class Recording:
    """A recorder in a process of its own: every 2 ms a raw record that counts; it says what is
    durable.
    """

    def __init__(self, process: subprocess.Popen[str], said: Path) -> None:
        self.process = process
        self._said = said
        self._heard = 0

    def lines(self, what: str) -> list[str]:
        """What it has said so far of one thing."""
        lines = [line.partition(" ") for line in self._said.read_text().splitlines()]
        return [text.strip() for word, _, text in lines if word == what]

    @property
    def durable(self) -> int:
        return int((self.lines("durable") or ["0"])[-1])

    def wait_durable(self, more: int = 1) -> None:
        """Wait until so many more records are durable."""
        goal = self.durable + more
        service.wait_for(lambda: self.durable >= goal)

    def wait_state(self, text: str) -> None:
        """Wait until it has said this after what was waited for before; some states last a tick
        only.
        """
        service.wait_for(lambda: text in self.lines("state")[self._heard :])
        self._heard += self.lines("state")[self._heard :].index(text) + 1

    def wait_put(self, more: int) -> None:
        """Wait until it was given about so many more records."""
        goal = int((self.lines("put") or ["0"])[-1]) + more
        service.wait_for(lambda: int((self.lines("put") or ["0"])[-1]) >= goal)

    def stop(self) -> int:
        """End it; returns the number of records it was given."""
        self.process.stdin.close()
        assert self.process.wait(service.LIMIT_S) == 0
        return int(self.lines("put")[-1])


@contextmanager
def recording(
    card: Card, *, most_waiting: int = 16 << 20, trace: bool = False
) -> Iterator[Recording]:
    """A recorder that writes to the card, and does not outlive the test."""
    said = card.folder.with_name("said")
    command = [sys.executable, "-c", RECORD, str(card.folder), str(most_waiting)]
    environment = card.environment(trace=trace)
    with said.open("w") as out, subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=out, stderr=subprocess.DEVNULL, text=True, env=environment
    ) as process:  # fmt: skip
        try:
            yield Recording(process, said)
        finally:
            process.kill()


def raw_counts(run: Run) -> list[int]:
    """The counts in the raw records of a `Recording`."""
    return run.raw_bytes.view("<u8").tolist()


@dataclass(frozen=True)
class Operation:
    """One system call of a trace."""

    what: str
    path: Path
    offset: int
    data: bytes


def operations(trace: Path) -> list[Operation]:
    """What was done to the card, in order."""
    data, at, found = trace.read_bytes(), 0, []
    while at < len(data):
        what, name_length, length, offset = _HEADER.unpack_from(data, at)
        at += _HEADER.size
        path = Path(data[at : at + name_length].decode())
        at += name_length
        what = what.rstrip(b"\0").decode()
        body = data[at : at + length] if what == "pwrite" else b""
        at += len(body)
        found.append(Operation(what, path, offset, body))
    return found


def replay(operation: Operation, folder: Path) -> Iterator[None]:
    """Do it again in another folder; stops after each state that the card may be left in."""
    path = folder / operation.path.name
    match operation.what:
        case "create":
            path.touch(exist_ok=False)
        case "pwrite":
            half = len(operation.data) // 2
            for start, end in ((0, half), (half, None)):
                with path.open("r+b") as file:
                    file.seek(operation.offset + start)
                    file.write(operation.data[start:end])
                yield
            return
        case "ftruncate":
            os.truncate(path, operation.offset)
    yield


@contextmanager
def small_file_system(folder: Path, options: str) -> Iterator[Path]:
    """A tmpfs of its own; the test is skipped where none can be mounted."""
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("no file system can be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=False)


KILL = """
import mmap, os, random, signal, struct, sys, threading, time
from pathlib import Path
from logger.core.live_settings import LiveSettings
from logger.core.runfile import RunWriter
from logger.device.clock import SystemClock
from logger.device.link import Inbox
from logger.device.recorder import Recorder
from logger.core.types import RawBytes, Record
from tests.kit import runs

def record(path, told, parent):
    inbox, clock = Inbox(), SystemClock()
    durable = lambda: struct.pack_into("<Q", told, 0, recorder.counts["RawBytes"])
    writer = RunWriter(path, runs.meta())
    recorder = Recorder(writer, LiveSettings(), inbox, clock, threading.Event(), durable=durable)
    threading.Thread(target=recorder.run).start()
    n = 0
    for found in walk:
        inbox.put(Record(clock.now_ns(), "count", RawBytes(n.to_bytes(8, "little"))))
        inbox.put(found)
        n += 1
        time.sleep(0.01)
        if os.getppid() != parent:
            os._exit(1)  # nobody is left to kill it

folder, kills, at_once, seed = Path(sys.argv[1]), *map(int, sys.argv[2:])
rng, walk = random.Random(seed), runs.records(400)
for first in range(0, kills, at_once):
    children = {}
    for i in range(first, min(first + at_once, kills)):
        told = mmap.mmap(-1, 8)
        pid = os.fork()
        if pid == 0:
            record(folder / f"run-{i + 1:06d}.journal", told, os.getppid())
            os._exit(1)
        # one in ten at any moment, the others after their journal has begun, however long that takes
        due = time.monotonic() + rng.uniform(0.02, 1.0) if i % 10 == 0 else None
        children[i] = (due, rng.uniform(0.0, 3.0), pid, told)
    while children:
        for i, (due, lives_s, pid, told) in list(children.items()):
            journal = folder / f"run-{i + 1:06d}.journal"
            if due is None and journal.exists() and journal.stat().st_size:
                children[i] = (time.monotonic() + lives_s, lives_s, pid, told)
            elif due is not None and time.monotonic() >= due:
                killed_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)
                print(i + 1, killed_ns, struct.unpack("<Q", told)[0], flush=True)
                del children[i]
        time.sleep(0.005)
"""


@dataclass(frozen=True)
class Killed:
    """A recorder that was killed: its journal, when, and how many of its counting records were
    acknowledged.
    """

    journal: Path
    killed_ns: int
    n_durable: int


def kill_recorders(folder: Path, kills: int, at_once: int = 16, seed: int = 1) -> Iterator[Killed]:
    """Start recorders and kill -9 them at random moments."""
    command = [sys.executable, "-c", KILL, str(folder), str(kills), str(at_once), str(seed)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            number, killed_ns, n_durable = map(int, line.split())
            yield Killed(folder / f"run-{number:06d}.journal", killed_ns, n_durable)
    assert process.returncode == 0
