"""The near end of a pty, where a simulated device sits."""

import fcntl
import os
import select
import struct
import termios
import threading
import time

CHUNK = 4096
SETTLE_S = 2.0
"""Real seconds after which a program that has opened the port and flushed nothing is taken to read."""
PAUSE_S = 0.02


class PtyLine:
    """Reads and writes until `stop` is set; nobody at the far end is a normal state.

    A program that opens a port usually flushes it, so what is written between the two is lost. Packet mode
    (ioctl_tty(2), TIOCPKT) tells of the flush; from then on the line is heard.
    """

    def __init__(self, master: int, stop: threading.Event) -> None:
        self.stop = stop
        self._master = master
        self._flushed = False
        self._opened_s: float | None = None  # real time
        fcntl.ioctl(master, termios.TIOCPKT, struct.pack("i", 1))
        os.set_blocking(master, False)

    def close(self) -> None:
        os.close(self._master)

    def read(self, timeout_s: float) -> bytes:
        """Bytes that came; empty after the real seconds, and where nobody holds the far end."""
        if not self._wait(select.POLLIN, timeout_s):
            return b""
        try:
            packet = os.read(self._master, CHUNK)
        except OSError:  # EIO: closed meanwhile
            return b""
        if packet[0] & termios.TIOCPKT_FLUSHREAD:
            self._flushed = True
        return packet[1:]

    def write(self, data: bytes) -> bool:
        """Write all, as slowly as it is read; False when the far end was closed or `stop` was set before."""
        while data:
            if self.stop.is_set() or not self._is_open():
                return False
            if self._wait(select.POLLOUT, PAUSE_S):
                try:
                    data = data[os.write(self._master, data[:CHUNK]) :]
                except BlockingIOError:
                    continue
        return True

    def is_heard(self) -> bool:
        """True where a program has opened the far end and is done with preparing it; discards what it wrote."""
        while self.read(0.0):
            pass
        if not self._is_open() or self._opened_s is None:
            return False
        return self._flushed or time.monotonic() - self._opened_s > SETTLE_S

    def wait_heard(self) -> bool:
        """Wait until somebody listens; False when `stop` was set before."""
        while not self.stop.is_set():
            if self.is_heard():
                return True
            self.stop.wait(PAUSE_S)
        return False

    def _wait(self, event: int, timeout_s: float) -> bool:
        """True when ready for the event; without a far end it sleeps instead, since a hang-up is always ready."""
        ready = self._poll(event, timeout_s)
        if ready & event:
            return True
        if ready & select.POLLHUP and timeout_s > 0.0:
            self.stop.wait(PAUSE_S)
        return False

    def _is_open(self) -> bool:
        return not self._poll(0, 0.0) & select.POLLHUP

    def _poll(self, event: int, timeout_s: float) -> int:
        """What the master is ready for; notes when the far end is opened and closed."""
        poll = select.poll()
        poll.register(self._master, event)
        ready = sum(flags for _, flags in poll.poll(timeout_s * 1e3))
        if ready & select.POLLHUP:
            self._flushed = False
            self._opened_s = None
        elif self._opened_s is None:
            self._opened_s = time.monotonic()
        return ready
