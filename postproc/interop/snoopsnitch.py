"""SnoopSnitch: the app's database of transactions, cells and positions.

Sources: si.sql and local.sql of srlabs/snoopsnitch. Of a transaction (`session_info`) its cell and
the mean power of the messages received are read; its position is the nearest of `location_info`.
The serving and neighbouring cells that the app lists besides have no level and count as left out.
IMSI, IMEI, TMSI and telephone numbers, which transactions contain, are not read.
"""

import sqlite3
from bisect import bisect_left
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from logger.core.errors import RunFileError
from logger.core.types import Fix, Rat
from logger.sqlite_file import open_database
from postproc.interop.contents import Contents
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    Fields,
    cell_identity,
    fix_of,
    integer,
    maybe,
    number,
    plmn,
    reading_of,
    text,
    utc_ns_of,
)
from postproc.interop.sighting import BadRow, NoCell, Row, Sighting, parse_rows

_COLUMNS = ("id", "timestamp", "rat", "mcc", "mnc", "lac", "cid", "arfcn", "psc", "avg_power")
_RATS: tuple[Rat, ...] = ("GSM", "WCDMA", "LTE")
_NO_LEVEL = ("serving_cell_info", "neighboring_cell_info")
_MOST_APART_NS = 30 * 10**9
"""A walker is within 45 m of a position of this age."""

Places = list[tuple[int, Fix]]


def is_it(seen: Contents) -> bool:
    return seen.kind == "tables" and seen.has("session_info", "location_info")


def read(source: Path) -> Iterator[Row]:
    """Transactions with their level and position; raises `RunFileError` if damaged."""
    try:
        with open_database(source) as database:
            database.row_factory = sqlite3.Row
            places = sorted(_places(database), key=lambda place: place[0])
            query = f"SELECT {', '.join(_COLUMNS)} FROM session_info ORDER BY id"  # noqa: S608 (names of ours)
            rows = ((row["id"], dict(row)) for row in database.execute(query))
            yield from parse_rows(rows, partial(_sighting, places))
            yield from _without_level(database)
    except sqlite3.Error as error:
        raise RunFileError(f"{source} is no database of SnoopSnitch: {error}") from error


def _places(database: sqlite3.Connection) -> Iterator[tuple[int, Fix]]:
    query = "SELECT timestamp, latitude, longitude, altitude, accuracy FROM location_info"
    for row in map(dict, database.execute(query)):
        try:
            utc_ns = utc_ns_of(text(row, "timestamp"), "timestamp")
            known = {"alt_m": maybe(row, "altitude"), "acc_m": maybe(row, "accuracy") or None}
            yield utc_ns, fix_of(row, "latitude", "longitude", utc_ns, **known)
        except (ValueError, TypeError):
            continue


def _without_level(database: sqlite3.Connection) -> Iterator[NoCell]:
    tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
    for table in _NO_LEVEL:
        if table in tables:
            query = f"SELECT rowid FROM {table}"  # noqa: S608 (a name of ours)
            for (line,) in database.execute(query):
                yield NoCell(line, f"no level in {table}")


def _sighting(places: Places, line: int, fields: Fields) -> Row:
    if not text(fields, "avg_power"):
        return NoCell(line, "no level in session_info")
    number_of_rat = integer(fields, "rat")
    if number_of_rat is None or number_of_rat >= len(_RATS):
        return NoCell(line)
    rat = _RATS[number_of_rat]
    utc_ns = utc_ns_of(text(fields, "timestamp"), "timestamp")
    fix = _nearest(places, utc_ns)
    if fix is None:
        return BadRow(line, "no position within 30 s of it")
    mcc, mnc = plmn(fields)
    values: dict[str, Any] = {
        "mcc": mcc,
        "mnc": mnc,
        "cid": cell_identity(fields, "cid"),
        "arfcn": integer(fields, "arfcn"),
        "psc": integer(fields, "psc") if rat == "WCDMA" else None,
    }
    level_dbm = number(fields, "avg_power", (LEVEL_RANGE_DBM[0], -1.0))
    reading = reading_of(rat, "serving", level_dbm, integer(fields, "lac"), **values)
    return Sighting(line, utc_ns, fix, reading)


def _nearest(places: Places, utc_ns: int) -> Fix | None:
    after = bisect_left(places, utc_ns, key=lambda place: place[0])
    near = places[max(after - 1, 0) : after + 1]
    if not near:
        return None
    at_ns, fix = min(near, key=lambda place: abs(place[0] - utc_ns))
    return fix if abs(at_ns - utc_ns) <= _MOST_APART_NS else None
