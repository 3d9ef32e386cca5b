"""CSV: a walk in the columns that `postproc.interop.readers.walk_csv` reads, or a row a cell."""

from collections.abc import Sequence
from pathlib import Path

from logger.core.document import Table
from logger.core.schema import list_text
from logger.core.types import utc_text
from postproc.csv_table import escape, line
from postproc.interop.exporting import Answered, ExportWalk
from postproc.interop.readers.walk_csv import BROADCAST, CELL, LEVELS, PLACE, READINGS
from postproc.interop.sighting import Sighting

COLUMNS = (
    "t_s",
    "time_utc",
    "lat",
    "lon",
    "acc_m",
    *PLACE,
    "cell",
    "role",
    "rat",
    *LEVELS,
    *CELL,
    *BROADCAST,
)
_TEXTS = {"role", "rat", *(name for name in CELL if READINGS[name].dtype.startswith("S"))}


def write(walk: ExportWalk, target: Path) -> None:
    """Levels that `read` returns equal: seconds since the first, and UTC if known."""
    sightings, start_ns = walk.sightings, walk.start_ns
    used = [
        name
        for name in COLUMNS
        if name in {"rssi_dbm", "time_utc"} or any(_value(h, name, 0) for h in sightings)
    ]
    with target.open("w", newline="", encoding="utf-8") as file:
        file.write(line(used))
        file.writelines(line(_value(one, name, start_ns) for name in used) for one in sightings)


def write_answers(_: Sequence[Answered], table: Table, target: Path) -> None:
    """A line of names and one for each cell; what is not known is empty."""
    with target.open("w", newline="", encoding="utf-8") as file:
        file.write(line(column.title for column in table.columns))
        file.writelines(line(map(_cell, row)) for row in table.rows)


def _cell(value: object) -> str:
    return escape(value) if isinstance(value, str) else _text(value)


def _value(sighting: Sighting, name: str, start_ns: int) -> str:
    fix, reading = sighting.fix, sighting.reading
    match name:
        case "t_s":
            return _seconds(sighting.t_ns - start_ns)
        case "time_utc":
            return "" if fix.utc_ns is None else _utc(fix.utc_ns)
        case "lat" | "lon":
            return repr(getattr(fix, f"{name}_deg"))
        case "cell":
            return escape(reading.cell or "")
        case "acc_m" | "alt_m" | "speed_mps" | "course_deg":
            return _text(getattr(fix, name))
    value = _text(getattr(reading.broadcast if name in BROADCAST else reading, name, None))
    return escape(value) if name in _TEXTS else value


def _text(value: object) -> str:
    """A mark that is not set is as good as no value."""
    if isinstance(value, bool):
        return "1" if value else ""
    if isinstance(value, tuple):
        return list_text(value)
    return "" if value is None else str(value)


def _seconds(t_ns: int) -> str:
    sign, t_ns = "-" if t_ns < 0 else "", abs(t_ns)
    return f"{sign}{t_ns // 10**9}.{t_ns % 10**9:09d}"


def _utc(utc_ns: int) -> str:
    return f"{utc_text(utc_ns)[:-1]}.{utc_ns // 1000 % 10**6:06d}Z"
