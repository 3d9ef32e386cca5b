"""SQLite files of strangers: plain tables are read, and nothing in them runs for ever or runs at
all.
"""

import sqlite3
from contextlib import closing

import pytest

from logger import sqlite_file
from logger.sqlite_file import open_database
from postproc.cli import main

ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS type FROM n"


@pytest.fixture
def stored_database(tmp_path):
    """Makes a database by some statements."""

    def make(*statements):
        path = tmp_path / "a b?#%.db"
        with closing(sqlite3.connect(path)) as database:
            for statement in statements:
                database.execute(statement)
            database.commit()
        return path

    return make


def test_tables_are_read_whatever_the_file_is_called(stored_database):
    path = stored_database("CREATE TABLE data (a, b)", "INSERT INTO data VALUES (1, 'x')")
    with open_database(path) as database:
        assert database.execute("SELECT a, b FROM data").fetchall() == [(1, "x")]
        assert [row[1] for row in database.execute("PRAGMA table_info(data)")] == ["a", "b"]


@pytest.mark.parametrize("view", ["SELECT 1 AS a", ENDLESS])
def test_a_view_is_no_table(stored_database, view):
    with (
        open_database(stored_database(f"CREATE VIEW data AS {view}")) as database,
        pytest.raises(sqlite3.DatabaseError),
    ):
        database.execute("SELECT * FROM data").fetchone()


@pytest.mark.parametrize(
    "statement", ["INSERT INTO data VALUES (2)", "DROP TABLE data", "ATTACH ':memory:' AS x"]
)
def test_nothing_is_written_and_nothing_else_opened(stored_database, statement):
    with (
        open_database(stored_database("CREATE TABLE data (a)")) as database,
        pytest.raises(sqlite3.Error),
    ):
        database.execute(statement)


def test_what_never_ends_is_ended_where_views_are_allowed(stored_database, monkeypatch):
    monkeypatch.setattr(sqlite_file, "_STEPS_LEAST", 3_000_000)
    path = stored_database(f"CREATE VIEW tiles AS {ENDLESS}")
    with (
        open_database(path, views=True) as database,
        pytest.raises(sqlite3.OperationalError, match="interrupted"),
    ):
        database.execute("SELECT count(*) FROM tiles").fetchone()


def test_an_import_of_an_endless_view_is_one_line(stored_database, tmp_path, capsys):
    path = stored_database("CREATE TABLE KISMET (db_version)", f"CREATE VIEW data AS {ENDLESS}")
    assert main(["import", str(path), "-o", str(tmp_path / "a.h5")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
