"""The logger and who started it: notifications to systemd, and stop signals.

Notifications are datagrams to $NOTIFY_SOCKET (sd_notify(3)); without it there are none.
"""

import os
import signal
import socket
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Self

SEND_TIMEOUT_S = 1.0
"""Longest time that a busy systemd may delay the recorder."""
_STOP_US = 86_400_000_000
_START_US = 180_000_000
"""Of the watchdog at the start: imports from a cold card may take over 30 s."""


class ServiceManager:
    """The systemd that started the logger and watches it.

    `address` is a path, `@name` for an abstract socket, or empty without systemd; `watchdog_us` is
    that of the unit, 0 for none.
    """

    def __init__(self, address: str, watchdog_us: int = 0) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._watchdog_us = watchdog_us
        self._ready = self._steady = False
        self._heartbeat: int | None = None
        self._text = ""

    @classmethod
    def of(cls, environ: Mapping[str, str] = os.environ) -> Self:
        """The one that the environment names."""
        watchdog_us = environ.get("WATCHDOG_USEC", "")
        return cls(
            environ.get("NOTIFY_SOCKET", ""), int(watchdog_us) if watchdog_us.isdigit() else 0
        )

    @property
    def is_present(self) -> bool:
        return bool(self._address)

    def alive(self) -> None:
        """Feed the watchdog; the first call also reports that the service has started."""
        if not self._ready:
            self._ready = True
            self._send("READY=1")
            self._set_watchdog(_START_US)
        self._send("WATCHDOG=1")

    def heartbeat(self, count: int) -> None:
        """Feed the watchdog if `count` has grown: the recorder and the caller work."""
        if self._heartbeat is not None and count > self._heartbeat:
            self.alive()
            if not self._steady:
                self._steady = True
                self._set_watchdog(self._watchdog_us)
        self._heartbeat = count

    def status(self, text: str) -> None:
        """Set the line that `systemctl status` shows, if it is another one."""
        if text != self._text:
            self._text = text
            self._send("STATUS=" + text.replace("\n", " "))

    def stopping(self) -> None:
        """Report that the service is ending: TimeoutStopSec= limits it now."""
        self._send("STOPPING=1")
        # systemd 252 goes on watching, and would kill who makes the HDF5 file of a long run
        self._steady = True  # no heartbeat brings the unit's watchdog back
        self._set_watchdog(_STOP_US)

    def ask_time(self, seconds: float) -> None:
        # more than TimeoutStopSec= allows
        self._send(f"EXTEND_TIMEOUT_USEC={round(seconds * 1e6)}")

    def _set_watchdog(self, watchdog_us: int) -> None:
        if self._watchdog_us:
            self._send(f"WATCHDOG_USEC={watchdog_us}")

    def _send(self, assignments: str) -> None:
        if not self._address:
            return
        # a systemd that does not answer must not stop a recording
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as channel:
            channel.settimeout(SEND_TIMEOUT_S)
            channel.sendto(assignments.encode(errors="replace"), self._address)


@contextmanager
def stop_signals() -> Iterator[tuple[threading.Event, list[str]]]:
    """Turn SIGTERM and SIGINT into an event; ignore the terminal's end."""
    ended, received = threading.Event(), list[str]()

    def receive(number: int, _frame: FrameType | None) -> None:
        received.append(f"signal {signal.Signals(number).name}")
        ended.set()

    before = {number: signal.signal(number, receive) for number in (signal.SIGTERM, signal.SIGINT)}
    # a walker leaves the network of the ssh session that began the recording
    before[signal.SIGHUP] = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        yield ended, received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
