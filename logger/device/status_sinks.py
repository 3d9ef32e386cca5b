"""Outputs of the recording's status: the light, `status.json`, `systemctl status`, the feed.

A new output is a class with `publish` and `close`, one line in `status_sinks`, and its settings in
`StatusSettings`.
"""

import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from logger.config import StatusSettings
from logger.device.leds import StatusLight
from logger.device.notify import ServiceManager
from logger.device.status import Status, status_folder, write_status
from logger.device.status_feed import StatusFeed

log = logging.getLogger(__name__)


class StatusSink(Protocol):
    """An output of the status. Neither method raises: no output may stop a recording."""

    def publish(self, status: Status) -> None:
        """Show a status; called once a second."""

    def close(self) -> None:
        """Release what the output holds."""


class StatusFile:
    """`status.json` in a folder; a failure is logged once, and writing is tried again."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._fails = False

    def publish(self, status: Status) -> None:
        if self._folder is None:
            return
        try:
            write_status(self._folder, status)
        except OSError as error:
            if not self._fails:
                log.warning("status.json cannot be written: %s", error)
            self._fails = True
        else:
            self._fails = False

    def close(self) -> None:
        self._folder = None


class SystemdStatus:
    """The line that `systemctl status` shows."""

    def __init__(self, manager: ServiceManager) -> None:
        self._manager = manager
        self._text = ""

    def publish(self, status: Status) -> None:
        if status.text != self._text:
            self._text = status.text
            self._manager.status(status.text)

    def close(self) -> None:
        """Leave the last line, which systemd shows after the end."""


@contextmanager
def status_sinks(
    settings: StatusSettings, manager: ServiceManager, environ: Mapping[str, str] = os.environ
) -> Iterator[list[StatusSink]]:
    """Open every output that the configuration and the environment name; close them at the end."""
    sinks: list[StatusSink] = [
        StatusLight(settings.led),
        StatusFile(status_folder(environ)),
        SystemdStatus(manager),
        StatusFeed(settings.feed),
    ]
    try:
        yield sinks
    finally:
        for sink in sinks:
            sink.close()
