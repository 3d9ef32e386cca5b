"""A baseline read from its file: what it answers, and what becomes of damaged files."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest

from logger.baseline_file import BaselineFile
from logger.baseline_store import BaselineStore, summarise_walk
from logger.core.baseline import best_dbm, square_of, squares_around
from logger.core.errors import RunFileError
from logger.core.runfile import read_sound_run
from tests.postproc.baseline.walks import cell, name, write_walk

LAT_DEG, LON_DEG = 52.5, 13.4


@pytest.fixture(scope="module")
def stored_file(tmp_path_factory):
    """Three walks over the same ground."""
    folder = tmp_path_factory.mktemp("walks")
    path = folder / "baseline.db"

    def readings_of(number):
        def readings_at(k):
            yield cell(1, -60.0 - 10.0 * number)
            yield cell(2, -80.0 + k % 2, channel=30 + number)
            if number == 2:
                yield cell(1, -90.0, lac=802)
            if number == 1 and k == 3:
                yield cell(66, -95.0)

        return readings_at

    with BaselineStore(path, create=True) as store:
        for number in range(3):
            run = write_walk(folder, number, readings_of(number), lat_deg=LAT_DEG, lon_deg=LON_DEG)
            store.add(summarise_walk(read_sound_run(run)))
    return path


@pytest.fixture
def baseline(stored_file):
    baseline = BaselineFile(stored_file)
    yield baseline
    baseline.close()


def test_a_square_has_its_walks_and_cells(baseline):
    here = baseline.square(square_of(LAT_DEG, LON_DEG))
    assert dict(here.n_walks) == {"GSM": 3}
    first = here.cells[name(1)]
    assert (first.n_walks, first.best_dbm, first.least_best_dbm) == (3, -60.0, -80.0)
    assert first.mean_dbm == pytest.approx(-70.0)
    assert first.sigma_db == pytest.approx(np.std([-60.0, -70.0, -80.0]))
    assert here.cells[name(2)].n_scans == first.n_scans
    assert here.cells[name(1, 802)].n_walks == 1


def test_ground_that_nobody_walked_is_empty(baseline):
    nowhere = baseline.square(square_of(10.0, 10.0))
    assert not nowhere.cells
    assert not nowhere.n_walks


def test_a_cell_named_by_one_scan_is_unknown(baseline):
    assert baseline.cell(name(66)) is None
    assert name(66) not in baseline.square(square_of(LAT_DEG, LON_DEG)).cells
    assert 20 in baseline.channels("262", "01", "GSM")


def test_a_cell_has_its_channels_and_its_strongest_level(baseline):
    second = baseline.cell(name(2))
    assert second is not None
    assert (second.rat, second.n_walks, second.best_dbm) == ("GSM", 3, -79.0)
    assert second.channels == {(30, 9), (31, 9), (32, 9)}
    assert second.n_squares >= 3
    assert baseline.cell(name(3)) is None


def test_channels_of_an_operator(baseline):
    assert dict(baseline.channels("262", "01", "GSM")) == {20: 2, 30: 1, 31: 1, 32: 1}
    assert not baseline.channels("262", "02", "GSM")


def test_levels_around_a_position(baseline):
    around = squares_around(baseline, LAT_DEG, LON_DEG, 150.0)
    assert best_dbm(around, name(1)) == -60.0
    assert best_dbm(around, name(3)) is None


def test_an_answer_is_the_same_when_it_is_asked_again(baseline):
    squares = [square_of(LAT_DEG + 0.001 * k, LON_DEG) for k in range(600)]
    first = [baseline.square(square) for square in squares]
    assert [baseline.square(square) for square in squares] == first
    assert any(square.cells for square in first)


def test_the_file_is_not_changed(stored_file, baseline):
    before = stored_file.read_bytes()
    with pytest.raises(sqlite3.Error):
        baseline._db.execute("DELETE FROM walk")
    baseline.square(square_of(LAT_DEG, LON_DEG))
    assert stored_file.read_bytes() == before
    assert sorted(path.name for path in stored_file.parent.glob("baseline*")) == ["baseline.db"]


def test_a_file_that_cannot_be_read_is_one_line(tmp_path, stored_file):
    (tmp_path / "empty.db").touch()
    (tmp_path / "text.db").write_text("no database " * 1000)
    (tmp_path / "short.db").write_bytes(stored_file.read_bytes()[:5000])
    with closing(sqlite3.connect(tmp_path / "other.db")) as db:
        db.execute("CREATE TABLE walk (a)")
    with closing(sqlite3.connect(tmp_path / "later.db")) as db:
        db.executescript("PRAGMA application_id = 0x43574241; PRAGMA user_version = 99")
    with closing(sqlite3.connect(tmp_path / "hollow.db")) as db:
        db.executescript("PRAGMA application_id = 0x43574241; PRAGMA user_version = 1")
    names = ("missing", "empty", "text", "short", "other", "later", "hollow")
    for path in (*(tmp_path / f"{n}.db" for n in names), tmp_path):
        with pytest.raises(RunFileError) as error:
            BaselineFile(path)
        assert str(path) in str(error.value)
        assert "\n" not in str(error.value)


def test_any_damage_is_an_error_or_an_answer(tmp_path, stored_file):
    """Bytes changed anywhere: no other exception, and no endless query."""
    whole, random = stored_file.read_bytes(), np.random.default_rng(8)
    square, n_errors = square_of(LAT_DEG, LON_DEG), 0
    for _ in range(150):
        content = bytearray(whole)
        for place in random.integers(100, len(content), 40):
            content[place] = random.integers(256)
        path = tmp_path / "damaged.db"
        path.write_bytes(content)
        try:
            with closing(BaselineFile(path)) as baseline:
                baseline.square(square)
                baseline.cell(name(1))
                baseline.channels("262", "01", "GSM")
        except RunFileError:
            n_errors += 1
    assert n_errors > 30


def test_values_of_another_kind_are_damage(tmp_path, stored_file):
    path = tmp_path / "changed.db"
    path.write_bytes(stored_file.read_bytes())
    with closing(sqlite3.connect(path)) as db:
        db.execute("UPDATE square_cell SET n_scans = 0")
        db.commit()
    with (
        closing(BaselineFile(path)) as baseline,
        pytest.raises(RunFileError, match="cannot be read as a baseline"),
    ):
        baseline.square(square_of(LAT_DEG, LON_DEG))


def test_a_change_that_was_cut_is_named(tmp_path, stored_file):
    """As a kill leaves it: pages changed, and the journal with the old ones beside it."""
    path = tmp_path / "cut.db"
    path.write_bytes(stored_file.read_bytes())
    with closing(sqlite3.connect(path, isolation_level=None)) as db:
        db.executescript("PRAGMA cache_size = 1; PRAGMA cache_spill = 1; BEGIN")
        db.execute("UPDATE heard SET n_scans = n_scans + 1")
        db.execute("UPDATE square_cell SET n_scans = n_scans + 1")
        left = path.read_bytes(), path.with_name("cut.db-journal").read_bytes()
        db.execute("ROLLBACK")
    path.write_bytes(left[0])
    path.with_name("cut.db-journal").write_bytes(left[1])
    with pytest.raises(RunFileError, match="postproc baseline list"):
        BaselineFile(path)
    with BaselineStore(path) as store:
        assert len(store.walks()) == 3
    with closing(BaselineFile(path)) as one, closing(BaselineFile(stored_file)) as other:
        assert one.fingerprint == other.fingerprint
