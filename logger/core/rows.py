"""The run file's tables as numpy arrays: what `schema` says, for those who read runs."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from logger.core.schema import SCHEMA_VERSION, TABLES, Column, columns_of, encoded

Rows = npt.NDArray[np.void]


def dtypes_of(version: int) -> Mapping[str, np.dtype[np.void]]:
    """Packed rows as that version wrote them, from `OLDEST_DESCRIBED` on."""
    return {table: np.dtype(columns) for table, columns in columns_of(version).items()}


DTYPES: Mapping[str, np.dtype[np.void]] = dtypes_of(SCHEMA_VERSION)


def as_of_now(table: str, rows: Rows) -> Rows:
    """Rows of a run of any version, with all of today's columns: unknown where that version had none."""
    if set(DTYPES[table].names or ()) <= set(rows.dtype.names or ()):
        return rows
    whole = np.zeros(len(rows), DTYPES[table])
    for column in TABLES[table]:
        has = column.name in (rows.dtype.names or ())
        whole[column.name] = rows[column.name] if has else encoded(column, None)
    return whole


def values_of(table: str, rows: Rows) -> Iterator[dict[str, Any]]:
    """Python values of each row by column name, None where unknown; columns this version does not know are left out."""
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
