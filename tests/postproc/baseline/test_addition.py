"""Runs added together: small files are read by one process, and a bad one spoils no other."""

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_small_runs
from postproc import read_ahead
from postproc.baseline.addition import add_runs
from postproc.baseline.store import BaselineStore
from tests.postproc.baseline.walks import two_cells, write_walk


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    return [write_walk(folder, n, two_cells(-50.0 - n), n=20) for n in range(7)]


def add_walks(tmp_path, paths):
    with BaselineStore(tmp_path / "baseline.db", create=True) as store:
        return list(add_runs(store, paths))


def test_small_files_are_read_by_few_processes(tmp_path, runs, monkeypatch):
    groups = []

    def read(paths):
        groups.append(len(paths))
        return read_small_runs(paths)

    monkeypatch.setattr(read_ahead, "read_small_runs", read)
    monkeypatch.setattr(read_ahead, "_TOGETHER", 3)
    monkeypatch.setattr(
        read_ahead, "read_unaltered_run", lambda path: pytest.fail(f"{path} read alone")
    )
    results = add_walks(tmp_path, runs[:6])
    assert sorted(groups) == [3, 3]
    assert [result.walk for result in results] == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("at", [0, 3, 6])
def test_a_bad_file_spoils_no_other(tmp_path, runs, at):
    bad = tmp_path / "bad.h5"
    content = bytearray(runs[0].read_bytes())
    content[2000:6000] = b"\xff" * 4000
    bad.write_bytes(content)
    with pytest.raises(RunFileError):
        read_small_runs([bad, runs[0]])
    results = add_walks(tmp_path, [*runs[:at], bad, *runs[at:]])
    assert [bool(result.problem) for result in results] == [k == at for k in range(8)]
    assert "bad.h5" in results[at].problem
    assert [result.path for result in results if result.walk] == runs


def test_journals_and_large_files_are_read_alone(tmp_path, runs, monkeypatch):
    monkeypatch.setattr(read_ahead, "_SMALL_BYTES", 0)
    monkeypatch.setattr(read_ahead, "read_small_runs", lambda _: pytest.fail("read together"))
    paths = [runs[0], runs[1].with_suffix(".journal"), runs[2]]
    assert [result.walk for result in add_walks(tmp_path, paths)] == [1, 2, 3]
