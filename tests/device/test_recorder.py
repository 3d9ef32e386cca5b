import errno
import os
import threading

import pytest

from logger.core.live_settings import LiveSettings
from logger.core.runfile import RunWriter, finish_journal, journal, read_run, sealing_of
from logger.core.types import Fix, RawBytes, Record, Scan
from logger.device import recorder
from logger.device.clock import Clock
from logger.device.link import Inbox
from logger.device.recorder import Recorder
from tests.kit import runs, service


class Bench:
    """A recorder in its thread, without ports."""

    def __init__(self, folder, inbox=None, **more):
        self.path = folder / "run-a.journal"
        self.inbox = inbox or Inbox()
        self.ended = threading.Event()
        writer = RunWriter(self.path, runs.meta())
        self.recorder = Recorder(writer, LiveSettings(), self.inbox, Clock(), self.ended, **more)
        self.thread = threading.Thread(target=self.recorder.run)

    def finish(self):
        self.recorder.finish("test")
        self.thread.join()
        return read_run(self.path)


def test_everything_in_the_inbox_is_recorded_at_the_end(tmp_path):
    bench = Bench(tmp_path)
    for record in runs.records(200):
        bench.inbox.put(record)
    bench.thread.start()
    run = bench.finish()
    assert len(run.tables["fixes"]) == 200
    assert run.end.reason == "test"
    assert (
        run.end.n_records
        == max(int(rows["seq"].max()) for rows in run.tables.values() if len(rows)) + 1
    )


def test_a_scan_is_marked_with_the_fix_that_held(tmp_path):
    bench = Bench(tmp_path)
    scan = Scan(0, (runs.reading(1, -70.0),))
    for t_s, value in (
        (1, scan),
        (2, Fix(True, None, 52.0, 13.0)),
        (3, scan),
        (30, scan),
        (31, Fix(False)),
        (31, scan),
    ):
        bench.inbox.put(Record(t_s * 10**9, "x", value))
    bench.thread.start()
    assert bench.finish().tables["scans"]["fix_seq"].tolist() == [-1, 1, -1, -1]


def test_records_that_found_no_room_are_counted_in_the_run(tmp_path):
    bench = Bench(tmp_path, Inbox(10))
    for i in range(25):
        bench.inbox.put(Record(i, "gnss", RawBytes(b"x")))
    bench.thread.start()
    run = bench.finish()
    assert len(run.tables["raw"]) == 10
    (note,) = [row for row in run.tables["notes"] if row["code"] == b"overflow"]
    assert b"15 records lost" in note["text"]


@pytest.mark.parametrize(
    "fix", [Fix(True, sats_used=2**40), Fix(True, utc_ns=10**20), Fix(True, quality=10**400)]
)
def test_a_number_that_fits_into_no_column_costs_its_record_only(tmp_path, fix):
    bench = Bench(tmp_path)
    for value in (Fix(True, None, 52.0, 13.0), fix, Fix(True, None, 53.0, 13.0)):
        bench.inbox.put(Record(10**9, "gnss", value))
    bench.thread.start()
    run = bench.finish()
    assert run.tables["fixes"]["lat_deg"].tolist() == [52.0, 53.0]
    assert b"unrecordable" in run.tables["notes"]["code"].tolist()
    assert run.end.reason == "test"


def test_a_recorder_that_fails_says_so(tmp_path):
    bench = Bench(tmp_path)
    bench.inbox.put(Record(1, "gnss", object()))  # no record of ours
    bench.thread.start()
    assert bench.ended.wait(service.LIMIT_S)
    bench.thread.join()
    assert isinstance(bench.recorder.error, TypeError)


def test_a_card_that_is_read_only_to_the_end_is_one_line_with_advice(tmp_path, monkeypatch, caplog):
    def read_only(path):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(journal, "JournalFile", read_only)
    monkeypatch.setattr(recorder, "STOP_PATIENCE_TICKS", 0)
    bench = Bench(tmp_path)
    bench.recorder.finish("test")
    bench.thread.start()
    bench.thread.join()
    advice = f"Read-only file system: make {tmp_path} writable, or set another [run] directory"
    assert str(bench.recorder.error) == f"{advice}; what waited in memory is lost"
    assert [(one.getMessage(), one.exc_info) for one in caplog.records] == [
        (f"cannot write the run: {advice}; keeping records in memory", None)
    ]


def test_the_watchdog_is_told_of_every_flush_and_the_state_in_words(tmp_path):
    durable = []
    bench = Bench(tmp_path, durable=lambda: durable.append(bench.recorder.state))
    bench.thread.start()
    service.wait_for(lambda: len(durable) >= 2)
    run = bench.finish()
    assert set(durable) == {"recording"}
    assert sealing_of(run.path).holds


def test_below_the_floor_spare_journals_go_and_the_run_says_so(tmp_path):
    spare, last = tmp_path / "run-000001.journal", tmp_path / "run-000002.journal"
    for path in (spare, last):
        runs.write_journal(path, runs.records(5))
    finish_journal(spare)
    bench = Bench(tmp_path, floor_bytes=1 << 60)
    bench.thread.start()
    service.wait_for(lambda: not spare.exists())
    service.wait_for(lambda: bench.recorder.counts["Note"] >= 2)
    notes = {row["code"].decode(): row["text"].decode() for row in bench.finish().tables["notes"]}
    assert notes["journal-removed"].startswith("run-000001.journal")
    assert notes["card-nearly-full"] == "the card is nearly full"
    assert spare.with_suffix(".h5").exists()
    assert last.exists()
