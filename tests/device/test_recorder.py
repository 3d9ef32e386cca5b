import subprocess
import threading
import time

import pytest

from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.runfile import RunWriter, read_run
from logger.core.types import Fix, RawBytes, Record, Scan
from logger.device.clock import SystemClock
from logger.device.link import Inbox
from logger.device.recorder import Recorder
from tests.kit import runs, service


class Bench:
    """A recorder in its thread, without ports."""

    def __init__(self, folder, inbox=None):
        self.path = folder / "run-a.journal"
        self.inbox = inbox or Inbox()
        self.ended = threading.Event()
        writer = RunWriter(self.path, runs.meta())
        self.recorder = Recorder(writer, LiveTracker(LiveSettings()), self.inbox, SystemClock(), self.ended)
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
    assert run.end.n_records == max(int(rows["seq"].max()) for rows in run.tables.values() if len(rows)) + 1


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


def test_a_recorder_that_fails_says_so(tmp_path):
    bench = Bench(tmp_path)
    bench.inbox.put(Record(1, "gnss", Fix(True, sats_used=2**40)))  # no such number fits the table
    bench.thread.start()
    assert bench.ended.wait(10)
    bench.thread.join()
    assert isinstance(bench.recorder.error, OverflowError)


def test_a_full_card_is_waited_out_and_nothing_is_lost(tmp_path):
    """A real file system of 3 MB, full and then with room again."""
    card = tmp_path / "card"
    card.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", card], capture_output=True, check=False)
    if mounted.returncode:
        pytest.skip("no file system can be mounted here")
    try:
        filler = card / "filler"
        bench = Bench(card)
        filler.write_bytes(bytes(1_900_000))
        bench.thread.start()
        for i in range(30):
            bench.inbox.put(Record(i, "gnss", RawBytes(bytes([i]) * 100_000)))
        service.wait_for(lambda: bench.recorder.failing)
        time.sleep(1.5)
        filler.unlink()
        subprocess.run(["mount", "-o", "remount,size=20m", card], check=True)
        service.wait_for(lambda: not bench.recorder.failing)
        run = bench.finish()
        assert run.raw_bytes.tobytes() == b"".join(bytes([i]) * 100_000 for i in range(30))
        assert run.damage.missing_frames == run.damage.skipped_bytes == 0
        assert b"write-failed" in run.tables["notes"]["code"].tolist()
    finally:
        subprocess.run(["umount", card], check=False)
