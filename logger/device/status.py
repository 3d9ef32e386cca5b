"""The status of the recording, as a JSON file for other programs and `fieldlogger doctor`."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, TypedDict

import msgspec

from logger.core.answer import StrongestReading
from logger.core.ellipse import radii_text
from logger.core.foreign import decode_json, read_regular
from logger.core.guidance.next_way import NextWay
from logger.device.battery import Battery
from logger.device.clock import SystemClock

FOLDER = Path("/run/cellwalk")
"""RuntimeDirectory= of the service; systemd removes it with the service."""
_FILE = "status.json"
SILENT_S = 3.0
"""A recorder that has written no status for this long hangs or does not run."""

_MOST_BYTES = 1 << 22
"""A status has 100 kB at most."""

Whole = Annotated[int, msgspec.Meta(ge=-(1 << 63), le=(1 << 63) - 1)]
"""JSON has integers that no float and no column holds."""
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


class TargetStatus(msgspec.Struct, frozen=True):
    """The target and its best position so far, with the 95 % ellipse and its azimuth.

    `r50_m` and `r95_m` are the radii that hold half and 95 % of all probability; null where the
    position has less.

    `verdict` is "one close place", "one place", "several places" or "cannot tell": less
    than that of the desktop program, which uses the complete walk.
    """

    cell: str
    verdict: str
    n: Whole = 0
    probability: float | None = None
    lat_deg: float | None = None
    lon_deg: float | None = None
    semi_major_m: float | None = None
    semi_minor_m: float | None = None
    azimuth_deg: float | None = None
    r50_m: float | None = None
    r95_m: float | None = None

    def __str__(self) -> str:
        if self.lat_deg is None:
            return f"target {self.cell}: {self.verdict}"
        position = f"{self.lat_deg:.5f} {self.lon_deg:.5f}"
        radii = radii_text(self.r50_m, self.r95_m)
        parts = [f"target {self.cell}: {self.verdict} ({self.probability:.2f})", position, radii]
        return ", ".join(filter(None, parts))


class SuspicionStatus(msgspec.Struct, frozen=True):
    """A cell that is unusual or suspicious, with the reasons as sentences."""

    cell: str
    word: str
    score_nats: float
    reasons: tuple[str, ...]


class ModeStatus(msgspec.Struct, frozen=True):
    """One of the places that are possible, with its probability."""

    lat: float
    lon: float
    probability: float


class Region(TypedDict):
    """A MultiPolygon of GeoJSON."""

    type: str
    coordinates: list[list[list[tuple[float, float]]]]


class PositionStatus(msgspec.Struct, frozen=True):
    """The posterior of the cell that is followed.

    `verdict` is "located", "ambiguous" or "cannot tell"; `r50_m` and `r95_m` are the radii
    about `lat` and `lon` that hold 50 % and 95 %. `region` is the 95 % region as a GeoJSON
    MultiPolygon.
    """

    cell: str = ""
    verdict: str = "cannot tell"
    lat: float | None = None
    lon: float | None = None
    r95_m: float | None = None
    area_m2: float | None = None
    region: Region | None = None
    modes: tuple[ModeStatus, ...] = ()
    strongest: StrongestReading | None = None
    r50_m: float | None = None


class CellStatus(msgspec.Struct, frozen=True):
    """What was last heard of a cell.

    `average_dbm` is over the last 2 s before its latest reading, `trend_db` the change of the level
    in a few seconds: positive is "warmer". `heard_ns` is the time of the latest of `n` readings,
    `ta_m` its timing advance as a distance. `word` and `reasons` are those of its suspicion, and
    `verdict` that of its live estimate where there is one. Levels are those of one `modem`.
    """

    cell: str = ""
    rat: str | None = None
    channel: Whole | None = None
    is_serving: bool = False
    level_dbm: float | None = None
    average_dbm: float | None = None
    peak_dbm: float | None = None
    trend_db: float | None = None
    heard_ns: Whole = 0
    n: Whole = 0
    ta_m: float | None = None
    word: str | None = None
    reasons: tuple[str, ...] = ()
    verdict: str | None = None
    modem: str = ""


class PortStatus(msgspec.Struct, frozen=True):
    """A port, whether it is open, its last event, and why it fails; empty if it does not."""

    url: str
    is_open: bool = False
    event: str = ""
    fault: str = ""


class Status(msgspec.Struct, frozen=True):
    """All of status.json; times are nanoseconds since boot (CLOCK_BOOTTIME).

    `since_ns` is when the run began, `synced_ns` when the card last took all of it (None: not yet).
    `suspicions` has the most suspicious cell first; it never changes what is recorded.
    `waiting` of the queue's `room` records have yet to be written. `next` and `position` are of the
    cell that is followed; `cells` has the serving cell first, then the others by level.
    `followed` is the cell that the walker chose on the page, None for the program's choice.
    `recorded` names the latest requests of the page that are on the card.
    `no_estimate` is why there is no live estimate now, empty while it is made;
    `left_out` says which files it does not use, and why.
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
    target: TargetStatus | None
    ports: dict[str, PortStatus]
    suspicions: tuple[SuspicionStatus, ...] = ()
    next: NextWay | None = None
    position: PositionStatus | None = None
    cells: tuple[CellStatus, ...] = ()
    followed: str | None = None
    battery: Battery | None = None
    recorded: tuple[str, ...] = ()
    no_estimate: str = ""
    left_out: tuple[str, ...] = ()


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
