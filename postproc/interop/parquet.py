"""Parquet: the levels as a table with typed columns, for pandas, DuckDB or Spark."""

from collections.abc import Sequence
from dataclasses import fields as fields_of
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from logger.core.schema import TABLES
from logger.core.types import CellReading
from postproc.interop.sighting import Heard

_CELL = [f.name for f in fields_of(CellReading) if f.name not in {"label", "more"}]
_COLUMNS = {column.name: column for column in TABLES["readings"]}
_PLACE = {
    "alt_m": "m above sea level",
    "acc_m": "m, radius that holds 68 %",
    "speed_mps": "m/s",
    "course_deg": "deg",
}


def write(heard: Sequence[Heard], target: Path, start_ns: int) -> None:
    """One row for each level; the unit of a column is in its metadata, null is unknown."""
    about = {
        "description": (
            "levels of cells along a walk, by cellwalk; t_s counts from the start, utc by GPS"
        )
    }
    columns = [
        (_field("t_s", pa.float64(), "s"), [(one.t_ns - start_ns) / 1e9 for one in heard]),
        (
            _field("utc", pa.timestamp("us", tz="UTC"), "by GPS"),
            [_microseconds(one.fix.utc_ns) for one in heard],
        ),
        (_field("lat_deg", pa.float64(), "deg north, WGS 84"), [one.lat_deg for one in heard]),
        (_field("lon_deg", pa.float64(), "deg east, WGS 84"), [one.lon_deg for one in heard]),
        *(
            (_field(n, pa.float64(), unit), [getattr(one.fix, n) for one in heard])
            for n, unit in _PLACE.items()
        ),
        (_field("cell", pa.string(), "name of the cell"), [one.reading.cell for one in heard]),
        (_field("level_dbm", pa.float64(), "dBm"), [one.rssi_dbm for one in heard]),
        *(
            (_field(n, _kind(n), _COLUMNS[n].unit), [_value(one, n) for one in heard])
            for n in _CELL
        ),
    ]
    arrays = [pa.array(values, type=field.type) for field, values in columns]
    schema = pa.schema([field for field, _ in columns], metadata=about)
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), target)


def _field(name: str, kind: pa.DataType, unit: str) -> pa.Field:
    return pa.field(name, kind, metadata={"unit": unit})


def _kind(name: str) -> pa.DataType:
    dtype = _COLUMNS[name].dtype
    return pa.string() if dtype.startswith("S") else pa.float64() if dtype == "<f8" else pa.int64()


def _value(one: Heard, name: str) -> object:
    value = getattr(one.reading, name)
    return str(value) if name == "band" and value is not None else value


def _microseconds(utc_ns: int | None) -> int | None:
    return None if utc_ns is None else utc_ns // 1000
