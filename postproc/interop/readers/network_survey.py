"""Surveys of the Android app Network Survey: CSV per technology, a GeoPackage, or its messages.

Sources: GsmCsvLogger.java (CSV version 0.3.0) and LteCsvLogger.java (0.4.0) and their like,
CellularSurveyRecordLogger.java, and the constants classes of
christianrowlands/android-network-survey; messaging.networksurvey.app for the messages, which the
app publishes by MQTT, here one a line; OGC 12-128r18 2.1.3 for the geometry. The device's serial
number, which all contain, is not read.
"""

import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from logger.core.errors import RunFileError
from logger.core.types import Rat
from logger.sqlite_file import open_database
from postproc import csv_table
from postproc.interop import json_lines
from postproc.interop.contents import Contents, Format, of_json
from postproc.interop.sighting import (
    CODES,
    LEVEL_RANGE_DBM,
    Columns,
    Fields,
    Moment,
    NoCell,
    Row,
    Sighting,
    by_flag,
    integer,
    maybe,
    parse_rows,
    text,
    utc_ns_of,
)

TABLES: dict[str, Rat] = {
    "GSM_MESSAGE": "GSM",
    "UMTS_MESSAGE": "WCDMA",
    "LTE_MESSAGE": "LTE",
    "NR_MESSAGE": "NR",
}
_CHANNELS: dict[str, Rat] = {"arfcn": "GSM", "uarfcn": "WCDMA", "earfcn": "LTE", "narfcn": "NR"}
"""The column that names the technology of a CSV file."""
_RENAMED = {
    "cellid": "cid",
    "dlearfcn": "earfcn",
    "nrarfcn": "narfcn",
    "physcellid": "pci",
    "time": "devicetime",
    "locationaccuracy": "accuracy",
}
"""Columns of the GeoPackage, in lower case without blanks and underscores, and what the CSV calls
them.
"""
_MESSAGES: dict[str, Rat] = {
    "GsmRecord": "GSM",
    "UmtsRecord": "WCDMA",
    "LteRecord": "LTE",
    "NrRecord": "NR",
}
_OLDEST_MS = 30_000
"""Age of a position (`locationAge`) at which a walker may be two houses away."""
_ENVELOPE_BYTES = (0, 32, 48, 48, 64)
_WKB_POINTS = (1, 1001, 2001, 3001)


def read_csv(source: Path) -> Iterator[Row]:
    """Records of a CSV file; raises `RunFileError` without the columns needed."""
    yield from parse_rows(
        csv_table.rows(source, required=({*_CHANNELS}, "devicetime", "latitude", "longitude")),
        _of_csv,
    )


def read_geopackage(source: Path) -> Iterator[Row]:
    """Records of all tables, row by row; raises `RunFileError` for a damaged file."""
    try:
        with open_database(source) as database:
            database.row_factory = sqlite3.Row
            database.text_factory = lambda data: data.decode("utf-8", "replace")
            present = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
            for table in (table for table in TABLES if table in present):
                rows = enumerate(database.execute(f'SELECT * FROM "{table}"'), 1)  # noqa: S608 (a name of ours)
                yield from parse_rows(
                    ((line, _fields(row, TABLES[table])) for line, row in rows), _of_table
                )
    except sqlite3.Error as error:
        raise RunFileError(f"{source} is a damaged SQLite file: {error}") from error


def read_messages(source: Path) -> Iterator[Row]:
    """Records among the messages of a file, one JSON object a line."""
    yield from json_lines.parse_objects(source, _of_message)


def _of_message(line: int, message: Fields) -> Sighting | NoCell | None:
    rat, data = _MESSAGES.get(text(message, "messageType")), message.get("data")
    if rat is None or not isinstance(data, dict):
        return None
    return _of_record(line, {name.lower(): value for name, value in data.items()}, rat)


def _fields(row: sqlite3.Row, rat: Rat) -> dict[str, Any]:
    plain = {name.lower().replace(" ", "").replace("_", ""): row[name] for name in row.keys()}  # noqa: SIM118 (rows are no dicts)
    return {_RENAMED.get(name, name): value for name, value in plain.items()} | {"rat": rat}


def _of_csv(line: int, fields: Fields) -> Sighting | NoCell:
    rat = next(rat for channel, rat in _CHANNELS.items() if channel in fields)
    return _of_record(line, fields, rat)


def _of_record(line: int, fields: Fields, rat: Rat) -> Sighting | NoCell:
    utc_ns = utc_ns_of(text(fields, "devicetime"), "deviceTime")
    return _COLUMNS.sighting(line, {**fields, "rat": rat, "utc_ns": utc_ns})


def _of_table(line: int, fields: Fields) -> Sighting | NoCell:
    utc_ms = integer(fields, "devicetime", largest=2**43)
    if utc_ms is None:
        raise ValueError("Time is empty")
    position = _point(fields.get("geom")) if fields.get("geom") is not None else {}
    return _COLUMNS.sighting(line, {**fields, **position, "utc_ns": utc_ms * 10**6})


def _point(geometry: object) -> dict[str, float]:
    """Position in a GeoPackage geometry: a header with an optional envelope, then a WKB point."""
    if not isinstance(geometry, bytes) or geometry[:2] != b"GP" or len(geometry) < 8:
        raise ValueError("geom is no GeoPackage geometry")
    try:
        body = geometry[8 + _ENVELOPE_BYTES[geometry[3] >> 1 & 7] :]
        order = "<" if body[0] else ">"
        kind, lon_deg, lat_deg = struct.unpack_from(f"{order}Idd", body, 1)
    except (IndexError, struct.error):
        raise ValueError("geom is cut short") from None
    if kind not in _WKB_POINTS:
        raise ValueError("geom is no point")
    altitude = (
        struct.unpack_from(f"{order}d", body, 21)[0]
        if kind in {1001, 3001} and len(body) >= 29
        else None
    )
    return {"latitude": lat_deg, "longitude": lon_deg} | (
        {} if not altitude else {"altitude": altitude}
    )


def _when(_: int, fields: Fields) -> Moment:
    age_ms = integer(fields, "locationage")
    if age_ms is not None and age_ms > _OLDEST_MS:
        raise ValueError(f"the position is {age_ms / 1000:.0f} s older than the reading")
    return Moment(fields["utc_ns"], is_utc=True)


def _level_dbm(fields: Fields, rat: Rat | None) -> float | None:
    level = {"GSM": "signalstrength", "WCDMA": "rscp", "NR": "ssrsrp"}.get(rat or "", "rsrp")
    level_dbm = maybe(fields, level, LEVEL_RANGE_DBM)
    has_rssi = rat == "WCDMA" and maybe(fields, "signalstrength", LEVEL_RANGE_DBM) is not None
    if level_dbm is None and not has_rssi:
        raise ValueError(f"{level} is empty")
    return level_dbm


def _more(fields: Fields, rat: Rat | None) -> dict[str, float | None]:
    values = {
        "ecio_db": maybe(fields, "ecno"),
        "rsrq_db": maybe(fields, "ssrsrq" if rat == "NR" else "rsrq"),
        "sinr_db": maybe(fields, "sssinr" if rat == "NR" else "snr"),
    }
    if rat != "GSM":
        values["rssi_dbm"] = maybe(fields, "signalstrength", LEVEL_RANGE_DBM)
    return values


_COLUMNS = Columns(
    place=("latitude", "longitude"),
    when=_when,
    level_dbm=_level_dbm,
    role=by_flag("servingcell", means="serving", otherwise="neighbour"),
    alt_m=("altitude",),
    acc_m=("accuracy",),
    speed_mps=("speed",),
    area=("lac", "tac"),
    cid=("ci", "cid", "eci", "nci"),
    arfcn=tuple(_CHANNELS),
    codes={rat: (code,) for rat, code in CODES.items()},
    ta={"GSM": ("ta",)},
    more=_more,
)


def _is_geopackage(seen: Contents) -> bool:
    return seen.kind == "tables" and bool(seen.names & {name.lower() for name in TABLES})


def _is_csv(seen: Contents) -> bool:
    return seen.kind == "text" and seen.has("devicetime", "latitude", "longitude")


IMPORTS = (
    Format("Network Survey CSV", read_csv, "deviceTime", _is_csv),
    Format("Network Survey GeoPackage", read_geopackage, "Time", _is_geopackage),
    Format(
        "Network Survey messages, JSON", read_messages, "deviceTime", of_json("messagetype", "data")
    ),
)
