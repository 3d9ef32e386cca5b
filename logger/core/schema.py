"""The run file's tables as data: one table for each kind of record, one row for each record (or
reading).

Every row begins with `seq` (number of the record in the run, the order of everything), `t_ns` (time
since boot when the record was complete) and `source`. Integers that may be unknown carry their mark
in `Column.unknown`; unknown floats are NaN, unknown texts empty. A row is packed, little-endian.

Nothing here needs numpy, so that a run can begin before numpy has been imported; `rows` has the
tables as arrays.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from logger.core.types import CellReading, Fix, LiveEstimate, Note, Record, Scan, Value

SCHEMA_VERSION = 3
OLDEST_DESCRIBED = 2
"""Oldest version whose rows are understood where a journal has lost its description."""

UNKNOWN_ID = -1
"""Mark of an unknown integer that cannot be negative."""
UNKNOWN_TIME = -(2**63)
UNKNOWN_SIGNED = -(2**31)

MOST_NS = 2**62
"""No time is later, in nanoseconds since boot or since 1970: a century, and sums of two still fit
into 64 bits.
"""

_STRUCT_CODES = {"<i8": "q", "<i4": "i", "|u1": "B", "<f8": "d"}


@dataclass(frozen=True, slots=True)
class Column:
    """One column: numpy dtype, unit or meaning, and the mark of an unknown integer."""

    name: str
    dtype: str
    unit: str
    unknown: int | None = None


def _float(name: str, unit: str) -> Column:
    return Column(name, "<f8", unit)


def _count(name: str, unit: str, dtype: str = "<i4") -> Column:
    return Column(name, dtype, unit, UNKNOWN_ID)


def _text(name: str, size: int, unit: str) -> Column:
    return Column(name, f"S{size}", unit)


HEAD = (
    Column("seq", "<i8", "number of the record in the run"),
    Column("t_ns", "<i8", "ns since boot, when the record was complete"),
    _text("source", 16, "port or part it came from"),
)

TABLES: Mapping[str, tuple[Column, ...]] = {
    "fixes": (
        *HEAD,
        Column("valid", "|u1", "1 when the receiver had a position"),
        Column("utc_ns", "<i8", "ns since 1970 UTC, by GPS", UNKNOWN_TIME),
        _float("lat_deg", "deg north, WGS 84"),
        _float("lon_deg", "deg east, WGS 84"),
        _float("alt_m", "m above sea level"),
        _float("acc_m", "m, radius that holds 68 % of the positions"),
        _float("hdop", "1"),
        _count("sats_used", "satellites"),
        _count("quality", "NMEA 0183 GGA quality"),
        _float("speed_mps", "m/s"),
        _float("course_deg", "deg clockwise from true north"),
    ),
    "scans": (
        *HEAD,
        Column("t_start_ns", "<i8", "ns since boot, when the modem was asked"),
        Column(
            "fix_start_seq", "<i8", "seq of the fix current when the modem was asked", UNKNOWN_ID
        ),
        Column("fix_seq", "<i8", "seq of the fix current at the end of the scan", UNKNOWN_ID),
        _count("n_readings", "cells in the reply"),
    ),
    "readings": (
        *HEAD,
        Column("t_start_ns", "<i8", "ns since boot, when the modem was asked", UNKNOWN_TIME),
        Column(
            "fix_start_seq", "<i8", "seq of the fix current when the modem was asked", UNKNOWN_ID
        ),
        Column("fix_seq", "<i8", "seq of the fix current at the end of the scan", UNKNOWN_ID),
        _text("cell", 64, "name of the cell: mcc-mnc-lac-cid, or as imported"),
        _text("role", 12, "serving, neighbour or scan"),
        _text("rat", 8, "radio access technology"),
        _text("mcc", 4, "mobile country code, as printed"),
        _text("mnc", 4, "mobile network code, as printed"),
        _count("lac", "location area code, GSM and WCDMA"),
        _count("tac", "tracking area code, LTE and later"),
        _count("cid", "cell identity", "<i8"),
        _count("arfcn", "channel number"),
        _count("arfcn_raw", "channel number as printed"),
        _text("band", 12, "band as printed"),
        _count("bsic", "GSM: 8 NCC + BCC"),
        _count("psc", "WCDMA: primary scrambling code"),
        _count("pci", "LTE and later: physical cell identity"),
        _count("rxlev_raw", "level index as printed"),
        _count("rxq", "quality index as printed"),
        _float("rssi_dbm", "dBm"),
        _float("rscp_dbm", "dBm, WCDMA"),
        _float("ecio_db", "dB, WCDMA"),
        _float("rsrp_dbm", "dBm, LTE and later"),
        _float("rsrq_db", "dB, LTE and later"),
        _float("sinr_db", "dB, LTE and later"),
        _count("ta", "timing advance, steps of 553.5 m"),
        Column("c1", "<i4", "path loss criterion C1", UNKNOWN_SIGNED),
        Column("c2", "<i4", "reselection criterion C2", UNKNOWN_SIGNED),
        Column(
            "identity_unsure", "|u1", "1 where a byte of the identity may be lost or doubled", 0
        ),
    ),
    "notes": (
        *HEAD,
        _text("level", 8, "info, warning or error"),
        _text("code", 24, "kind of event"),
        _text("text", 400, "what happened"),
    ),
    "live": (
        *HEAD,
        Column("scan_seq", "<i8", "seq of the scan that was used"),
        _text("stage", 16, "which estimator"),
        _text("cell", 64, "target"),
        Column("n", "<i4", "readings used so far"),
        Column("utm_zone", "<i4", "UTM zone, negative south of the equator"),
        _float("x_m", "m east"),
        _float("y_m", "m north"),
        _float("p0_dbm", "dBm at 1 m"),
        _float("eta", "1"),
        *(
            _float(f"p_{a}{b}", "covariance")
            for a, b in ("xx", "xy", "x0", "xe", "yy", "y0", "ye", "00", "0e", "ee")
        ),
        _float("innovation_db", "dB"),
        _float("innovation_var_db2", "dB^2"),
        _float("probability", "1, of the place; below 1 there are others"),
    ),
    "raw": (
        *HEAD,
        Column("sent", "|u1", "1 for bytes the logger wrote"),
        Column("offset", "<i8", "first byte in raw_bytes"),
        Column("length", "<i4", "bytes"),
    ),
}


_ADDED_IN: Mapping[int, Mapping[str, frozenset[str]]] = {
    3: {"readings": frozenset({"identity_unsure"})},
}
"""Columns by the version that added them."""


def columns_of(version: int) -> dict[str, list[tuple[str, str]]]:
    """Name and type of each column by table, as that version wrote them, from `OLDEST_DESCRIBED`
    on.
    """
    later = [tables for added_in, tables in _ADDED_IN.items() if added_in > version]

    def had(table: str, column: Column) -> bool:
        return not any(column.name in tables.get(table, ()) for tables in later)

    return {
        table: [(c.name, c.dtype) for c in columns if had(table, c)]
        for table, columns in TABLES.items()
    }


def columns_text(table: str, names: Iterable[str]) -> str:
    """Names and units of a table's columns, as an attribute of the HDF5 file has them."""
    units = {column.name: column.unit for column in TABLES[table]}
    return "\n".join(f"{name}: {units.get(name, '')}" for name in names)


def is_columns_text(table: str, names: Iterable[str], text: str) -> bool:
    """Whether a text is one that some version of this program has written about columns of those
    names.
    """
    known = {f"{column.name}: {column.unit}" for column in TABLES[table]} | _EARLIER_WORDS
    lines = text.split("\n")
    return set(lines) <= known and {line.partition(":")[0] for line in lines} >= set(names)


_EARLIER_WORDS = frozenset(
    {
        "lac: location area code",
        "bsic: 8 NCC + BCC",
        "fix_seq: seq of the fix current at the scan",
    }
)
"""Lines of runs of schema 1.

A change of words goes in here, or the files of yesterday seem altered.
"""


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
    """Rows of a table, values in column order, as bytes; raises OverflowError for a number that
    does not fit.
    """
    try:
        return b"".join(_PACKING[table].pack(*row) for row in rows)
    except struct.error as error:
        raise OverflowError(f"{table}: {error}") from error


def row_size(table: str) -> int:
    """Bytes of one packed row."""
    return _PACKING[table].size


def rows_of(seq: int, record: Record) -> list[tuple[str, tuple[Any, ...]]]:
    """Rows of a record as (table, values in column order); raw bytes are the writer's own
    affair.
    """
    head: dict[str, Any] = {"seq": seq, "t_ns": record.t_ns, "source": record.source}
    value = record.value
    match value:
        case Scan():
            of_scan = {
                name: getattr(value, name) for name in ("t_start_ns", "fix_start_seq", "fix_seq")
            }
            return [
                ("scans", _row("scans", head, value, n_readings=len(value.readings))),
                *(
                    ("readings", _row("readings", {**head, **of_scan}, reading, cell=reading.cell))
                    for reading in value.readings
                ),
            ]
        case Fix():
            return [("fixes", _row("fixes", head, value))]
        case Note():
            return [("notes", _row("notes", head, value))]
        case LiveEstimate():
            return [("live", _row("live", head, value))]
    raise TypeError(f"no table for {type(value).__name__}")


def _row(
    table: str, head: Mapping[str, Any], value: Value | CellReading, **more: Any
) -> tuple[Any, ...]:
    given = {**head, **more}
    return tuple(
        encode(column, given[column.name] if column.name in given else getattr(value, column.name))
        for column in TABLES[table]
    )


def encode(column: Column, value: Any) -> Any:
    """A value as it stands in a row: unknown texts are empty, other unknowns have their mark."""
    if column.dtype.startswith("S"):
        return _fit("" if value is None else str(value), int(column.dtype[1:]))
    if value is None:
        return math.nan if column.unknown is None else column.unknown
    return value


def _fit(text: str, size: int) -> bytes:
    """UTF-8 of at most `size` bytes, cut between characters; a trailing NUL would be lost by numpy
    and is dropped.
    """
    encoded = text.encode("utf-8", "replace")
    if len(encoded) > size:
        encoded = encoded[: size - 3].decode("utf-8", "ignore").encode() + "…".encode()
    return encoded.rstrip(b"\0")
