"""Runs added together: a bad one spoils no other."""

import pytest

from postproc.baseline.store import BaselineStore, add_runs
from tests.postproc.baseline.walks import two_cells, write_walk


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    return [write_walk(folder, n, two_cells(-50.0 - n), n=20) for n in range(7)]


def add_walks(tmp_path, paths):
    with BaselineStore(tmp_path / "baseline.db", create=True) as store:
        return list(add_runs(store, paths))


@pytest.mark.parametrize("at", [0, 3, 6])
def test_a_bad_file_spoils_no_other(tmp_path, runs, at):
    bad = tmp_path / "bad.h5"
    content = bytearray(runs[0].read_bytes())
    content[2000:6000] = b"\xff" * 4000
    bad.write_bytes(content)
    results = add_walks(tmp_path, [*runs[:at], bad, *runs[at:]])
    assert [bool(result.problem) for result in results] == [k == at for k in range(8)]
    assert "bad.h5" in results[at].problem
    assert [result.path for result in results if result.walk] == runs


def test_journals_and_runs_are_added_in_their_order(tmp_path, runs):
    paths = [runs[0], runs[1].with_suffix(".journal"), runs[2]]
    assert [result.walk for result in add_walks(tmp_path, paths)] == [1, 2, 3]
