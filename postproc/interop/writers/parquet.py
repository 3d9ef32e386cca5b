"""Parquet: the levels as a table with typed columns, for pandas, DuckDB or Spark."""

from dataclasses import fields as fields_of
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from logger.core.schema import TABLES
from logger.core.types import Broadcast, CellReading
from postproc.interop.exporting import ExportWalk
from postproc.interop.sighting import Sighting

_CELL = [f.name for f in fields_of(CellReading) if f.name not in {"broadcast", "label", "more"}]
_BROADCAST = [f.name for f in fields_of(Broadcast)]
_COLUMNS = {c.name: c for table in ("broadcasts", "readings") for c in TABLES[table]}
_PLACE = {
    "alt_m": "m above sea level",
    "acc_m": "m, radius that holds 68 %",
    "speed_mps": "m/s",
    "course_deg": "deg",
}


def write(walk: ExportWalk, target: Path) -> None:
    """One row for each level; the unit of a column is in its metadata, null is unknown."""
    sightings, start_ns = walk.sightings, walk.start_ns
    about = {
        "description": (
            "levels of cells along a walk, by cellwalk; t_s counts from the start, utc by GPS"
        )
    }
    columns = [
        (
            _field("t_s", pa.float64(), "s"),
            [(sighting.t_ns - start_ns) / 1e9 for sighting in sightings],
        ),
        (
            _field("utc", pa.timestamp("us", tz="UTC"), "by GPS"),
            [_microseconds(sighting.fix.utc_ns) for sighting in sightings],
        ),
        (
            _field("lat_deg", pa.float64(), "deg north, WGS 84"),
            [sighting.lat_deg for sighting in sightings],
        ),
        (
            _field("lon_deg", pa.float64(), "deg east, WGS 84"),
            [sighting.lon_deg for sighting in sightings],
        ),
        *(
            (_field(n, pa.float64(), unit), [getattr(sighting.fix, n) for sighting in sightings])
            for n, unit in _PLACE.items()
        ),
        (
            _field("cell", pa.string(), "name of the cell"),
            [sighting.reading.cell for sighting in sightings],
        ),
        (_field("level_dbm", pa.float64(), "dBm"), [sighting.rssi_dbm for sighting in sightings]),
        *(
            (_field(n, _kind(n), _COLUMNS[n].unit), [_value(sighting, n) for sighting in sightings])
            for n in (*_CELL, *_BROADCAST)
        ),
    ]
    arrays = [pa.array(values, type=field.type) for field, values in columns]
    schema = pa.schema([field for field, _ in columns], metadata=about)
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), target)


def _field(name: str, kind: pa.DataType, unit: str) -> pa.Field:
    return pa.field(name, kind, metadata={"unit": unit})


def _kind(name: str) -> pa.DataType:
    if name == "neighbour_arfcns":
        return pa.list_(pa.int64())
    dtype = _COLUMNS[name].dtype
    return pa.string() if dtype.startswith("S") else pa.float64() if dtype == "<f8" else pa.int64()


def _value(sighting: Sighting, name: str) -> object:
    value = getattr(
        sighting.reading.broadcast if name in _BROADCAST else sighting.reading, name, None
    )
    if isinstance(value, bool):
        return int(value)
    return str(value) if name == "band" and value is not None else value


def _microseconds(utc_ns: int | None) -> int | None:
    return None if utc_ns is None else utc_ns // 1000
