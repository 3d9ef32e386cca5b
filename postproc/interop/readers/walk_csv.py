"""A walk as CSV: one row for each level measured, with its position.

Columns: `t_s` (seconds) or `time_utc` (ISO 8601), `lat`, `lon` (WGS 84 degrees), `rssi_dbm`;
optional `cell` (a name; without it the identity, else a column such as `bssid` or `gateway`, else
"target"), `acc_m` (radius that holds 68 %), `rat`, and by their names in the run file whatever else
is known of the fix (`alt_m`, `speed_mps`, `course_deg`) or of the cell (`mcc`, `mnc`, `lac`, `cid`,
`rsrp_dbm`, ...), where `rssi_dbm` may be empty if another level is given. A row without a level is
a position alone. Other columns are passed over. An apostrophe before text that a spreadsheet would
take for a formula is dropped.
"""

from collections.abc import Iterator
from dataclasses import fields as fields_of
from dataclasses import replace
from pathlib import Path
from typing import Any

from logger.core.schema import TABLES
from logger.core.types import UNKNOWN_SIGNED, Broadcast, CellReading
from postproc import csv_table
from postproc.interop.contents import Contents, Format
from postproc.interop.sighting import (
    LEVEL_RANGE_DBM,
    POSITION_ALONE,
    RATS,
    Fields,
    Row,
    Sighting,
    Transmitters,
    broadcast_of,
    cell_identity,
    fix_of,
    integer,
    is_plmn,
    maybe,
    number,
    parse_rows,
    plmn,
    text,
    utc_ns_of,
    with_name,
    with_whole_codes,
)

_CELL_BYTES = 64
PLACE = ("alt_m", "speed_mps", "course_deg")
LEVELS = ("rssi_dbm", "rscp_dbm", "rsrp_dbm")
_ROLES = ("serving", "neighbour", "scan")
_CODES = frozenset({"arfcn", "bsic", "psc", "pci"})

READINGS = {column.name: column for column in TABLES["readings"]}
CELL = [
    f.name
    for f in fields_of(CellReading)
    if f.name not in {"role", "rat", "broadcast", "label", "more", *LEVELS}
]
BROADCAST = [f.name for f in fields_of(Broadcast)]


def read(source: Path) -> Iterator[Row]:
    """Rows in the file's order; raises `RunFileError` without the columns needed."""
    needed = ({"t_s", "time_utc"}, "lat", "lon", "rssi_dbm")
    rows = csv_table.rows(source, required=needed)
    transmitters: Transmitters | None = None

    def sighting(line: int, fields: Fields) -> Sighting:
        nonlocal transmitters
        if transmitters is None:
            others = [name for name in fields if name not in READINGS]
            transmitters = Transmitters(others, has_codes=not _CODES.isdisjoint(fields))
        return _sighting(line, fields, transmitters)

    yield from parse_rows(rows, sighting)
    if transmitters is not None:
        transmitters.check(source)


def _sighting(line: int, fields: Fields, transmitters: Transmitters) -> Sighting:
    utc_ns = (
        utc_ns_of(fields["time_utc"], "time_utc")
        if "t_s" not in fields or fields.get("time_utc")
        else None
    )
    t_ns = round(number(fields, "t_s") * 1e9) if "t_s" in fields or utc_ns is None else utc_ns
    if abs(t_ns) >= 2**62:
        raise ValueError("the time is out of range")
    known = {name: maybe(fields, name) for name in PLACE}
    fix = fix_of(fields, "lat", "lon", utc_ns, acc_m=maybe(fields, "acc_m", (0.0, 1e6)), **known)
    has_level = any(text(fields, name) for name in (*LEVELS, "rxlev_raw"))
    reading = _reading(fields, transmitters) if has_level else POSITION_ALONE
    return Sighting(line, t_ns, fix, reading)


def _reading(fields: Fields, transmitters: Transmitters) -> CellReading:
    role = next((role for role in _ROLES if role == text(fields, "role")), "scan")
    levels = {name: maybe(fields, name, LEVEL_RANGE_DBM) for name in LEVELS}
    named: dict[str, Any] = {name: _cell_value(fields, name) for name in CELL}
    if is_plmn(named["mcc"], named["mnc"]):
        named["mcc"], named["mnc"] = plmn({name: named[name] for name in ("mcc", "mnc")})
    named["broadcast"] = broadcast_of(fields)
    if all(levels[name] is None for name in LEVELS[1:]) and named["rxlev_raw"] is None:
        levels["rssi_dbm"] = number(fields, "rssi_dbm", LEVEL_RANGE_DBM)
    rat = RATS.get(text(fields, "rat").upper())
    reading = CellReading(role, rat, **levels, **named)  # type: ignore[arg-type]
    cell: str | None = with_whole_codes(csv_table.unescape(text(fields, "cell")))
    if not cell:
        reading = with_name(reading)
        cell = reading.cell or transmitters.name(fields, reading)
    if cell is None:
        return reading
    if len(cell.encode()) > _CELL_BYTES:
        raise ValueError(f"the cell's name is longer than {_CELL_BYTES} bytes")
    return reading if reading.cell == cell else replace(reading, label=cell)


def _cell_value(fields: Fields, name: str) -> float | int | str | None:
    column = READINGS[name]
    if name == "identity_unsure":
        return bool(integer(fields, name))
    if column.dtype.startswith("S"):
        string = csv_table.unescape(text(fields, name))
        if len(string.encode()) > int(column.dtype[1:]):
            raise ValueError(f"{name} is too long: {string[:40]!r}")
        return string or None
    if column.dtype == "<f8":
        return maybe(fields, name)
    if column.unknown == UNKNOWN_SIGNED:
        value = maybe(fields, name, (-1e9, 1e9))
        return None if value is None else round(value)
    return cell_identity(fields, name) if name == "cid" else integer(fields, name)


def _is_it(seen: Contents) -> bool:
    """One of our columns and another suffice: the reader names those that are missing."""
    ours = {"t_s", "time_utc", *LEVELS}
    n_ours = len(seen.names & ours)
    return seen.kind == "text" and n_ours > 0 and n_ours + len(seen.names & {"lat", "lon"}) >= 2


IMPORTS = (
    Format(
        "CSV", read, "t_s or time_utc", _is_it, has_scans=True, is_general=True, unrepeated=True
    ),
)
