"""The near end of a pty, where a simulated device sits."""

import os
import select
import threading

CHUNK = 4096
PAUSE_S = 0.02


class PtyLine:
    """Reads and writes until `stop` is set; a closed far end is a normal state.

    What is written while the far end is open waits for the program that has opened it; one that
    flushes the port as it opens it, as pyserial does by itself, loses what came before, as it would
    lose it of a real device.
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

    def wait_for_listener(self) -> bool:
        """Wait until a program opens the far end; False when `stop` was set before."""
        while not self.stop.is_set():
            if self.has_listener():
                return True
            self.stop.wait(PAUSE_S)
        return False

    def _wait(self, event: int, timeout_s: float) -> bool:
        """True when ready for the event; sleeps while the far end is closed."""
        ready = self._poll(event, timeout_s)
        if ready & event:
            return True
        if ready & select.POLLHUP and timeout_s > 0.0:
            self.stop.wait(PAUSE_S)
        return False

    def _is_open(self) -> bool:
        return not self._poll(0, 0.0) & select.POLLHUP

    def _poll(self, event: int, timeout_s: float) -> int:
        """What the master is ready for."""
        poll = select.poll()
        poll.register(self._master, event)
        return sum(flags for _, flags in poll.poll(timeout_s * 1e3))
