"""The baseline on the device: read only, and no error stops the recording."""

import sqlite3
from contextlib import closing

import pytest

from logger.baseline_file import BaselineFile
from logger.baseline_store import BaselineStore, summarise_walk
from logger.core.baseline import square_of
from logger.core.live_settings import LiveSettings
from logger.core.runfile import read_sound_run
from logger.core.types import Note
from logger.device.estimator import Estimator
from logger.device.link import Inbox
from logger.device.live_files import READ, UNREADABLE, LiveFiles
from tests.kit.live import next_values, walk
from tests.kit.service import LIMIT_S
from tests.postproc.baseline.walks import name, two_cells, write_walk


@pytest.fixture
def baseline_file(tmp_path):
    path = tmp_path / "baseline.db"
    run = write_walk(tmp_path, 1, two_cells())
    with BaselineStore(path, create=True) as store:
        store.add(summarise_walk(read_sound_run(run)))
        store.trust(name(1), "my femtocell")
    return path


def notes_of(baseline: str):
    inbox = Inbox()
    estimator = Estimator.of(LiveSettings(baseline=baseline), inbox)
    estimator.start()
    for seq, record in walk(5):
        estimator.give(seq, record)
    assert estimator.finish(LIMIT_S)
    values = next_values(inbox)
    codes = (READ, UNREADABLE)
    notes = [value for value in values if isinstance(value, Note) and value.code in codes]
    return notes, [value for value in values if value not in notes]


@pytest.fixture
def baseline(baseline_file):
    with closing(LiveFiles(LiveSettings(baseline=str(baseline_file)))) as baseline:
        yield baseline


def test_a_baseline_is_an_event_with_its_fingerprint(baseline, baseline_file):
    notes, _ = notes_of(str(baseline_file))
    assert [note.code for note in notes] == [READ]
    assert baseline.fingerprint in notes[0].text
    assert baseline.n_walks == 1
    assert name(1) in baseline.square(square_of(52.5, 13.4)).cells
    assert baseline.trust_note(name(1)) == "my femtocell"


def test_without_a_baseline_there_is_no_event():
    assert notes_of("")[0] == []


@pytest.mark.parametrize("content", [None, b"", b"x" * 9000])
def test_a_file_that_cannot_be_read_is_one_event(tmp_path, content):
    path = tmp_path / "bad.db"
    if content is not None:
        path.write_bytes(content)
    notes, estimates = notes_of(str(path))
    assert [(note.level, note.code) for note in notes] == [("warning", UNREADABLE)]
    assert str(path) in notes[0].text
    assert estimates == notes_of("")[1]


def test_a_file_damaged_during_the_walk_is_one_event(baseline, baseline_file):
    baseline.take_notes()
    content = bytearray(baseline_file.read_bytes())
    content[4096:] = b"\xff" * (len(content) - 4096)
    baseline_file.write_bytes(content)
    for k in range(20):
        assert not baseline.square(square_of(52.5 + 0.001 * k, 13.4)).cells
        assert baseline.cell(name(k)) is None
    assert [note.code for note in baseline.take_notes()] == [UNREADABLE]
    assert baseline.n_walks == 0
    assert baseline.fingerprint == ""


@pytest.mark.parametrize("note", ["x" * 1_000_000, "x" * 100])
def test_a_file_that_takes_too_much_memory_is_one_event(tmp_path, note):
    path = tmp_path / "large.db"
    with BaselineStore(path, create=True):
        pass
    with closing(sqlite3.connect(path)) as database, database:
        rows = ((f"cell {k}", note) for k in range(20_000_000 // len(note)))
        database.executemany("INSERT INTO trust (cell, note) VALUES (?, ?)", rows)
    baseline = LiveFiles(LiveSettings(baseline=str(path)))
    assert [note.code for note in baseline.take_notes()] == [UNREADABLE]
    assert baseline.trust_note("cell 1") is None


def test_any_error_is_one_event(baseline, monkeypatch):
    baseline.take_notes()

    def failing(*_):
        raise MemoryError

    monkeypatch.setattr(BaselineFile, "ask", failing)
    assert baseline.cell(name(1)) is None
    assert [note.code for note in baseline.take_notes()] == [UNREADABLE]


def test_a_bad_page_is_one_line_in_the_log(tmp_path, caplog):
    LiveFiles(LiveSettings(baseline=str(tmp_path / "missing.db")))
    assert len(caplog.records) == 1
    assert "nothing is known of earlier walks" in caplog.text
