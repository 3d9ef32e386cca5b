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

from logger.core.errors import RunFileError
from logger.core.types import Rat
from logger.sqlite_file import open_database
from postproc.interop.contents import Contents, Format
from postproc.interop.sighting import (
    LEVEL_RANGE_DBM,
    Columns,
    Fields,
    Moment,
    NoCell,
    Row,
    Sighting,
    integer,
    maybe,
    parse_rows,
)

TYPES = ("Cellular", "CellModem", "Cell")
_FIRST_REAL = 5
"""Version of the log from which positions are numbers and no longer 100 000ths in integers."""
_OF_LOG = ("ts_sec", "ts_usec", "lat", "lon", "alt", "speed", "heading", "json")
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
            columns = ", ".join(name for name in _OF_LOG if name in have)
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


def _sighting(line: int, row: Fields) -> Sighting | NoCell:
    try:
        fields = json.loads(row["json"])
    except (TypeError, ValueError, RecursionError):
        raise ValueError("json is damaged") from None
    if not isinstance(fields, dict):
        raise ValueError("json is no object")  # noqa: TRY004 (a bad row like any other)
    place = {name: (maybe(row, name) or 0.0) * row["scale"] for name in ("lat", "lon")}
    # the altitude is 0 where it is not known
    return _COLUMNS.sighting(line, {**fields, **row, **place, "alt": maybe(row, "alt") or None})


def _when(_: int, row: Fields) -> Moment:
    seconds = integer(row, "ts_sec", largest=2**33)
    if not seconds:
        raise ValueError("ts_sec is no time")
    return Moment(seconds * 10**9 + (integer(row, "ts_usec") or 0) * 1000, is_utc=True)


def _level_dbm(fields: Fields, rat: Rat | None) -> float:
    name = "rssi" if rat == "GSM" else "rsrp"
    # Kismet fills rsrp with 0 for a level that it does not have
    level_dbm = maybe(fields, name, LEVEL_RANGE_DBM)
    if not level_dbm:
        raise ValueError(f"{name} is empty")
    return level_dbm


_COLUMNS = Columns(
    when=_when,
    level_dbm=_level_dbm,
    role=lambda fields: "serving" if fields.get("is_serving") is True else "neighbour",
    alt_m=("alt",),
    area=("tac",),
    cid=("cell_id",),
    arfcn=("earfcn",),
    codes={"WCDMA": ("pci",), "LTE": ("pci",), "NR": ("pci",)},
    more=lambda fields, _: {
        "band": integer(fields, "band"),
        "rsrq_db": maybe(fields, "rsrq"),
        "sinr_db": maybe(fields, "sinr"),
    },
)


def _is_it(seen: Contents) -> bool:
    return seen.kind == "tables" and seen.has("kismet", "data")


IMPORTS = (Format("Kismet log", read, "ts_sec", _is_it),)
