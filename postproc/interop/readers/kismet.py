"""Kismet's log: cells that its modem sources write into the table `data`.

Those sources are cellat and celldiag, from October 2026 on.

Sources: kismetwireless.net/docs/dev/kismetdb and /docs/readme/kismetdb/kismetdb_cell, phy_cell.cc
and the README of capture_cell_at of kismetwireless/kismet. Accepted observations have the type
Cellular, those without a complete identity CellModem, early ones Cell. Raw exchanges and session
records, which hold the modem's IMEI, are not read.
"""

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from logger.core.errors import RunFileError
from logger.core.types import Role
from logger.sqlite_file import open_database
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    RATS,
    Fields,
    cell_identity,
    fix_of,
    integer,
    maybe,
    plmn,
    reading_of,
    text,
)
from postproc.interop.sighting import Row, Sighting, parse_rows

TYPES = ("Cellular", "CellModem", "Cell")
_FIRST_REAL = 5
"""Version of the log from which positions are numbers and no longer 100 000ths in integers."""
_COLUMNS = ("ts_sec", "ts_usec", "lat", "lon", "alt", "speed", "heading", "json")
_LAST = ("ts_sec", "ts_usec", "lat", "lon", "json")


def read(source: Path) -> Iterator[Row]:
    """Cell observations in the order of the log; raises `RunFileError` without a single one."""
    try:
        with open_database(source) as database:
            database.row_factory = sqlite3.Row
            scale = 1.0 if _version(database) >= _FIRST_REAL else 1e-5
            have = {row["name"] for row in database.execute("PRAGMA table_info(data)")}
            if missing := [name for name in (*_LAST, "type") if name not in have]:
                raise RunFileError(f"{source}: the table data has no column {', '.join(missing)}")
            columns = ", ".join(name for name in _COLUMNS if name in have)
            query = f"SELECT rowid, {columns} FROM data WHERE type IN (?, ?, ?) ORDER BY rowid"  # noqa: S608 (names of ours)
            rows = parse_rows(
                (
                    (row["rowid"], dict(row) | {"scale": scale})
                    for row in database.execute(query, TYPES)
                ),
                _sighting,
            )
            first = next(rows, None)
            if first is None:
                raise RunFileError(
                    f"{source} is a Kismet log without a cell: no row of data has the type "
                    f"{', '.join(TYPES)}, which "
                    "Kismet's sources cellat and celldiag write"
                )
            yield first
            yield from rows
    except sqlite3.Error as error:
        raise RunFileError(f"{source} is a damaged SQLite file: {error}") from error


def _version(database: sqlite3.Connection) -> int:
    row = database.execute("SELECT db_version FROM KISMET").fetchone()
    return int(row[0]) if row and str(row[0]).isdecimal() else _FIRST_REAL


def _sighting(line: int, row: Fields) -> Sighting | None:
    try:
        fields = json.loads(row["json"])
    except (TypeError, ValueError, RecursionError):
        raise ValueError("json is damaged") from None
    if not isinstance(fields, dict):
        raise ValueError("json is no object")  # noqa: TRY004 (a bad row like any other)
    rat = RATS.get(text(fields, "rat").upper())
    if rat is None:
        return None
    seconds = integer(row, "ts_sec", largest=2**33)
    if not seconds:
        raise ValueError("ts_sec is no time")
    utc_ns = seconds * 10**9 + (integer(row, "ts_usec") or 0) * 1000
    position: dict[str, Any] = {
        name: (maybe(row, name) or 0.0) * row["scale"] for name in ("lat", "lon")
    }
    known = {"alt_m": maybe(row, "alt") or None, "course_deg": None, "speed_mps": None}
    fix = fix_of(position, "lat", "lon", utc_ns, **known)
    rsrp_dbm, rssi_dbm = (maybe(fields, name, LEVEL_RANGE_DBM) for name in ("rsrp", "rssi"))
    # Kismet fills rsrp with 0 for a level that it does not have
    level_dbm = (rssi_dbm if rat == "GSM" else rsrp_dbm) or None
    if level_dbm is None:
        raise ValueError(f"{'rssi' if rat == 'GSM' else 'rsrp'} is empty")
    mcc, mnc = plmn(fields)
    values: dict[str, Any] = {
        "mcc": mcc,
        "mnc": mnc,
        "cid": cell_identity(fields, "cell_id"),
        "arfcn": integer(fields, "earfcn"),
        "band": integer(fields, "band"),
        "rsrq_db": maybe(fields, "rsrq"),
        "sinr_db": maybe(fields, "sinr"),
        "psc" if rat == "WCDMA" else "pci": integer(fields, "pci") if rat != "GSM" else None,
    }
    role: Role = "serving" if fields.get("is_serving") is True else "neighbour"
    return Sighting(
        line, utc_ns, fix, reading_of(rat, role, level_dbm, integer(fields, "tac"), **values)
    )
