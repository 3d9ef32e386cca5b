"""Pseudo-terminals that look like serial ports, and the threads that talk behind them.

with PtyDevice(answering(modem)) as port:
    serial.Serial(port.path)
"""

import os
import select
import threading
import tty
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from logger.sim.devices import SimulatedModem, SimulatedReceiver
from logger.sim.faults import Misbehaving
from logger.sim.walk import WalkTime

CHUNK = 4096
PAUSE_S = 0.02


class PtyLine:
    """Reads and writes until `stop` is set; a closed far end is a normal state.

    What is written while the far end is open waits for the program that has opened it; one that
    flushes the port as it opens it, as pyserial does, loses what came before, as of a real device.
    """

    def __init__(self, master: int, stop: threading.Event) -> None:
        self.stop = stop
        self._master = master
        os.set_blocking(master, False)

    def close(self) -> None:
        os.close(self._master)

    def read(self, timeout_s: float) -> bytes:
        """Bytes that came; empty after the real seconds, and while the far end is closed."""
        if not self._wait(select.POLLIN, timeout_s):
            return b""
        try:
            return os.read(self._master, CHUNK)
        except OSError:  # EIO: closed meanwhile
            return b""

    def write(self, data: bytes) -> bool:
        """Write all, as slowly as it is read; False once the far end is closed or `stop` is set."""
        while data:
            if self.stop.is_set() or not self._is_open():
                return False
            if self._wait(select.POLLOUT, PAUSE_S):
                try:
                    data = data[os.write(self._master, data[:CHUNK]) :]
                except BlockingIOError:
                    continue
        return True

    def has_listener(self) -> bool:
        """True where a program has opened the far end; discards what it wrote."""
        while self.read(0.0):
            pass
        return self._is_open()

    def _wait(self, event: int, timeout_s: float) -> bool:
        """Sleeps while the far end is closed."""
        ready = self._poll(event, timeout_s)
        if ready & event:
            return True
        if ready & select.POLLHUP and timeout_s > 0.0:
            self.stop.wait(PAUSE_S)
        return False

    def _is_open(self) -> bool:
        return not self._poll(0, 0.0) & select.POLLHUP

    def _poll(self, event: int, timeout_s: float) -> int:
        poll = select.poll()
        poll.register(self._master, event)
        return sum(flags for _, flags in poll.poll(timeout_s * 1e3))


LISTEN_S = 0.05
"""Real seconds between two checks of the stop event; bytes are read at once."""
EPOCH_S = 1.0

Session = Callable[[PtyLine], None]


class PtyDevice:
    """A device behind a pty, in a thread of its own; `path` is what the service opens.

    The path can be closed and opened again. With `name`, a link to the pty, it can also be pulled
    out and plugged in again, which gives it another pty.
    """

    def __init__(self, session: Session, name: Path | None = None) -> None:
        self._session = session
        self._name = name
        self._open()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._close()

    def unplug(self) -> None:
        """Pull it out: whoever holds the port is hung up on."""
        self._close()
        if self._name is not None:
            self._name.unlink()

    def plug(self, name: Path | None = None) -> None:
        """Put it in again."""
        self._name = name or self._name
        self._open()
        self._thread.start()

    def _open(self) -> None:
        master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        os.close(slave)  # so that the master notices when the far end is closed
        if self._name is not None:
            self._name.symlink_to(self.path)
            self.path = str(self._name)
        self._stop = threading.Event()
        self._line = PtyLine(master, self._stop)
        self._thread = threading.Thread(target=self._run, name=f"sim {self.path}", daemon=True)

    def _close(self) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
            self._line.close()

    def _run(self) -> None:
        self._session(self._line)


def answering(device: SimulatedModem | Misbehaving) -> Session:
    """Session of a modem: reads bytes and writes answers."""

    def session(line: PtyLine) -> None:
        while not line.stop.is_set():
            data = line.read(LISTEN_S)
            line.write((device.feed(data) if data else b"") + device.unsolicited())

    return session


def talking(device: SimulatedReceiver, time: WalkTime) -> Session:
    """Session of a receiver: an epoch each second of the walk, listener or not."""

    def session(line: PtyLine) -> None:
        t_s = 0.0
        while not time.wait_until(line.stop, t_s):
            text = device.epoch(t_s)
            if line.has_listener():
                line.write(text)
            t_s += EPOCH_S

    return session
