"""`fieldlogger status`: the status of the running service for a terminal."""

from collections.abc import Iterator
from pathlib import Path

import msgspec

from logger.core.document import Column, Document, Table
from logger.core.errors import ConfigError
from logger.core.guidance.next_way import NextWay
from logger.device.live_view import CellStatus, PositionStatus
from logger.device.status import FOLDER, Status, read_status, silent_s

_MOST_CELLS = 8
_CELL_COLUMNS = (
    Column("cell"),
    Column(""),  # * is the one that is followed, + serves the modem
    Column("level", ".0f", "dBm"),
    Column("trend", "+.0f", "dB"),
    Column("heard", ".0f", "s ago"),
    Column("word"),
)
_POINTS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


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
    return document, status.state != "error" and not age_s


def running_status(folder: Path = FOLDER) -> Status:
    """The status of the service; raises `ConfigError` without one, OSError without permission."""
    status = read_status(folder)
    if status is not None:
        return status
    if any(folder.glob("status.json")):
        raise ConfigError("status.json is damaged: sudo systemctl restart fieldlogger")
    raise ConfigError("no service is recording: sudo systemctl start fieldlogger")


def status_parts(status: Status, age_s: float = 0.0) -> Iterator[str | Table]:
    """What the page on the phone says; of a status that is `age_s` old where it is silent."""
    if age_s:
        yield f"error: the recorder is silent for {age_s:.0f} s (journalctl -u fieldlogger)"
        yield f"before that {status.state}: {status.text}"
    else:
        yield f"{status.state}: {status.text}"
    if status.synced_ns is not None:
        durable_s = (status.now_ns - status.synced_ns) / 1e9 + age_s
        yield f"durable {durable_s:.1f} s ago in {status.run}"
    for reason in status.left_out:
        yield f"not used: {reason}"
    if (fix := status.fix) is not None:
        used = "?" if fix.sats_used is None else fix.sats_used
        place = "no position"
        if fix.lat_deg is not None and fix.lon_deg is not None:
            place = f"{fix.lat_deg:.5f} {fix.lon_deg:.5f}"
        yield f"position: {place}, {used} satellites"
    if status.battery is not None:
        yield f"battery {status.battery}"
    if status.next is not None and not age_s:  # the walker has gone on since
        yield next_line(status.next)
    if status.position is not None:
        yield position_line(status.position)
    yield Table(_CELL_COLUMNS, [_cell(row, status, age_s) for row in status.cells[:_MOST_CELLS]])


def next_line(way: NextWay) -> str:
    """Where to go."""
    point = _POINTS[round(way.azimuth_deg / 45.0) % 8]
    return f"go: {point} ({way.azimuth_deg:.0f} deg), {way.distance_m:.0f} m: {way.text}"


def position_line(position: PositionStatus) -> str:
    """Where the followed cell is."""
    return f"{position.cell}: {position.text or position.verdict}"


def _cell(row: CellStatus, status: Status, age_s: float) -> tuple[str | float | None, ...]:
    """One cell: what it is, how loud, and what is odd about it."""
    mark = "*" if row.cell == status.followed else "+" if row.is_serving else ""
    heard_s = (status.now_ns - row.heard_ns) / 1e9 + age_s
    words = ", ".join(text for text in (row.verdict, row.word) if text)
    trend_db = "" if row.trend_db is None else row.trend_db
    return row.cell, mark, row.level_dbm, trend_db, heard_s, words
