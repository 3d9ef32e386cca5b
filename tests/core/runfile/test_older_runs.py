"""Runs of an older version are read, verified and replayed like runs of today.

`data/schema-3.journal` is a walk of 24 s that the version of schema 3 recorded, before what
cells broadcast had a table, and `data/schema-3.h5` is the HDF5 file that it made.
"""

from pathlib import Path

import h5py
import numpy as np
import pytest

from logger.core.errors import RunFileError
from logger.core.live import LiveTracker
from logger.core.runfile import convert_journal, read_run, sealing_of
from logger.core.runfile.hdf5 import RAW_BYTES
from logger.core.schema import columns_of
from logger.core.types import LiveEstimate, Scan
from postproc.cli import main
from postproc.replay import replay
from tests.kit import runs

DATA = Path(__file__).parent / "data"
FORMS = ["journal", "h5"]


@pytest.mark.parametrize("form", FORMS)
def test_an_older_run_has_its_records_and_all_tables(form):
    run = read_run(DATA / f"schema-3.{form}")
    assert (run.meta.schema, run.damage) == (3, type(run.damage)())
    records = [record for _, record in run.records()]
    assert [r for r in records if r.source != "live"] == runs.records(24)
    assert len(run.tables["broadcasts"]) == 0
    assert all(reading.broadcast is None for r in records for reading in _readings(r.value))


def _readings(value):
    return value.readings if isinstance(value, Scan) else ()


@pytest.mark.parametrize("form", FORMS)
def test_an_older_run_is_sealed(form, capsys):
    assert main(["info", "--verify", str(DATA / f"schema-3.{form}")]) == 0
    capsys.readouterr()


@pytest.mark.parametrize("form", FORMS)
def test_an_older_run_is_replayed_as_the_same_walk_recorded_today(form, tmp_path):
    """To the bit; what the device estimated then may differ, where the estimate has changed."""
    older = read_run(DATA / f"schema-3.{form}")
    assert (older.meta.live.antenna, older.meta.live.height_m) == ("omni", 5.0)
    runs.write_journal(tmp_path / "a.journal", runs.records(24), live=older.meta.live)
    today = read_run(tmp_path / "a.journal")
    assert replay_of(older) == replay_of(today)
    assert replay(older).n_recorded > 20
    assert replay(older).n_replayed == len(replay_of(today)) > 20


def replay_of(run):
    """What the live estimate of today says of a run, without the numbers of its records."""
    tracker = LiveTracker(run.meta.live)
    records = [record for _, record in run.records("fixes", "scans")]
    values = [value for seq, record in enumerate(records) for value in tracker.feed(seq, record)]
    return [value for value in values if isinstance(value, LiveEstimate)]


def test_an_older_journal_becomes_the_same_file_as_then(tmp_path):
    convert_journal(DATA / "schema-3.journal", tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as now, h5py.File(DATA / "schema-3.h5") as then:
        assert set(now) == set(then)
        for table in (*columns_of(3), RAW_BYTES, "frames"):
            assert now[table][...].tobytes() == then[table][...].tobytes()
            assert dict(now[table].attrs) == dict(then[table].attrs)


def test_a_table_that_its_version_did_not_have_was_added(tmp_path):
    path = tmp_path / "a.h5"
    path.write_bytes((DATA / "schema-3.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        file["broadcasts"] = [1, 2, 3]
    assert [line for line in sealing_of(path).differences if "broadcasts" in line] == [
        "broadcasts: it was added"
    ]
    assert len(read_run(path).tables["broadcasts"]) == 0


def test_a_file_of_a_version_without_frames_is_not_called_damaged(tmp_path):
    path = tmp_path / "a.h5"
    path.write_bytes((DATA / "schema-3.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        text = file["meta"][()]
        del file["meta"], file["frames"]
        file["meta"] = np.bytes_(text.replace(b'"schema":3', b'"schema":1'))
    with pytest.raises(RunFileError, match="has schema 1, which this cellwalk reads as a journal"):
        read_run(path)


@pytest.mark.parametrize(
    ("table", "today", "earlier"),
    [
        ("scans", "when the command was sent", "when the modem was asked"),
        ("live", "of this position; below 1 there are other possible positions",
         "of the place; below 1 there are others"),
        ("readings", "may be lost or doubled", "may be damaged"),
    ],
)  # fmt: skip
def test_columns_in_words_of_an_earlier_version_are_not_altered(table, today, earlier, tmp_path):
    path = tmp_path / "a.h5"
    path.write_bytes((DATA / "schema-3.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        text = file[table].attrs["columns"]
        file[table].attrs["columns"] = text.replace(today, earlier)
        assert file[table].attrs["columns"] != text
    assert not sealing_of(path).differences
