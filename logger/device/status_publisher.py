"""Tells how the recording goes to everybody who wants to know: the light, `status.json` and
systemd.
"""

import logging
from pathlib import Path

from logger.device.leds import Lamp
from logger.device.notify import ServiceManager
from logger.device.status import Status, write_status

log = logging.getLogger(__name__)


class Teller:
    """`tell` each second; `folder` is that of `status.json`, None for none."""

    def __init__(self, manager: ServiceManager, lamp: Lamp, folder: Path | None) -> None:
        self._manager = manager
        self._lamp = lamp
        self._folder = folder
        self._told = ""
        self._heartbeat: int | None = None

    def tell(self, status: Status, heartbeat: int | None) -> None:
        """Tell a status; a `heartbeat` that grows is that of a recorder who waits for the card."""
        self._lamp.show(status.state)
        if self._heartbeat is not None and heartbeat is not None and heartbeat > self._heartbeat:
            # a restart would not mend the card, and lose what waits in memory
            self._manager.alive()
        self._heartbeat = heartbeat
        if status.text != self._told:
            self._told = status.text
            self._manager.status(status.text)
        if self._folder is not None:
            self._write(self._folder, status)

    def _write(self, folder: Path, status: Status) -> None:
        try:
            write_status(folder, status)
        except OSError as error:
            log.warning("no status.json any more: %s", error)
            self._folder = None
