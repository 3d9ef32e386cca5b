"""The run file's tables as numpy arrays: what `schema` says, for those who read runs."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from logger.core.column import Column
from logger.core.schema import HEAD, SCHEMA_VERSION, TABLES, columns_of, encode

Rows = npt.NDArray[np.void]


def dtypes_of(version: int) -> Mapping[str, np.dtype[np.void]]:
    """Packed rows as that version wrote them, from `OLDEST_DESCRIBED` on."""
    return {table: np.dtype(columns) for table, columns in columns_of(version).items()}


DTYPES: Mapping[str, np.dtype[np.void]] = dtypes_of(SCHEMA_VERSION)


def parse_dtypes(
    columns: Mapping[str, Iterable[tuple[str, str]]],
) -> Mapping[str, np.dtype[np.void]]:
    """Rows as a run describes them by name and type of each column; today's where it does not.

    Raises ValueError for what describes none of our tables: a file may say anything of itself.
    """
    found = dict(DTYPES)
    for table, given in columns.items():
        if table not in TABLES:
            raise ValueError(f"no table is called {table!r}")
        found[table] = _parse_dtype(table, dict(given))
    return found


def _parse_dtype(table: str, kinds: Mapping[str, str]) -> np.dtype[np.void]:
    todays = {column.name: np.dtype(column.dtype) for column in TABLES[table]}
    for name, kind in kinds.items():
        if not _PLAIN.fullmatch(kind):
            raise ValueError(f"{table}: no column is of the type {kind!r}")
        then, now = np.dtype(kind), todays.get(name)
        if now is not None and (
            then.kind != now.kind or (then.kind != "S" and then.itemsize > now.itemsize)
        ):
            raise ValueError(f"{table}: the column {name!r} was never of the type {kind!r}")
    if len(kinds) > _MOST_COLUMNS:
        raise ValueError(f"{table} has {len(kinds)} columns")
    if missing := [column.name for column in HEAD if column.name not in kinds]:
        raise ValueError(f"{table} has no column {missing[0]!r}")
    return np.dtype(list(kinds.items()))


_PLAIN = re.compile(r"\|?S[1-9]\d{0,2}|[<|]?[iuf][1248]")
"""Types that a column of a run has: little-endian numbers, and text of fewer than 1000 bytes."""
_MOST_COLUMNS = 100


def to_current_columns(table: str, rows: Rows) -> Rows:
    """Rows of a run of any version, with today's columns: unknown where that version had none."""
    if rows.dtype == DTYPES[table]:
        return rows
    whole = np.zeros(len(rows), DTYPES[table])
    for column in TABLES[table]:
        has = column.name in (rows.dtype.names or ())
        whole[column.name] = rows[column.name] if has else encode(column, None)
    return whole


def values_of(table: str, rows: Rows) -> Iterator[dict[str, Any]]:
    """Python values of each row by column name, None where unknown; columns this version does not
    know are left out.
    """
    columns = {column.name: column for column in TABLES[table]}
    names = rows.dtype.names or ()
    known = [(i, columns[name]) for i, name in enumerate(names) if name in columns]
    for row in rows.tolist():
        yield {column.name: _decode(column, row[i]) for i, column in known}


def _decode(column: Column, value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace") or None
    if value == column.unknown or value != value:  # noqa: PLR0124 (NaN)
        return None
    return value
