"""Runs are removed only where the user asked for it, the oldest first."""

import fcntl

import pytest

from logger.core.runfile import free_bytes, remove_oldest_runs, retention

FULL = 1 << 62
"""A floor that no card reaches."""


FILES = (
    "cells.db",
    "run-000001.h5",
    "run-000001.journal",
    "run-000001.post.h5",
    "run-000002.journal",
    "run-000002.journal.2",
    "run-000003.journal",
    "run-notes.txt",
)


@pytest.fixture
def folder(tmp_path):
    for name in FILES:
        (tmp_path / name).write_bytes(b"x")
    return tmp_path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_nothing_is_removed_unless_it_is_wanted(folder):
    assert list(remove_oldest_runs(folder, FULL, is_wanted=False)) == []
    assert list(remove_oldest_runs(folder, 0, is_wanted=True)) == []
    assert names(folder) == list(FILES)


def test_the_oldest_go_first_and_the_newest_stays(folder):
    removed = remove_oldest_runs(folder, FULL, is_wanted=True)
    assert next(removed) == "run-000001"
    assert "run-000002.journal" in names(folder)
    assert list(removed) == ["run-000002"]
    assert names(folder) == ["cells.db", "run-000003.journal", "run-notes.txt"]


def test_the_millionth_run_is_newer_than_those_before(folder):
    for name in ("run-999999.h5", "run-1000000.journal"):
        (folder / name).write_bytes(b"x")
    removed = list(remove_oldest_runs(folder, FULL, is_wanted=True))
    assert removed[-2:] == ["run-000003", "run-999999"]


def test_a_run_that_is_recorded_stays(folder):
    with (folder / "run-000001.journal").open("rb") as journal:
        fcntl.flock(journal, fcntl.LOCK_EX)
        assert list(remove_oldest_runs(folder, FULL, is_wanted=True)) == ["run-000002"]
    assert "run-000001.h5" in names(folder)


def test_a_run_of_another_user_stays_and_keeps_no_other(folder, monkeypatch):
    def is_recording(path):
        if path.name.startswith("run-000001"):
            raise PermissionError(path)
        return False

    monkeypatch.setattr(retention, "is_recording", is_recording)
    assert list(remove_oldest_runs(folder, FULL, is_wanted=True)) == ["run-000002"]
    assert "run-000001.h5" in names(folder)


def test_it_ends_when_enough_is_free(folder):
    (folder / "run-000001.h5").write_bytes(b"x" * 5_000_000)
    floor = free_bytes(folder) + 1_000_000
    assert list(remove_oldest_runs(folder, floor, is_wanted=True))[:1] == ["run-000001"]
