"""`fieldlogger status`: the status of the running service for a terminal."""

from collections.abc import Iterator
from pathlib import Path

from logger.core.errors import ConfigError
from logger.core.guidance.next_way import NextWay
from logger.device.status import FOLDER, CellStatus, PositionStatus, Status, read_status

_MOST_CELLS = 8
_POINTS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


def running_status(folder: Path = FOLDER) -> Status:
    """The status of the service; raises `ConfigError` without one, OSError without permission."""
    status = read_status(folder)
    if status is None:
        raise ConfigError("no service is recording: sudo systemctl start fieldlogger")
    return status


def status_lines(status: Status) -> Iterator[str]:
    """What the page on the phone says, in lines of at most 100 characters."""
    yield f"{status.state}: {status.text}"
    if status.synced_ns is not None:
        yield f"durable {(status.now_ns - status.synced_ns) / 1e9:.1f} s ago in {status.run}"
    if (fix := status.fix) is not None:
        used = "?" if fix.sats_used is None else fix.sats_used
        place = f"{fix.lat_deg:.5f} {fix.lon_deg:.5f}" if fix.lat_deg is not None else "no position"
        yield f"position: {place}, {used} satellites"
    if status.battery is not None:
        yield f"battery {status.battery}"
    if status.next is not None:
        yield next_line(status.next)
    if status.position is not None:
        yield position_line(status.position)
    for row in status.cells[:_MOST_CELLS]:
        yield cell_line(row, status)


def next_line(way: NextWay) -> str:
    """Where to go."""
    point = _POINTS[round(way.azimuth_deg / 45.0) % 8]
    return f"go: {point} ({way.azimuth_deg:.0f} deg), {way.distance_m:.0f} m: {way.text}"


def position_line(position: PositionStatus) -> str:
    """Where the followed cell is."""
    if position.lat is None or position.lon is None or position.r95_m is None:
        return f"{position.cell}: {position.verdict}"
    place = f"{position.lat:.5f} {position.lon:.5f}, 95 % within {position.r95_m:.0f} m"
    return f"{position.cell}: {position.verdict}, {place}"


def cell_line(row: CellStatus, status: Status) -> str:
    """One cell: what it is, how loud, and what is odd about it."""
    mark = "*" if row.cell == status.followed else "+" if row.is_serving else " "
    trend = "" if row.trend_db is None else f" {row.trend_db:+.0f} dB"
    age_s = (status.now_ns - row.heard_ns) / 1e9
    words = ", ".join(text for text in (row.verdict, row.word) if text)
    level = "?" if row.level_dbm is None else f"{row.level_dbm:.0f}"
    return f"{mark} {row.cell:24} {level:>5} dBm{trend:8} {age_s:5.0f} s  {words}".rstrip()
