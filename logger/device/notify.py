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


class ServiceManager:
    """The systemd that started the logger and watches it.

    `address` is a path, `@name` for an abstract socket, or empty without systemd.
    """

    def __init__(self, address: str) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._ready = False
        self._heartbeat: int | None = None
        self._text = ""

    @classmethod
    def of(cls, environ: Mapping[str, str] = os.environ) -> Self:
        """The one that the environment names."""
        return cls(environ.get("NOTIFY_SOCKET", ""))

    @property
    def is_present(self) -> bool:
        return bool(self._address)

    def alive(self) -> None:
        """Feed the watchdog; the first call also reports that the service has started."""
        self._send("WATCHDOG=1" if self._ready else "READY=1\nWATCHDOG=1")
        self._ready = True

    def heartbeat(self, count: int) -> None:
        """Feed the watchdog if `count` has grown: the recorder and the caller work."""
        if self._heartbeat is not None and count > self._heartbeat:
            self.alive()
        self._heartbeat = count

    def status(self, text: str) -> None:
        """Set the line that `systemctl status` shows, if it is another one."""
        if text != self._text:
            self._text = text
            self._send("STATUS=" + text.replace("\n", " "))

    def stopping(self) -> None:
        """Report that the service is ending, which stops the watchdog."""
        self._send("STOPPING=1")

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
