"""Readings of many runs as Parquet files of one batch, which exists completely or not at all.

Files are written under other names, flushed, and renamed, that of the runs last. What a killed
program has left is removed by the next one.
"""

import json
import os
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from logger.core.arrays import IntArray
from logger.core.errors import RunFileError
from logger.core.foreign import check_regular
from logger.core.runfile.journal import sync_folder
from postproc.survey import layout
from postproc.survey.walk_readings import WalkReadings

MOST_ROWS = 1_000_000
"""Of a batch: 0.2 GB of arrays and of what the rules see, and as much again while it is written."""
_MOST_READ_ROWS = 10 * MOST_ROWS
"""Of a file: its last walk may be long, and a billion equal values pack to a kilobyte."""
_ROWS_AT_ONCE = 1 << 15
"""Of a row group: a reader skips those without its cells by their statistics."""
_COLUMNS_AT_ONCE = 1 << 10
"""Of a row group of what the rules see: some 30 runs."""
_TEXTS = ("cell", "run", "zone", "ta", "table", "column", "kind")
_DICTIONARIES = ["cell", "run"]
_COLUMNS = (
    *("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq"),
    *("ta", "named_share"),
)


class _Series(NamedTuple):
    """Readings of one cell of one walk: rows `first` to `end`."""

    cell: str
    walk: WalkReadings
    first: int
    end: int


class Batch:
    """Walks that are gathered in memory until they are written together."""

    def __init__(self) -> None:
        self.walks: list[WalkReadings] = []
        self.n_rows = 0

    def take(self, walk: WalkReadings) -> None:
        """Add a walk."""
        self.walks.append(walk)
        self.n_rows += len(walk)

    @property
    def is_full(self) -> bool:
        """Whether it should be written before another walk is added."""
        return self.n_rows >= MOST_ROWS

    def write(self, survey: Path, name: str) -> None:
        """Write all files; raises `RunFileError`, and leaves nothing, where that is impossible."""
        written: list[Path] = []
        try:
            for area, series in sorted(self._by_area().items()):
                written.append(layout.readings_file(survey, area, name))
                _write(_readings(series), written[-1])
            written.append(layout.cells_file(survey, name))
            _write(_cells(self.walks), written[-1])
            if any(walk.rules for walk in self.walks):
                written.append(layout.rules_file(survey, name))
                _write(_rules(self.walks), written[-1], _COLUMNS_AT_ONCE)
            sizes = {str(path.relative_to(survey)): path.stat().st_size for path in written}
            written.append(layout.runs_file(survey, name))
            about = {layout.FILES_KEY: json.dumps(sizes).encode()}
            _write(_runs(self.walks).replace_schema_metadata(about), written[-1])
        except OSError as error:
            for path in written:
                path.unlink(missing_ok=True)
            raise RunFileError(
                f"cannot write {survey}: {error.strerror or error}; what was added before is safe"
            ) from error

    def _by_area(self) -> dict[str, list[_Series]]:
        by_area: dict[str, list[_Series]] = defaultdict(list)
        for walk in self.walks:
            ends = np.searchsorted(walk.cell, np.arange(len(walk.cells)), side="right").tolist()
            for heard, first, end in zip(walk.cells, [0, *ends], ends, strict=False):
                by_area[layout.area_of(heard.cell)].append(_Series(heard.cell, walk, first, end))
        return by_area


def _readings(series: list[_Series]) -> pa.Table:
    """Cell by cell, of each cell walk by walk, of each walk in time order."""
    series = sorted(series, key=lambda one: one.cell)
    lengths = [one.end - one.first for one in series]
    columns = {
        name: np.concatenate([getattr(one.walk, name)[one.first : one.end] for one in series])
        for name in _COLUMNS
    }
    arrays = {
        **{name: pa.array(values) for name, values in columns.items()},
        "cell": _repeat([one.cell for one in series], lengths),
        "run": _repeat([one.walk.run.digest for one in series], lengths),
        "zone": pa.array(np.repeat([one.walk.zone for one in series], lengths)),
    }
    return pa.table(
        [_as(arrays[field.name], field.type) for field in layout.READINGS], schema=layout.READINGS
    )


def _repeat(texts: list[str], lengths: list[int]) -> pa.Array:
    names = sorted(set(texts))
    number = {name: i for i, name in enumerate(names)}
    indices: IntArray = np.repeat([number[text] for text in texts], lengths).astype(np.int32)
    return pa.DictionaryArray.from_arrays(pa.array(indices), pa.array(names))


def _as(values: pa.Array, kind: pa.DataType) -> pa.Array:
    return values if values.type == kind else values.cast(kind)


def _cells(walks: list[WalkReadings]) -> pa.Table:
    rows = [
        {
            "run": walk.run.digest,
            "cell": heard.cell,
            "rat": heard.rat,
            "n_readings": heard.n_readings,
            "n_scans": heard.n_scans,
            "channels": [number for pair in heard.channels for number in pair],
        }
        for walk in walks
        for heard in walk.cells
    ]
    return pa.Table.from_pylist(rows, schema=layout.CELLS)


def _runs(walks: list[WalkReadings]) -> pa.Table:
    rows = [{name: getattr(walk.run, name) for name in layout.RUNS.names} for walk in walks]
    return pa.Table.from_pylist(rows, schema=layout.RUNS)


def _rules(walks: list[WalkReadings]) -> pa.Table:
    rows = [(walk.run.digest, *column) for walk in walks for column in walk.rules]
    columns = zip(*rows, strict=True)
    arrays = [
        pa.array(column, kind) for column, kind in zip(columns, layout.RULES.types, strict=True)
    ]
    return pa.Table.from_arrays(arrays, schema=layout.RULES)


def _write(table: pa.Table, target: Path, rows_at_once: int = _ROWS_AT_ONCE) -> None:
    """A durable file under its name; a failure leaves none."""
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_suffix(".part")
    try:
        with part.open("wb") as file:
            pq.write_table(
                table,
                file,
                row_group_size=rows_at_once,
                compression="zstd",
                write_page_checksum=True,
                use_dictionary=[name for name in table.column_names if name in _TEXTS],
            )
            file.flush()
            os.fsync(file.fileno())
        part.replace(target)
        sync_folder(target.parent)
    finally:
        part.unlink(missing_ok=True)


def read_columns(
    path: Path,
    schema: pa.Schema,
    columns: Sequence[str] | None = None,
    filters: pc.Expression | None = None,
) -> pa.Table:
    """Columns of a file of a survey, by default all, texts that repeat as dictionaries.

    Raises `RunFileError` for a file that is damaged or has other columns.
    """
    names = schema.names if columns is None else columns
    try:
        check_regular(path)
        if pq.read_metadata(path).num_rows > _MOST_READ_ROWS:
            raise pa.ArrowInvalid("it states more rows than a batch has")
        table = pq.read_table(
            path,
            columns=columns,
            filters=filters,
            partitioning=None,
            read_dictionary=_DICTIONARIES if schema is layout.READINGS else None,
            page_checksum_verification=True,
        )
        table.validate(full=True)
        for name in names:
            if name in layout.NOT_IN_OLDER and name not in table.schema.names:
                continue
            kind = table.schema.field(name).type
            kind = kind.value_type if pa.types.is_dictionary(kind) else kind
            if kind == pa.int8() and schema.field(name).type == pa.int16():  # of older surveys
                at = table.schema.get_field_index(name)
                table = table.set_column(at, schema.field(name), table[name].cast(pa.int16()))
            elif kind != schema.field(name).type:
                raise pa.ArrowInvalid(f"column {name} holds {kind}")
    # the library takes what it reads for names, sizes and types of Python
    except (OSError, ValueError, LookupError, TypeError, MemoryError, pa.ArrowException) as error:
        raise RunFileError(
            f"{path} is damaged: {' '.join(str(error).split())[:200]}; remove the batch's file in "
            "runs/ and add its runs again"
        ) from error
    return table
