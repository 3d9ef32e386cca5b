"""The run file's tables as data: one table for each kind of record, one row for each of them.

Every row begins with `seq` (number of the record in the run, the order of everything), `t_ns` (time
since boot when the record was complete) and `source`. Integers that may be unknown have a mark in
`Column.unknown`; unknown floats are NaN, unknown texts empty. A row is packed, little-endian.

Nothing here needs numpy, for a quick start; `rows` has the tables as arrays.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from logger.core import document
from logger.core.types import (
    UNKNOWN_ID,
    UNKNOWN_TIME,
    Broadcast,
    CellReading,
    Column,
    Fix,
    LiveEstimate,
    Note,
    Record,
    Scan,
    Value,
)
from logger.core.types import columns_of as _stored

SCHEMA_VERSION = 5
OLDEST_DESCRIBED = 2
"""Oldest version whose rows are understood if a journal has lost its description."""

EMPTY_LIST = "none"
"""A list without an entry, to tell it from an unknown one, which is empty."""
MOST_NS = 2**62
"""Latest time, in ns since boot or since 1970: 146 years; sums of two still fit 64 bits."""

_STRUCT_CODES = {"<i8": "q", "<i4": "i", "|u1": "B", "<f8": "d"}

HEAD = (
    Column("seq", "<i8", "number of the record in the run"),
    Column("t_ns", "<i8", "ns since boot, when the record was complete"),
    Column("source", "S16", "port or part it came from"),
)
_START, *_SCAN_FIXES = _stored(Scan)
_CELL = Column("cell", "S64", "name of the cell: mcc-mnc-lac-cid, or as imported")

TABLES: Mapping[str, tuple[Column, ...]] = {
    "fixes": (*HEAD, *_stored(Fix)),
    "scans": (
        *HEAD,
        _START,
        *_SCAN_FIXES,
        Column("n_readings", "<i4", "cells in the reply", UNKNOWN_ID),
    ),
    "readings": (
        *HEAD,
        replace(_START, unknown=UNKNOWN_TIME),
        *_SCAN_FIXES,
        _CELL,
        *_stored(CellReading),
    ),
    "broadcasts": (
        *HEAD,
        Column("reading", "<i4", "position of the reading in its scan, from 0"),
        *_stored(Broadcast),
    ),
    "notes": (*HEAD, *_stored(Note)),
    "live": (*HEAD, *_stored(LiveEstimate)),
    "raw": (
        *HEAD,
        Column("sent", "|u1", "1 for bytes the logger wrote"),
        Column("offset", "<i8", "first byte in raw_bytes"),
        Column("length", "<i4", "bytes"),
    ),
}

_TABLE_OF = {Fix: "fixes", Note: "notes", LiveEstimate: "live"}


_ADDED_IN: Mapping[int, Mapping[str, frozenset[str]]] = {
    3: {"readings": frozenset({"identity_unsure"})},
    4: {"broadcasts": frozenset(column.name for column in TABLES["broadcasts"])},
    5: {"readings": frozenset({"ta_16ts", "level_sd_db", "n_levels"})},
}
"""Columns by the version that added them."""


def columns_of(version: int) -> dict[str, list[tuple[str, str]]]:
    """Name and type of each column by table, as a version from `OLDEST_DESCRIBED` on wrote them."""
    later = [tables for added_in, tables in _ADDED_IN.items() if added_in > version]

    def had(table: str, column: Column) -> bool:
        return not any(column.name in tables.get(table, ()) for tables in later)

    tables = {
        table: [(c.name, c.dtype) for c in columns if had(table, c)]
        for table, columns in TABLES.items()
    }
    return {table: columns for table, columns in tables.items() if columns}


def columns_text(table: str, names: Iterable[str]) -> str:
    """Names and units of a table's columns, an attribute of the HDF5 file."""
    units = {column.name: column.unit for column in TABLES[table]}
    return "\n".join(f"{name}: {units.get(name, '')}" for name in names)


def is_columns_text(table: str, names: Iterable[str], text: str) -> bool:
    """Whether some version of this program has written this text about these columns."""
    known = {f"{column.name}: {column.unit}" for column in TABLES[table]} | _EARLIER_WORDS
    lines = text.split("\n")
    return set(lines) <= known and {line.partition(":")[0] for line in lines} >= set(names)


_EARLIER_WORDS = frozenset(
    {
        "lac: location area code",
        "bsic: 8 NCC + BCC",
        "fix_seq: seq of the fix current at the scan",
        "t_start_ns: ns since boot, when the modem was asked",
        "fix_start_seq: seq of the fix current when the modem was asked",
        "probability: 1, of the place; below 1 there are others",
        "identity_unsure: 1 where a byte of the identity may be damaged",
        "reject_cause_type: 0: cause of 3GPP TS 24.008 or 24.301, 1: of the maker",
        "reject_cause: why the network refused to register the modem",
    }
)
"""Lines of runs of schema 1 to 4; a changed unit is added here, or old files look altered."""


def packing_of(version: int) -> dict[str, struct.Struct]:
    """How that version packed the rows of each table."""
    return {
        table: struct.Struct(
            "<" + "".join(_STRUCT_CODES.get(kind) or f"{kind[1:]}s" for _, kind in columns)
        )
        for table, columns in columns_of(version).items()
    }


_PACKING = packing_of(SCHEMA_VERSION)


def pack_rows(table: str, rows: Iterable[tuple[Any, ...]]) -> bytes:
    """Rows of a table, values in column order, as bytes.

    Raises OverflowError for a number that does not fit.
    """
    try:
        return b"".join(_PACKING[table].pack(*row) for row in rows)
    except struct.error as error:
        raise OverflowError(f"{table}: {error}") from error


def row_size(table: str) -> int:
    """Bytes of one packed row."""
    return _PACKING[table].size


def rows_of(seq: int, record: Record) -> list[tuple[str, tuple[Any, ...]]]:
    """Rows of a record as (table, values in column order); raw bytes are left to the writer."""
    head = {"seq": seq, "t_ns": record.t_ns, "source": record.source}
    value = record.value
    match value:
        case Scan():
            scan = {column.name: getattr(value, column.name) for column in (_START, *_SCAN_FIXES)}
            readings = [
                ("readings", _row("readings", {**head, **scan, "cell": reading.cell}, reading))
                for reading in value.readings
            ]
            broadcasts = [
                ("broadcasts", _row("broadcasts", {**head, "reading": i}, reading.broadcast))
                for i, reading in enumerate(value.readings)
                if reading.broadcast is not None
            ]
            head["n_readings"] = len(value.readings)
            return [("scans", _row("scans", head, value)), *readings, *broadcasts]
        case Fix() | Note() | LiveEstimate():
            table = _TABLE_OF[type(value)]
            return [(table, _row(table, head, value))]
    raise TypeError(f"no table for {type(value).__name__}")


def _row(
    table: str, known: Mapping[str, Any], value: Value | CellReading | Broadcast
) -> tuple[Any, ...]:
    return tuple(
        encode(column, known[column.name] if column.name in known else getattr(value, column.name))
        for column in TABLES[table]
    )


def encode(column: Column, value: Any) -> Any:
    """A value as it stands in a row: unknown texts are empty, other unknowns marked."""
    if isinstance(value, tuple):
        value = list_text(value)
    if column.dtype.startswith("S"):
        return _fit("" if value is None else str(value), int(column.dtype[1:]))
    if value is None:
        return math.nan if column.unknown is None else column.unknown
    return value


def list_text(numbers: Iterable[int]) -> str:
    """Numbers as a text column has them; `rows.channels_of` reads it."""
    return " ".join(map(str, numbers)) or EMPTY_LIST


def _fit(text: str, size: int) -> bytes:
    """Cut between characters of UTF-8.

    A NUL at the end would be lost by numpy and is dropped.
    """
    encoded = text.encode("utf-8", "replace")
    if len(encoded) > size:
        encoded = encoded[: size - 3].decode("utf-8", "ignore").encode() + "…".encode()
    return encoded.rstrip(b"\0")


def tables_text() -> str:
    """All tables in Markdown."""
    headings = [document.Column(title) for title in ("column", "type", "unit", "unknown")]
    parts = [f"Schema {SCHEMA_VERSION}."]
    for name, columns in TABLES.items():
        rows = [(one.name, str(one.dtype), one.unit, _unknown_text(one)) for one in columns]
        parts += [f"## {name}", document.markdown_table(document.Table(headings, rows))]
    return "\n\n".join(parts)


def _unknown_text(column: Column) -> str:
    return "" if column.unknown is None else str(column.unknown)


if __name__ == "__main__":
    print(tables_text())  # noqa: T201 (what docs/runfile.md refers to)
