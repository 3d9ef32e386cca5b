"""The tables of `schema` as numpy arrays, for everything that reads runs."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from logger.core.arrays import FloatArray, IntArray
from logger.core.schema import (
    EMPTY_LIST,
    HEAD,
    OLDEST_DESCRIBED,
    SCHEMA_VERSION,
    TABLES,
    columns_of,
    encode,
)
from logger.core.types import HIGHEST_ARFCN, RXLEV_0_DBM, UNKNOWN_ID, Column

Rows = npt.NDArray[np.void]

_HASH_FACTOR, _HASH_SHIFT = np.uint64(0x9E3779B97F4A7C15), np.uint64(29)
"""Multiplicative hashing by the golden ratio (Knuth, The Art of Computer Programming 3, 6.4)."""

ROWS_AT_ONCE = 4096
"""Rows decoded together, column by column: faster than row by row, in bounded memory."""


def dtypes_of(version: int) -> Mapping[str, np.dtype[np.void]]:
    """Packed rows as a version from `OLDEST_DESCRIBED` on wrote them."""
    return {table: np.dtype(columns) for table, columns in columns_of(version).items()}


DTYPES: Mapping[str, np.dtype[np.void]] = dtypes_of(SCHEMA_VERSION)


def parse_dtypes(
    columns: Mapping[str, Iterable[tuple[str, str]]],
) -> Mapping[str, np.dtype[np.void]]:
    """Rows as a run describes them by name and type of each column; today's if it does not.

    A table that not every version had is there only if described. Raises ValueError for a
    description that fits none of our tables: the file is not trusted.
    """
    dtypes = {table: DTYPES[table] for table in columns_of(OLDEST_DESCRIBED)}
    for table, description in columns.items():
        if table not in TABLES:
            raise ValueError(f"no table is called {table!r}")
        dtypes[table] = _parse_dtype(table, dict(description))
    return dtypes


def _parse_dtype(table: str, kinds: Mapping[str, str]) -> np.dtype[np.void]:
    today = {column.name: np.dtype(column.dtype) for column in TABLES[table]}
    for name, kind in kinds.items():
        if not _PLAIN.fullmatch(kind):
            raise ValueError(f"{table}: no column is of the type {kind!r}")
        if name in today and not _is_compatible(np.dtype(kind), today[name]):
            raise ValueError(f"{table}: the column {name!r} was never of the type {kind!r}")
    if len(kinds) > _MOST_COLUMNS:
        raise ValueError(f"{table} has {len(kinds)} columns")
    if missing := [column.name for column in HEAD if column.name not in kinds]:
        raise ValueError(f"{table} has no column {missing[0]!r}")
    return np.dtype(list(kinds.items()))


def _is_compatible(stored: np.dtype[Any], today: np.dtype[Any]) -> bool:
    """Whether today's column holds every value; texts may be shortened."""
    return stored.kind == today.kind and (stored.kind == "S" or stored.itemsize <= today.itemsize)


_PLAIN = re.compile(r"\|?S[1-9]\d{0,2}|[<|]?[iuf][1248]")
"""Types of columns of a run: little-endian numbers, and text of fewer than 1000 bytes."""
_MOST_COLUMNS = 100
"""More than any version had: a description must not exhaust the memory."""


def numbered_texts(column: npt.NDArray[np.bytes_]) -> tuple[npt.NDArray[np.bytes_], IntArray]:
    """The different texts of a column in order, and the number of each row's among them.

    As `np.unique` with the inverse, by a hash and ten times as fast; equal hashes are compared.
    """
    if not len(column):
        return column, np.zeros(0, np.int64)
    n_words = -(-column.dtype.itemsize // 8)
    words = np.ascontiguousarray(column.astype(f"S{8 * n_words}")).view(np.uint64)
    words = words.reshape(-1, n_words)
    key = np.zeros(len(column), np.uint64)
    for word in words.T:
        key = (key ^ word) * _HASH_FACTOR
        key ^= key >> _HASH_SHIFT
    keys = np.unique(key)
    which = np.searchsorted(keys, key)
    example = np.empty(len(keys), np.int64)
    example[which] = np.arange(len(column))
    if np.any(words[example][which] != words):  # two texts have one hash
        found, number = np.unique(column, return_inverse=True)
        return found, number.astype(np.int64)
    texts = column[example]
    order = np.argsort(texts)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return texts[order], rank[which]


def rows_of_each(numbers: IntArray) -> list[tuple[int, IntArray]]:
    """The numbers of a column in order, each with its rows."""
    order = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order])) + 1
    parts = np.split(order, starts) if len(order) else []
    return [(int(numbers[rows[0]]), rows) for rows in parts]


def to_current_columns(table: str, rows: Rows) -> Rows:
    """Rows of a run of any version with today's columns, unknown where it had none."""
    if rows.dtype == DTYPES[table]:
        return rows
    current = np.zeros(len(rows), DTYPES[table])
    names = rows.dtype.names or ()
    for column in TABLES[table]:
        current[column.name] = rows[column.name] if column.name in names else encode(column, None)
    return current


def values_of(table: str, rows: Rows) -> Iterator[dict[str, Any]]:
    """Python values of each row by column name, None if unknown.

    Columns that this version does not have are left out.
    """
    columns = [column for column in TABLES[table] if column.name in (rows.dtype.names or ())]
    names = [column.name for column in columns]
    for first in range(0, len(rows), ROWS_AT_ONCE):
        some = rows[first : first + ROWS_AT_ONCE]
        decoded = [_decode(column, some[column.name]) for column in columns]
        for row in zip(*decoded, strict=True):
            yield dict(zip(names, row, strict=True))


def _decode(column: Column, stored: npt.NDArray[Any]) -> list[Any]:
    values: list[Any] = stored.tolist()
    if stored.dtype.kind == "S":
        texts = {value: value.decode("utf-8", "replace") or None for value in set(values)}
        return [texts[value] for value in values]
    is_unknown = (stored != stored) | (stored == column.unknown)  # noqa: PLR0124 (NaN)
    if np.all(is_unknown):
        return [None] * len(values)
    for i in np.flatnonzero(is_unknown).tolist():
        values[i] = None
    return values


def channels_of(text: str | None) -> tuple[int, ...] | None:
    """GSM channels of a list as `schema.list_text` writes it; None for what it never writes."""
    if text == EMPTY_LIST:
        return ()
    if text is None or not _LIST.fullmatch(text):
        return None
    channels = tuple(map(int, text.split(" ")))
    return channels if max(channels) <= HIGHEST_ARFCN else None


_LIST = re.compile(r"[0-9]{1,4}(?: [0-9]{1,4})*", re.ASCII)


def levels_dbm(readings: Rows) -> FloatArray:
    """Levels as `CellReading.level_dbm` defines them, for the table `readings`, shape (n,)."""
    rxlev = readings["rxlev_raw"]
    level_dbm = np.where(rxlev == UNKNOWN_ID, np.nan, rxlev + RXLEV_0_DBM)
    for name in ("rssi_dbm", "rscp_dbm", "rsrp_dbm"):
        level_dbm = np.where(np.isfinite(readings[name]), readings[name], level_dbm)
    return np.asarray(level_dbm, float)
