"""The status of the recording, as a JSON file for other programs, and in a terminal."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

import msgspec

from logger.core.answer import NextWay
from logger.core.document import Column, Document, Table
from logger.core.errors import ConfigError
from logger.core.foreign import decode_json, read_regular
from logger.device.battery import Battery
from logger.device.clock import Clock
from logger.device.live_view import CellStatus, LiveView, PositionStatus, Whole

FOLDER = Path("/run/cellwalk")
"""RuntimeDirectory= of the service; systemd removes it with the service."""
_FILE = "status.json"
SILENT_S = 3.0
"""A recorder that has written no status for this long hangs or does not run."""

_MOST_BYTES = 1 << 22
"""A status has 100 kB at most."""

FIX_AGE_S = 5.0
"""The light shows `no fix` for an older position: a walker moves 7 m meanwhile."""

Sign = Literal["recording", "suspicious", "no fix", "error"]
_MOST_CELLS = 8
_CELL_COLUMNS = (
    Column("cell"),
    Column(""),  # * is the one that is followed, + serves the modem
    Column("level", ".0f", "dBm"),
    Column("trend", "+.0f", "dB"),
    Column("heard", ".0f", "s ago"),
    Column("word"),
)


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
    `recorded` names the latest requests of the page that are on the card. `is_over` once only the
    files of the run are made.
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
    is_over: bool = False

    @property
    def has_fix(self) -> bool:
        """Whether there are positions now."""
        return self.fix is not None and self.fix.valid and self.fix_age_s < FIX_AGE_S

    @property
    def fix_age_s(self) -> float:
        """How long ago the receiver spoke, 0 without one."""
        return 0.0 if self.fix is None else (self.now_ns - self.fix.t_ns) / 1e9

    @property
    def is_placed(self) -> bool:
        """Whether it is known where the walker is."""
        # a way from an old place leads astray
        if self.is_over:
            return False
        return self.has_fix if self.state == "error" else self.state != "no fix"


def status_folder(environ: Mapping[str, str] = os.environ) -> Path | None:
    """The folder that systemd made for the service (RuntimeDirectory=), or None."""
    folder = environ.get("RUNTIME_DIRECTORY")
    return Path(folder) if folder else None


def status_age_s(status: Status) -> float:
    """How long ago the recorder wrote a status."""
    return (Clock().now_ns() - status.now_ns) / 1e9


def silent_s(status: Status) -> float:
    """For how long the recorder has written no status; 0 while it works."""
    age = status_age_s(status)
    return age if age > SILENT_S else 0.0


def write_status(folder: Path, status: Status) -> None:
    """Replace status.json in one step: readers see the old file or the new one.

    Raises OSError.
    """
    part = folder / f"{_FILE}.part"
    part.write_bytes(msgspec.json.format(msgspec.json.encode(status), indent=1))
    part.replace(folder / _FILE)


def read_status(folder: Path) -> Status | None:
    """Read the status of a running service; None without one.

    Raises OSError without permission, and for a file that cannot be a status.
    """
    try:
        return decode_json(read_regular(folder / _FILE, _MOST_BYTES, follow_links=False), Status)
    except (FileNotFoundError, msgspec.DecodeError):
        return None


def report(folder: Path) -> tuple[Document, bool]:
    """The status of the service now, and whether the walk is being recorded.

    Raises `ConfigError` without permission.
    """
    try:
        status = running_status(folder)
    except PermissionError:
        raise ConfigError(f"{folder} belongs to the group cellwalk: use sudo") from None
    except OSError as error:
        raise ConfigError(f"{folder}: status.json: {error.strerror}") from None
    except ConfigError as error:
        fields = {"state": "error", "text": str(error)}
        return Document(fields, body=[f"error: {error}"]), False
    age_s = silent_s(status)
    content = msgspec.structs.asdict(status) | {"silent_s": round(age_s, 1)}
    document = Document(content, body=status_parts(status, age_s))
    return document, status.state != "error" and not age_s and not status.is_over


def running_status(folder: Path = FOLDER) -> Status:
    """The status of the service; raises `ConfigError` without one, OSError without permission."""
    status = read_status(folder)
    if status is not None:
        return status
    if any(folder.glob("status.json")):
        raise ConfigError("status.json is damaged: sudo systemctl restart fieldlogger")
    # one that waits for a charger has been started
    start = "sudo systemctl start fieldlogger; sudo fieldlogger doctor says why"
    by_hand = "one started by hand writes its status where RUNTIME_DIRECTORY says"
    raise ConfigError(f"no service is recording: {start} ({by_hand})")


def status_parts(status: Status, age_s: float = 0.0) -> Iterator[str | Table]:
    """What the page on the phone says; of a status that is `age_s` old where it is silent."""
    if status.is_over:  # it may be silent for some seconds, and then ends
        yield f"stopped: {'the run is closed' if age_s else status.text}"
    elif age_s:
        yield f"error: the recorder is silent for {age_s:.0f} s (journalctl -u fieldlogger)"
        yield f"before that {status.state}: {status.text}"
    else:
        yield f"{status.state}: {status.text}"
    if status.synced_ns is not None:
        durable_s = (status.now_ns - status.synced_ns) / 1e9 + age_s
        yield f"durable {durable_s:.1f} s ago in {status.run}"
    for reason in status.left_out:
        yield f"not used: {reason}"
    if status.fix is not None:
        yield _fix_line(status.fix, status.fix_age_s + age_s)
    if status.battery is not None:
        yield f"battery {status.battery}"
    # the walker has gone on since
    if status.next is not None and status.is_placed and not age_s:
        yield next_line(status.next)
    if status.position is not None:
        yield position_line(status.position)
    yield Table(_CELL_COLUMNS, [_cell(row, status, age_s) for row in status.cells[:_MOST_CELLS]])
    if status.unnoticed:
        yield status.unnoticed


def _fix_line(fix: FixStatus, age_s: float) -> str:
    used = "?" if fix.sats_used is None else fix.sats_used
    place = "no position"
    if fix.lat_deg is not None and fix.lon_deg is not None:
        place = f"{fix.lat_deg:.5f} {fix.lon_deg:.5f}"
    ago = f", {age_s:.0f} s ago" if age_s > FIX_AGE_S else ""
    return f"position: {place}, {used} satellites{ago}"


def next_line(way: NextWay) -> str:
    """Where to go."""
    return f"go: {way.azimuth_deg:.0f} deg, {way.text.removeprefix('go, ')}"


def position_line(position: PositionStatus) -> str:
    """Where the followed cell is."""
    return f"{position.cell}: {position.text or position.verdict}"


def _cell(row: CellStatus, status: Status, age_s: float) -> tuple[str | float | None, ...]:
    mark = "*" if row.cell == status.followed else "+" if row.is_serving else ""
    heard_s = (status.now_ns - row.heard_ns) / 1e9 + age_s
    words = ", ".join(text for text in (row.verdict, row.word) if text)
    trend_db = "" if row.trend_db is None else row.trend_db
    return row.cell, mark, row.level_dbm, trend_db, heard_s, words
