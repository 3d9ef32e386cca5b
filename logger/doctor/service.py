"""Tests of the service: whether systemd runs it, and what its status.json reports."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

from logger.core.runfile.journal import is_recording
from logger.core.runfile.run_names import JOURNAL, first_part
from logger.device.check_line import Line, State
from logger.device.status import Status, age_s

MAX_AGE_S = 5.0
"""A working service writes its status, and its records to the card, every second."""


def unit() -> Line:
    """Whether systemd runs the logger and starts it at the next boot."""
    if not Path("/run/systemd/system").is_dir():
        return Line("ok", "service", "no systemd here: start `fieldlogger run` yourself")
    active, enabled = _systemctl("is-active"), _systemctl("is-enabled")
    if (active, enabled) == ("active", "enabled"):
        return Line("ok", "service", "fieldlogger.service is active, and enabled for the next boot")
    text = f"fieldlogger.service is {active} and {enabled}: systemctl enable --now fieldlogger"
    return Line("warn", "service", text)


def _systemctl(verb: str) -> str:
    done = subprocess.run(  # noqa: S603
        ["systemctl", verb, "fieldlogger.service"],  # noqa: S607
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout.strip() or "unknown"


def open_journal(folder: Path) -> Path | None:
    """The journal in a folder that a logger is writing, None without one."""
    journals = (first_part(path) for path in folder.glob(f"*{JOURNAL}*") if is_recording(path))
    return next(journals, None)


def status_lines(status: Status) -> Iterator[Line]:
    """What the status of a running service means."""
    age = age_s(status)
    if age > MAX_AGE_S:
        text = f"the service has not reported for {age:.0f} s: systemctl restart fieldlogger"
        yield Line("fail", "status", text)
        return
    states: dict[str, State] = {"error": "fail", "no fix": "warn"}
    yield Line(states.get(status.state, "ok"), "status", f"{status.state}: {status.text}")
    if status.no_estimate:
        yield Line("warn", "estimate", f"{status.no_estimate}; the recording goes on")
    for reason in status.left_out:
        yield Line("warn", "estimate", reason)
    synced_ns = status.since_ns if status.synced_ns is None else status.synced_ns
    unsynced_s = (status.now_ns - synced_ns) / 1e9
    yield Line(
        "fail" if unsynced_s > MAX_AGE_S else "ok",
        "card",
        f"all records up to {unsynced_s:.1f} s ago are on the card",
    )
    yield Line(
        "warn" if status.waiting > status.room / 2 else "ok",
        "queue",
        f"{status.waiting} of {status.room} records wait for the card",
    )
    for name, port in status.ports.items():
        if not port.is_open:
            yield Line("fail", name, port.event or f"{port.url} is not open")
