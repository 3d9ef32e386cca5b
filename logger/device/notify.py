"""Words to systemd, as datagrams to $NOTIFY_SOCKET (sd_notify(3)); without one nobody is told, and
nothing fails.
"""

import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import Self

TELL_S = 1.0
"""Longest that a busy systemd may hold the recorder up."""


class ServiceManager:
    """Whoever started the logger and watches it; `address` is a path, `@name` for an abstract one,
    or empty.
    """

    def __init__(self, address: str) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._ready = False

    @classmethod
    def of(cls, environ: Mapping[str, str] = os.environ) -> Self:
        """The one named in the environment."""
        return cls(environ.get("NOTIFY_SOCKET", ""))

    @property
    def listens(self) -> bool:
        return bool(self._address)

    def alive(self) -> None:
        """Feed the watchdog; the first time this also says that the service has started."""
        self._tell("WATCHDOG=1" if self._ready else "READY=1\nWATCHDOG=1")
        self._ready = True

    def status(self, text: str) -> None:
        """Set the line that `systemctl status` shows."""
        self._tell("STATUS=" + text.replace("\n", " "))

    def stopping(self) -> None:
        """Say that the service ends; the watchdog waits no longer."""
        self._tell("STOPPING=1")

    def _tell(self, assignments: str) -> None:
        if not self._address:
            return
        # a systemd that cannot be told must not stop a recording
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as channel:
            channel.settimeout(TELL_S)
            channel.sendto(assignments.encode(), self._address)
