"""The walk read from a journal that grows, without numpy."""

import math

import pytest

from logger.core.live_settings import MARK
from logger.core.runfile import RunWriter
from logger.core.types import Note, Record
from logger.device.status import Status, write_status
from logger.page.feed import MOST_CELLS, MOST_POINTS, TABLES, Feed, JournalTail, Walk
from tests.kit import service
from tests.kit.runs import meta, records, write_journal

FIRST = "262-01-4711-1"


def _walk(path, n=1):
    walk, tail = Walk(), JournalTail(path, TABLES)
    for _ in range(n):
        for table, row in tail.rows():
            walk.take(table, row)
    return walk, tail


def test_track_levels_and_marks_come_as_the_journal_grows(tmp_path):
    path = tmp_path / "run-000001.journal"
    writer, walk = RunWriter(path, meta()), Walk()
    tail = JournalTail(path, TABLES)
    stream = records(60)
    stream.insert(100, Record(stream[100].t_ns, "page", Note("info", MARK, "a door, Grüße")))
    counts = []
    for i, record in enumerate(stream):
        writer.append(record)
        if i % 25 == 24:
            writer.sync()
            for table, row in tail.rows():
                walk.take(table, row)
            counts.append(len(walk.track(FIRST)["levels"]))
    assert counts == sorted(counts)
    assert counts[-1] > 40
    found = walk.track(FIRST)
    assert found["points"][0] == (52.0, 13.0)
    # 60 s of 1.37 m, a point each 4 m
    assert 15 <= len(found["points"]) <= 21
    assert found["levels"][:2] == [(0, -60.0), (0, -61.0)]
    assert [text for _, _, text in found["marks"]] == ["a door, Grüße"]
    assert walk.n_marks == 1
    later = walk.track(FIRST, len(found["points"]), len(found["levels"]))
    assert (later["points"], later["levels"]) == ([], [])


def test_the_minute_is_a_minute(tmp_path):
    path = tmp_path / "run-000001.journal"
    write_journal(path, records(100), close=False)
    walk, _ = _walk(path, 10)
    minute = walk.minute(FIRST, 99 * 10**9 + 5)
    assert len(minute) == 60
    assert (minute[-1], walk.minute("another", 0)) == ((0.0, -60.0 - 99 % 7), [])


def test_a_journal_that_goes_on_in_another_file_is_followed(tmp_path):
    path = tmp_path / "run-000001.journal"
    write_journal(path, records(10), close=False)
    second = tmp_path / "elsewhere.journal"
    write_journal(second, records(20), close=False)
    second.rename(tmp_path / "run-000001.journal.2")
    walk, _ = _walk(path, 20)
    assert len(walk.track(FIRST)["levels"]) == 30


def test_damage_is_passed_over_and_a_missing_file_waited_for(tmp_path):
    path = tmp_path / "run-000001.journal"
    walk, tail = _walk(path, 3)
    write_journal(path, records(50), sync_every=10, close=False)
    data = bytearray(path.read_bytes())
    data[2000:2100] = b"\xff" * 100
    path.write_bytes(data)
    for _ in range(10):
        for table, row in tail.rows():
            walk.take(table, row)
    assert 20 < len(walk.track(FIRST)["levels"]) < 50


def test_memory_is_bounded():
    walk = Walk()
    for i in range(MOST_POINTS + 100):
        walk.take("fixes", {"t_ns": i, "valid": 1, "lat_deg": 52.0 + i * 1e-4, "lon_deg": 13.0})
    walk.take("fixes", {"t_ns": 0, "valid": 1, "lat_deg": math.nan, "lon_deg": 13.0})
    assert len(walk.track("")["points"]) == MOST_POINTS


def test_all_cells_of_a_walk_are_counted():
    # the list on the phone has only some of them
    walk, nothing = Walk(), dict.fromkeys(("rsrp_dbm", "rscp_dbm", "rssi_dbm"), math.nan)
    row = {"t_ns": 0, "rxlev_raw": -1, "identity_unsure": 0} | nothing
    for n in range(3 * MOST_CELLS):
        for _ in range(2):
            walk.take("readings", row | {"cell": b"262-01-4711-%d" % n})
    walk.take("readings", row | {"cell": b"262-01-4711-9999", "identity_unsure": 1})
    walk.take("readings", row | {"cell": b""})
    assert walk.n_cells == 3 * MOST_CELLS


@pytest.mark.parametrize("run", ["../../etc/passwd", "/etc/shadow", "x", ""])
def test_a_status_names_no_file_outside_the_runs(tmp_path, run):
    status = Status("recording", "", run, 1, 9, 0, 8, 3, 2, 1, 0, 10, None, {})
    write_status(tmp_path, status)
    feed = Feed(tmp_path, tmp_path / "runs")
    feed.look()
    assert b'"recording"' in feed.text
    assert feed.track(0, 0)["run"] == ""


def test_neither_numpy_nor_hdf5_is_imported():
    """The process of the page stays below 40 MB."""
    heavy = "{'numpy', 'h5py', 'pyproj'}"
    script = f"import sys, logger.page.server; print({heavy} & set(sys.modules))"
    assert service.run_python(script).strip() == "set()"
