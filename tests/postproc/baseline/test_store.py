"""Walks in a baseline: sums, removal, trust, and what a kill leaves."""

import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from logger.baseline_file import BaselineFile
from logger.baseline_store import BaselineStore, summarise_walk
from logger.core.baseline import square_of
from logger.core.errors import ConfigError, RunFileError
from logger.core.runfile import read_sound_run
from postproc.baseline import add_runs
from tests.postproc.baseline.walks import STEP_DEG, cell, name, two_cells, write_walk

SUMS = ("square_cell", "square_rat", "cell_channel")


def contents(path):
    """Everything that lookups use, without the numbers of walks and cells."""
    with closing(sqlite3.connect(path)) as db:
        cells = db.execute("SELECT name, rat, n_walks, n_scans FROM cell ORDER BY name").fetchall()
        by_cell = "SELECT name, t.* FROM square_cell t JOIN cell ON id = cell ORDER BY name, square"
        squares = [row[:2] + row[3:] for row in db.execute(by_cell)]
        rats = db.execute("SELECT * FROM square_rat ORDER BY 1, 2").fetchall()
        channels = db.execute(
            "SELECT name, channel, code FROM cell_channel JOIN cell ON id = cell ORDER BY 1, 2, 3"
        ).fetchall()
        digests = db.execute("SELECT digest FROM walk ORDER BY digest").fetchall()
    return cells, squares, rats, channels, digests


@pytest.fixture(scope="module")
def summaries(tmp_path_factory):
    """Six walks that overlap: each begins 20 scans farther north and hears cells of its own."""
    folder = tmp_path_factory.mktemp("walks")

    def readings_of(number):
        def readings_at(k):
            yield cell(1, -60.0 - number - k % 5)
            yield cell(100 + number // 2, -75.0 + 0.25 * (k % 3), channel=30 + number)
            if k % 2:
                yield cell(7, -90.0, lac=800 + number, rssi_dbm=-90.0 + number)

        return readings_at

    paths = [
        write_walk(folder, n, readings_of(n), lat_deg=52.5 + 20 * n * STEP_DEG) for n in range(6)
    ]
    return [summarise_walk(read_sound_run(path)) for path in paths]


@pytest.fixture
def store(tmp_path):
    with BaselineStore(tmp_path / "baseline.db", create=True) as store:
        yield store


def test_a_walk_is_summed_by_square(tmp_path):
    levels = [-60.0 - k % 7 for k in range(120)]
    summary = summarise_walk(read_sound_run(write_walk(tmp_path, 1, two_cells())))
    squares = [square_of(52.5 + k * STEP_DEG, 13.4) for k in range(120)]
    assert summary.n_readings == 240
    assert summary.n_squares == len(set(squares)) >= 3
    assert summary.cells == {name(1): "GSM", name(2): "GSM"}
    assert summary.channels == [(name(1), 20, 9), (name(2), 25, 9)]
    for square in set(squares):
        of_one = [row for row in summary.heard if row.square == square and row.cell == name(1)]
        here = np.array([level for level, s in zip(levels, squares, strict=True) if s == square])
        assert len(of_one) == 1
        row = of_one[0]
        # a scan ends 0.1 s after its fix: one at a border may be on the other side
        assert abs(row.n_scans - len(here)) <= 1
        assert row.best_dbm == here.max()
        assert row.sum_level / row.n_scans / 100 == pytest.approx(here.mean(), abs=0.2)


def test_of_two_readings_in_a_scan_the_stronger_counts_once(tmp_path):
    path = write_walk(tmp_path, 1, lambda _: (cell(1, -80.0), cell(1, -70.0)), n=20)
    summary = summarise_walk(read_sound_run(path))
    assert [(row.n_scans, row.best_dbm, row.sum_level) for row in summary.heard] == [
        (20, -70.0, -140_000)
    ]


def test_a_doubtful_name_is_no_cell(tmp_path):
    path = write_walk(
        tmp_path, 1, lambda _: (cell(1, -70.0), cell(5, -70.0, identity_unsure=True)), n=20
    )
    assert list(summarise_walk(read_sound_run(path)).cells) == [name(1)]


def test_a_journal_and_its_hdf5_file_are_one_walk(tmp_path, store):
    run = write_walk(tmp_path, 1, two_cells())
    journal = run.with_suffix(".journal")
    assert store.add(summarise_walk(read_sound_run(run))) == 1
    assert store.add(summarise_walk(read_sound_run(journal))) is None
    assert len(store.walks()) == 1


def test_a_state_of_a_run_that_may_be_a_part_is_refused(tmp_path, store):
    short, long = tmp_path / "short", tmp_path / "long"
    short.mkdir()
    long.mkdir()
    cut = summarise_walk(read_sound_run(write_walk(short, 1, two_cells(), n=50, finish=False)))
    complete = summarise_walk(read_sound_run(write_walk(long, 1, two_cells())))
    assert store.add(complete) == 1
    with pytest.raises(RunFileError, match="another state of walk 1; `.* remove 1 -b .*db` it"):
        store.add(cut)
    store.remove([1])
    assert store.add(cut) is not None


def test_a_baseline_of_an_earlier_version(tmp_path):
    """It has no seals, no marks, and digests of contents: its walks are known, other states are
    refused."""
    path = tmp_path / "baseline.db"
    run = write_walk(tmp_path, 1, two_cells())
    walk = summarise_walk(read_sound_run(run))
    with BaselineStore(path, create=True) as store:
        store.add(replace(walk, digest=walk.content))
    with closing(sqlite3.connect(path)) as db:
        db.execute("ALTER TABLE walk DROP COLUMN seal")
        db.execute("DROP TABLE mark")
    with BaselineStore(path) as store:
        assert store.add(walk) is None
        with pytest.raises(RunFileError, match="another state of walk 1"):
            store.add(replace(walk, digest="f" * 64, content="e" * 64))
        assert store.add(replace(walk, digest="f" * 64, content="e" * 64, run_id="other")) == 2
        assert len(store.walks()) == 2


def test_the_order_of_the_walks_does_not_matter(tmp_path, summaries):
    paths = [tmp_path / "a.db", tmp_path / "b.db"]
    for path, order in zip(paths, (summaries, summaries[::-1]), strict=True):
        with BaselineStore(path, create=True) as store:
            for summary in order:
                store.add(summary)
    assert contents(paths[0]) == contents(paths[1])
    with closing(BaselineFile(paths[0])) as first, closing(BaselineFile(paths[1])) as second:
        assert first.fingerprint == second.fingerprint
        for walk in summaries:
            for row in walk.heard:
                assert first.square(row.square) == second.square(row.square)


def test_a_removed_walk_leaves_nothing(tmp_path, summaries):
    paths = [tmp_path / "a.db", tmp_path / "b.db"]
    with BaselineStore(paths[0], create=True) as store:
        for summary in summaries:
            store.add(summary)
        numbers = {walk.digest: walk.id for walk in store.walks()}
        store.remove([numbers[summaries[i].digest] for i in (0, 3)])
    with BaselineStore(paths[1], create=True) as store:
        for i in (1, 2, 4, 5):
            store.add(summaries[i])
    assert contents(paths[0]) == contents(paths[1])


def test_trust_survives_walks(tmp_path, summaries):
    path = tmp_path / "baseline.db"
    with BaselineStore(path, create=True) as store:
        store.add(summaries[0])
        store.trust(name(1), "my femtocell")
        store.trust("262-01-9-9", "never heard")
        store.remove([1])
        for summary in summaries:
            store.add(summary)
    with closing(BaselineFile(path)) as baseline:
        assert baseline.trust_note(name(1)) == "my femtocell"
        assert baseline.trust_note("262-01-9-9") == "never heard"
    with BaselineStore(path) as store:
        assert store.distrust(name(1))
        assert not store.distrust(name(1))
        assert list(store.trusted_cells()) == ["262-01-9-9"]


@pytest.mark.parametrize("note", ["", "  ", "two\nlines", "x" * 201])
def test_a_note_is_one_line(store, note):
    with pytest.raises(ConfigError, match="note"):
        store.trust(name(1), note)


def test_a_walk_is_named_by_number_or_digest(store, summaries):
    for summary in summaries:
        store.add(summary)
    second = store.walks()[1]
    assert store.walk_of("2") == second
    assert store.walk_of(second.digest[:8].upper()) == second
    for wrong in ("99", second.digest[:3], "", "zzzzzzzz"):
        with pytest.raises(ConfigError, match="no walk"):
            store.walk_of(wrong)


def test_two_programs_change_a_baseline_one_after_the_other(tmp_path, summaries, monkeypatch):
    path = tmp_path / "baseline.db"
    monkeypatch.setattr("logger.baseline_store._PATIENCE_S", 0.1)
    with BaselineStore(path, create=True) as store, closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(RunFileError, match="another program"):
            store.add(summaries[0])
        other.rollback()
        assert store.add(summaries[0]) == 1


@pytest.mark.parametrize("content", [b"x" * 5000, b"SQLite format 3\0" + b"\1" * 5000])
def test_what_is_no_baseline_is_not_touched(tmp_path, content):
    path = tmp_path / "baseline.db"
    path.write_bytes(content)
    with pytest.raises(RunFileError):
        BaselineStore(path, create=True)
    assert path.read_bytes() == content


def test_another_database_is_not_touched(tmp_path):
    path = tmp_path / "other.db"
    with closing(sqlite3.connect(path)) as db:
        db.execute("CREATE TABLE mine (a)")
    with pytest.raises(RunFileError, match="no baseline"):
        BaselineStore(path, create=True)


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
