"""What the rules of suspicion see of a run: its columns as a survey keeps them, and the records.

Positions are those of the receiver, since the rules say something else of smoothed ones, and
readings without an identity are among them. Times count from the start of the run.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from logger.core.arrays import IntArray
from logger.core.rows import channels_of
from logger.core.runfile import Run
from logger.core.schema import TABLES
from logger.core.types import Broadcast, CellReading, Fix, Record, Scan

_COLUMNS: Mapping[str, tuple[str, ...]] = {
    "fixes": ("seq", "t_ns", "valid", "lat_deg", "lon_deg"),
    "scans": ("seq", "t_ns"),
    "readings": (
        "seq", "cell", "role", "rat", "mcc", "mnc", "lac", "tac", "cid", "arfcn", "bsic", "psc",
        "pci", "rxlev_raw", "rssi_dbm", "rscp_dbm", "rsrp_dbm", "ta", "c1", "c2",
        "identity_unsure",
    ),
    "broadcasts": ("seq", "reading", *(field.name for field in fields(Broadcast))),
}  # fmt: skip
_SCHEMA = {table: {column.name: column for column in TABLES[table]} for table in _COLUMNS}


class RuleColumn(NamedTuple):
    """A column of a table of a run: numpy dtype, length, and the bytes of its values.

    Of a column with one value throughout, that value is kept. `max_fix_age_s`, the age at which
    fixes of the run end, is the same in all its columns.
    """

    max_fix_age_s: float
    table: str
    column: str
    kind: str
    n: int
    values: bytes


def rule_inputs(run: Run) -> list[RuleColumn]:
    """What the rules see of a run, and nothing else of it."""
    return [
        _pack(run, table, name)
        for table, names in _COLUMNS.items()
        if len(run.tables[table])
        for name in names
    ]


def records_of(columns: Sequence[RuleColumn]) -> list[Record]:
    """Fixes and scans in recorded order, with what the rules ask."""
    tables: dict[str, dict[str, list[Any]]] = {table: {} for table in _COLUMNS}
    for column in columns:
        tables[column.table][column.column] = _unpack(column)
    records = [*_fixes(tables["fixes"]), *_scans(tables)]
    seq = tables["fixes"].get("seq", []) + tables["scans"].get("seq", [])
    return [records[i] for i in np.argsort(np.array(seq, np.int64), kind="stable").tolist()]


def _pack(run: Run, table: str, name: str) -> RuleColumn:
    values: NDArray[Any] = run.tables[table][name]
    if name == "t_ns":
        values = values - run.meta.started_ns
    n = len(values)
    if np.all(values == values[0]) or (values.dtype.kind == "f" and np.all(np.isnan(values))):
        values = values[:1]
    stored = np.ascontiguousarray(values).tobytes()
    return RuleColumn(run.meta.live.max_fix_age_s, table, name, values.dtype.str, n, stored)


def _unpack(packed: RuleColumn) -> list[Any]:
    stored = np.frombuffer(packed.values, np.dtype(packed.kind))
    column = _SCHEMA[packed.table][packed.column]
    values: list[Any] = stored.tolist()
    if stored.dtype.kind == "S":
        texts = {text: text.decode("utf-8", "replace") or None for text in set(values)}
        values = [texts[text] for text in values]
    elif stored.dtype.kind == "f":
        values = [value if value == value else None for value in values]  # noqa: PLR0124 (NaN)
    elif column.unknown is not None:
        values = [None if value == column.unknown else value for value in values]
    return values * packed.n if len(values) == 1 else values


def _fixes(columns: Mapping[str, list[Any]]) -> Iterator[Record]:
    names = ("t_ns", "valid", "lat_deg", "lon_deg")
    for t_ns, valid, lat_deg, lon_deg in zip(
        *(columns.get(name, []) for name in names), strict=True
    ):
        yield Record(t_ns, "", Fix(bool(valid), None, lat_deg, lon_deg))


def _scans(tables: Mapping[str, Mapping[str, list[Any]]]) -> Iterator[Record]:
    scans = tables["scans"]
    readings = _readings(tables["readings"], _broadcasts(tables["broadcasts"]))
    seq: IntArray = np.array(tables["readings"].get("seq", []), np.int64)
    own = np.array(scans.get("seq", []), np.int64)
    first, end = (np.searchsorted(seq, own, side).tolist() for side in ("left", "right"))
    for i, t_ns in enumerate(scans.get("t_ns", [])):
        yield Record(t_ns, "", Scan(t_ns, tuple(readings[first[i] : end[i]])))


def _readings(
    columns: Mapping[str, list[Any]], broadcasts: Mapping[tuple[int, int], Broadcast]
) -> list[CellReading]:
    names = [name for name in columns if name not in {"seq", "cell", "identity_unsure"}]
    rows = zip(*(columns[name] for name in names), strict=True)
    heads = (columns.get(name, []) for name in ("seq", "cell", "identity_unsure"))
    readings, scan, place = [], None, 0
    for row, seq, cell, is_unsure in zip(rows, *heads, strict=True):
        place = place + 1 if seq == scan else 0
        scan = seq
        reading = CellReading(
            **dict(zip(names, row, strict=True)),
            identity_unsure=bool(is_unsure),
            broadcast=broadcasts.get((seq, place)),
        )
        # a cell named by its identity needs no label
        readings.append(reading if reading.cell == cell else replace(reading, label=cell))
    return readings


def _broadcasts(columns: Mapping[str, list[Any]]) -> dict[tuple[int, int], Broadcast]:
    """By the number of the scan and the position of the reading in it."""
    names = [field.name for field in fields(Broadcast)]
    found = {}
    for i in range(len(columns.get("seq", []))):
        values = {name: columns[name][i] for name in names}
        values["broadcast_unsure"] = bool(values["broadcast_unsure"])
        values["neighbour_arfcns"] = channels_of(values["neighbour_arfcns"])
        found[columns["seq"][i], columns["reading"][i]] = Broadcast(**values)
    return found
