"""Runs that the real service has recorded from a simulated modem."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from logger.config import parse_config
from logger.core.errors import RunFileError
from logger.core.runfile import Run, read_run
from logger.device.clock import Clock
from logger.device.service import Service
from logger.device.startup import begin_run
from tests.kit.service import LIMIT_S

LOOK_EVERY_S = 0.5


@dataclass
class RecordedRun:
    """A recorded run and the times of its fault, in seconds of the run's clock."""

    run: Run
    start_s: float = 0.0
    end_s: float = 0.0

    def notes(self) -> list[str]:
        """Codes of the events of the modem."""
        return [
            row["code"].decode() for row in self.run.tables["notes"] if row["source"] == b"modem"
        ]

    def texts(self) -> list[str]:
        return [row["text"].decode() for row in self.run.tables["notes"]]

    def scans(self) -> list[tuple[float, list]]:
        """Begin of each scan and its readings."""
        return [
            (r.value.t_start_ns / 1e9, list(r.value.readings)) for _, r in self.run.records("scans")
        ]


def make_service(
    folder: Path,
    clock: Clock,
    port: str,
    full_scan_s: float,
    poll_s: float,
    gnss: str | None = None,
) -> Service:
    text = (
        f'[run]\ndirectory = "{folder}"\n[modem]\nport = "{port}"\n'
        f"poll_interval_s = {poll_s}\nfull_scan_interval_s = {full_scan_s}\n"
        f'[gnss]\nport = "{gnss or folder / "none"}"\n'
    )
    config = parse_config(text, "site.toml")
    return Service(config, begin_run(config, text, clock), clock, threading.Event())


@contextmanager
def recording(under_way: Service) -> Iterator[Service]:
    """A service that is stopped whatever happens; its threads would keep the test from ending."""
    under_way.start()
    try:
        yield under_way
    finally:
        under_way.stop("end")


def record_until(
    under_way: Service, clock: Clock, done: Callable[[RecordedRun], bool], limit_s: float = LIMIT_S
) -> None:
    """Record until the run satisfies a condition, or for so many real seconds.

    The caller then asserts the condition, so a test takes as long as the machine needs.
    """
    end_s = time.monotonic() + limit_s
    while time.monotonic() < end_s:
        under_way.wait(LOOK_EVERY_S / clock.real_s(1.0))
        walked = _so_far(under_way.folder)
        if walked is not None and done(walked):
            return


def _so_far(folder: Path) -> RecordedRun | None:
    try:
        return next((RecordedRun(read_run(path)) for path in folder.glob("*.journal")), None)
    except RunFileError:  # made, and not yet written for the first time
        return None
