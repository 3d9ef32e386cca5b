"""Runs that the real service has recorded from a simulated modem."""

import threading
from dataclasses import dataclass
from pathlib import Path

from logger.config import parse_config
from logger.core.runfile import Run
from logger.device.beginning import begin_run
from logger.device.clock import Clock
from logger.device.service import Service


@dataclass
class Walked:
    """A recorded run and the times of its fault, in seconds of the run's clock."""

    run: Run
    start_s: float = 0.0
    end_s: float = 0.0

    def notes(self) -> list[str]:
        """Codes of the events of the modem."""
        return [row["code"].decode() for row in self.run.tables["notes"] if row["source"] == b"modem"]

    def texts(self) -> list[str]:
        return [row["text"].decode() for row in self.run.tables["notes"]]

    def scans(self) -> list[tuple[float, list]]:
        """Begin of each scan and its readings."""
        return [(r.value.t_start_ns / 1e9, list(r.value.readings)) for _, r in self.run.records("scans")]


def service(
    folder: Path, clock: Clock, port: str, full_scan_s: float, poll_s: float, gnss: str | None = None
) -> Service:
    text = (
        f'[run]\ndirectory = "{folder}"\n[modem]\nport = "{port}"\n'
        f"poll_interval_s = {poll_s}\nfull_scan_interval_s = {full_scan_s}\n"
        f'[gnss]\nport = "{gnss or folder / "none"}"\n'
    )
    config = parse_config(text, "site.toml")
    return Service(config, begin_run(config, text, clock), clock, threading.Event())
