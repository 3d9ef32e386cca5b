"""A recorder in a process of its own, on a card that may fail."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from logger.core.runfile import Run
from tests.kit import service
from tests.kit.faulty_card import Card

_RECORD = """
import os, sys, threading
from pathlib import Path
from logger.core.live_settings import LiveSettings
from logger.core.runfile import RunWriter, journal, journal_path
from logger.core.types import RawBytes, Record
from logger.device import recorder as recorder_module
from logger.device.clock import Clock
from logger.device.link import Inbox
from tests.kit import runs
recorder_module.TICK_S = 0.05
journal.MOST_WAITING_BYTES = int(sys.argv[2])
inbox, clock, ended = Inbox(), Clock(), threading.Event()
writer = RunWriter(journal_path(Path(sys.argv[1])), runs.meta())
def report(*words):
    os.write(1, " ".join(map(str, words + ("\\n",))).encode())
def durable():
    report("durable", recorder.counts["RawBytes"])
recorder = recorder_module.Recorder(writer, LiveSettings(), inbox, clock, ended, durable=durable)
thread = threading.Thread(target=recorder.run)
thread.start()
threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
n, state = 0, ""
while not ended.wait(0.002):
    inbox.put(Record(clock.now_ns(), "gnss", RawBytes(n.to_bytes(8, "little"))))
    n += 1
    if n % 500 == 0:
        report("put", n)
    if recorder.state != state:
        state = recorder.state
        report("state", state)
recorder.finish("end of the test")
thread.join()
report("put", n)
sys.exit(0 if recorder.error is None else 1)
"""


class RecorderProcess:
    """A recorder in a process of its own; it reports how many records are durable.

    It receives a raw record with a running number every 2 ms.
    """

    def __init__(self, process: subprocess.Popen[str], output: Path) -> None:
        self.process = process
        self._output = output
        self._lines_seen = 0

    def lines(self, topic: str) -> list[str]:
        """Values it has printed so far on one topic: durable, put or state."""
        lines = [line.partition(" ") for line in self._output.read_text().splitlines()]
        return [text.strip() for word, _, text in lines if word == topic]

    @property
    def durable(self) -> int:
        return int((self.lines("durable") or ["0"])[-1])

    def wait_durable(self, more: int = 1) -> None:
        """Wait until more records are durable."""
        goal = self.durable + more
        service.wait_for(lambda: self.durable >= goal)

    def wait_state(self, *texts: str) -> None:
        """Wait for one of the states after those of earlier calls; some last for one tick only."""

        def is_one() -> list[int]:
            states = enumerate(self.lines("state"), 1)
            return [i for i, state in states if i > self._lines_seen and state in texts]

        service.wait_for(is_one)
        self._lines_seen = is_one()[0]

    def wait_put(self, more: int) -> None:
        """Wait until it has received about this many more records."""
        goal = int((self.lines("put") or ["0"])[-1]) + more
        service.wait_for(lambda: int((self.lines("put") or ["0"])[-1]) >= goal)

    def stop(self) -> int:
        """Stop the recorder; return the number of records it received."""
        self.process.stdin.close()
        assert self.process.wait(service.LIMIT_S) == 0
        return int(self.lines("put")[-1])


@contextmanager
def running_recorder(
    card: Card, *, most_waiting: int = 16 << 20, trace: bool = False
) -> Iterator[RecorderProcess]:
    """Run a recorder that writes to the card; it is killed at the end of the block."""
    output = card.folder.with_name("output")
    command = [sys.executable, "-c", _RECORD, str(card.folder), str(most_waiting)]
    environment = card.environment(trace=trace)
    with (
        output.open("w") as out,
        subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=out,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
        ) as process,
    ):
        try:
            yield RecorderProcess(process, output)
        finally:
            process.kill()


def raw_counts(run: Run) -> list[int]:
    """The running numbers in the raw records of a `RecorderProcess`."""
    return run.raw_bytes.view("<u8").tolist()
