"""Untrusted SQLite files, opened to read tables only.

A schema may hold more than tables: a view that never ends, a column computed by a function, a page
that points to itself. All else is refused, and a query ends where an honest file would long have
been read.
"""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from time import monotonic

from logger.core.foreign import begins_with, check_regular, open_regular

_STEPS_AT_ONCE = 1_000_000
_STEPS_OF_SCHEMA = 5_000
_SCHEMA_S = 5.0
"""To read the schema, which takes milliseconds; that of 100,000 tables takes minutes."""
_STEPS_LEAST = 200_000_000
_STEPS_BY_BYTE = 50
"""A plain scan takes about one step of SQLite's machine for each byte."""
LONGEST_BYTES = 4 << 20
"""Of a value or a row: a tile has some kilobytes, the JSON of an observation too."""
_ALLOWED = frozenset(
    {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_FUNCTION, sqlite3.SQLITE_PRAGMA}
)
SQLITE_MAGIC = b"SQLite format 3\0"  # sqlite.org/fileformat.html, section 1.2
_APPLICATION_ID = slice(68, 72)  # section 1.3


def is_sqlite(path: Path) -> bool:
    """Whether a file begins as an SQLite database does; no for one that cannot be read."""
    return begins_with(path, SQLITE_MAGIC)


def application_id(path: Path) -> int | None:
    """None for a file of another kind."""
    if not is_sqlite(path):
        return None
    with open_regular(path) as file:
        return int.from_bytes(file.read(_APPLICATION_ID.stop)[_APPLICATION_ID], "big")


@contextmanager
def open_database(path: Path, *, views: bool = False) -> Iterator[sqlite3.Connection]:
    """A database to read; raises sqlite3.Error, also for a query that takes too many steps."""
    with closing(connect(path, views=views)) as database:
        yield database


def connect(
    path: Path,
    *,
    views: bool = False,
    check: Callable[[sqlite3.Connection], None] = lambda _: None,
) -> sqlite3.Connection:
    """As `open_database`, to be closed by the caller; `views` allows views, which maps contain.

    Raises OSError for what is no plain file, and what `check` raises, closed.
    """
    size = check_regular(path)
    database = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)
    began = monotonic()
    try:
        for pragma in ("trusted_schema = OFF", "cell_size_check = ON", "mmap_size = 0"):
            database.execute(f"PRAGMA {pragma}")
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_BYTES)
        database.set_progress_handler(lambda: monotonic() > began + _SCHEMA_S, _STEPS_OF_SCHEMA)
        database.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone()
        check(database)
    except BaseException:
        database.close()
        raise
    left = [_STEPS_LEAST + _STEPS_BY_BYTE * size]

    def is_over() -> bool:
        left[0] -= _STEPS_AT_ONCE
        return left[0] < 0

    def authorize(
        action: int, _1: str | None, _2: str | None, _3: str | None, within: str | None
    ) -> int:
        is_plain = action in _ALLOWED and (views or within is None)
        return (
            sqlite3.SQLITE_OK
            if is_plain or (views and action == sqlite3.SQLITE_RECURSIVE)
            else sqlite3.SQLITE_DENY
        )

    database.set_progress_handler(is_over, _STEPS_AT_ONCE)
    database.set_authorizer(authorize)
    return database
