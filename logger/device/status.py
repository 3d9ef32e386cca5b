"""The status of the recording, as a JSON file for other programs and `fieldlogger doctor`."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import msgspec

from logger.core.foreign import decode_json, read_regular
from logger.device.battery import Battery
from logger.device.clock import SystemClock
from logger.device.live_view import LiveView, Whole

FOLDER = Path("/run/cellwalk")
"""RuntimeDirectory= of the service; systemd removes it with the service."""
_FILE = "status.json"
SILENT_S = 3.0
"""A recorder that has written no status for this long hangs or does not run."""

_MOST_BYTES = 1 << 22
"""A status has 100 kB at most."""

Sign = Literal["recording", "suspicious", "no fix", "error"]


class FixStatus(msgspec.Struct, frozen=True):
    """The latest epoch of the receiver.

    `t_ns` is time since boot; `quality` 6 is a position by dead reckoning.
    """

    t_ns: Whole
    valid: bool
    utc: str | None
    lat_deg: float | None
    lon_deg: float | None
    acc_m: float | None
    hdop: float | None
    sats_used: Whole | None
    quality: Whole | None = None
    speed_mps: float | None = None
    course_deg: float | None = None


class PortStatus(msgspec.Struct, frozen=True):
    """A port, whether it is open, its last event, and why it fails; empty if it does not."""

    url: str
    is_open: bool = False
    event: str = ""
    fault: str = ""


class Status(LiveView, frozen=True):
    """All of status.json: what is known of the walk, and how it is recorded.

    Times are nanoseconds since boot (CLOCK_BOOTTIME).

    `since_ns` is when the run began, `synced_ns` when the card last took all of it (None: not yet).
    `waiting` of the queue's `room` records have yet to be written.
    `followed` is the cell that the walker chose on the page, None for the program's choice.
    `recorded` names the latest requests of the page that are on the card.
    """

    state: Sign
    text: str
    run: str
    pid: Whole
    now_ns: Whole
    since_ns: Whole
    synced_ns: Whole | None
    fixes: Whole
    scans: Whole
    readings: Whole
    waiting: Whole
    room: Whole
    fix: FixStatus | None
    ports: dict[str, PortStatus]
    followed: str | None = None
    battery: Battery | None = None
    recorded: tuple[str, ...] = ()


def status_folder(environ: Mapping[str, str] = os.environ) -> Path | None:
    """The folder that systemd made for the service (RuntimeDirectory=), or None."""
    folder = environ.get("RUNTIME_DIRECTORY")
    return Path(folder) if folder else None


def age_s(status: Status) -> float:
    """How long ago the recorder wrote a status."""
    return (SystemClock().now_ns() - status.now_ns) / 1e9


def silent_s(status: Status) -> float:
    """For how long the recorder has written no status; 0 while it does so each second."""
    age = age_s(status)
    return age if age > SILENT_S else 0.0


def write_status(folder: Path, status: Status) -> None:
    """Replace status.json in one step: a reader sees the old file or the new one.

    Raises OSError.
    """
    part = folder / f"{_FILE}.part"
    part.write_bytes(msgspec.json.format(msgspec.json.encode(status), indent=1))
    part.replace(folder / _FILE)


def read_status(folder: Path) -> Status | None:
    """Read the status of a running service; None without one.

    Raises OSError without the permission, and for what is no file of a status's size.
    """
    try:
        return decode_json(read_regular(folder / _FILE, _MOST_BYTES, follow_links=False), Status)
    except (FileNotFoundError, msgspec.DecodeError):
        return None
