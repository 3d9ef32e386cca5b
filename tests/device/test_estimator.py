"""The live estimate beside the recording: in order, never in its way."""

import threading

import pytest

from logger.config import parse_config
from logger.core.live import LiveTracker
from logger.core.live_settings import FAILED, RESTARTED, LiveSettings
from logger.core.runfile import read_run
from logger.core.suspicion.rules import rules_note
from logger.core.types import LiveEstimate, Note
from logger.device import estimator
from logger.device.clock import ScaledClock
from logger.device.estimator import Estimator
from logger.device.link import Inbox
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime
from postproc.replay import replay
from tests.kit import service
from tests.kit.live import next_values, walk
from tests.kit.recorded_runs import record_until
from tests.kit.service import LIMIT_S, assert_ends

S = 10**9


class Slow(LiveTracker):
    """A tracker on a processor that takes its time."""

    def __init__(self, settings):
        super().__init__(settings)
        self.go = threading.Event()

    def feed(self, seq, record):
        self.go.wait()
        return super().feed(seq, record)


def test_what_is_found_is_what_a_tracker_finds_in_that_order():
    inbox, alone = Inbox(), LiveTracker(LiveSettings())
    beside = Estimator.of(LiveSettings(), inbox)
    beside.start()
    expected = []
    for seq, record in walk(30):
        expected += alone.feed(seq, record)
        assert beside.give(seq, record)
    assert beside.finish(LIMIT_S)
    assert inbox.get(0.0).value == rules_note()  # which rules are applied
    assert next_values(inbox) == expected
    last = [v for v in expected if isinstance(v, LiveEstimate) and v.stage == "locator"][-1]
    target = beside.view.target
    assert (target.cell, target.n) == (last.cell, last.n)
    assert target.probability == pytest.approx(last.probability, abs=1e-3)


def test_a_slow_processor_holds_nobody_up_and_is_told(monkeypatch):
    monkeypatch.setattr(estimator, "MOST_WAITING", 10)
    slow, taken = Slow(LiveSettings()), []
    beside = Estimator(lambda *_: slow, Inbox())
    beside.start()
    assert_ends(lambda: taken.extend(beside.give(seq, record) for seq, record in walk(30)))
    assert len(taken) == 60
    assert taken[0]
    assert not taken[-1]
    assert taken == sorted(
        taken, reverse=True
    )  # once behind, nothing more: the desk needs a beginning without holes
    assert not beside.finish(0.1)
    slow.go.set()


def test_an_estimate_that_is_late_ends_with_the_recording():
    # what is left would take the processor from the making of the HDF5 file
    slow, inbox = Slow(LiveSettings()), Inbox()
    beside = Estimator(lambda *_: slow, inbox)
    beside.start()
    for seq, record in walk(30):
        assert beside.give(seq, record)
    assert not beside.finish(0.1)
    slow.go.set()
    service.wait_for(lambda: not [one for one in threading.enumerate() if one.name == "estimate"])
    assert len([v for v in next_values(inbox) if isinstance(v, LiveEstimate)]) <= 1


class Failing(LiveTracker):
    """A tracker that fails where `fails` says so, by the number of a record."""

    def __init__(self, fails, error):
        super().__init__(LiveSettings())
        self._fails, self._error = fails, error

    def feed(self, seq, record):
        if self._fails(seq):
            raise self._error
        return super().feed(seq, record)


def _notes(values, code):
    return [v for v in values if isinstance(v, Note) and v.code == code]


@pytest.mark.parametrize(
    "error", [ZeroDivisionError("52.1234 13.9876"), MemoryError(), RecursionError("52.1234")]
)
def test_after_an_exception_the_estimate_begins_anew_and_says_so(error, caplog):
    inbox, alone = Inbox(), LiveTracker(LiveSettings())
    beside = Estimator(lambda *_: Failing(lambda seq: seq == 21, error), inbox)
    beside.start()
    for seq, record in walk(11):
        assert beside.give(seq, record)
    service.wait_for(lambda: beside.view.no_estimate)
    view = beside.view
    assert type(error).__name__ in view.no_estimate
    assert (view.target, view.position, view.next, view.suspicions) == (None, None, None, ())
    expected = [v for seq, record in list(walk(11))[:21] for v in alone.feed(seq, record)]
    for seq, record in list(walk(50))[22:]:
        assert beside.give(seq, record)
    assert beside.finish(LIMIT_S)
    assert beside.view.no_estimate == ""
    assert beside.view.target.n
    values = next_values(inbox)
    ((failed,), (restarted,)) = (_notes(values, code) for code in (FAILED, RESTARTED))
    assert failed.text.startswith(f"record 21: {type(error).__name__} (")
    # 10 s after the record that failed
    assert restarted.text.startswith("record 41:")
    anew = LiveTracker(LiveSettings())
    expected += [failed, restarted]
    expected += [v for seq, record in list(walk(50))[41:] for v in anew.feed(seq, record)]
    assert values == expected
    assert "52.1234" not in caplog.text + failed.text


def test_what_fails_at_each_record_is_tried_ever_more_seldom():
    inbox = Inbox()
    beside = Estimator(lambda *_: Failing(lambda _: True, ValueError()), inbox)
    beside.start()
    for seq, record in walk(2000):
        assert beside.give(seq, record)
    assert beside.finish(LIMIT_S)
    values = next_values(inbox)
    # after 10, 20, 40, ... 600 s
    assert len(_notes(values, FAILED)) == 9
    assert "600 s" in beside.view.no_estimate


def test_a_tracker_that_cannot_be_made_is_tried_again():
    inbox, tries = Inbox(), []

    def make(*_):
        tries.append(0)
        if len(tries) < 3:
            raise ImportError("numpy")
        return LiveTracker(LiveSettings())

    beside = Estimator(make, inbox)
    beside.start()
    for seq, record in walk(30):
        assert beside.give(seq, record)
    assert beside.finish(LIMIT_S)
    assert len(tries) == 3
    assert beside.view.target.n
    assert beside.view.no_estimate == ""


def test_a_walk_with_failures_is_recorded_whole_and_replayed(tmp_path, monkeypatch):
    """Recorded by the real service; what the walker follows stays followed."""
    feed, seen = LiveTracker.feed, []

    def failing(tracker, seq, record):
        seen.append(seq)
        if len(seen) in {200, 300}:
            raise MemoryError
        return feed(tracker, seq, record)

    fail, trouble = Estimator._fail, []

    def fail_and_note(beside, *args):
        fail(beside, *args)
        trouble.append(beside.view.no_estimate)

    speed = 20.0
    scene, clock = scenario("block", 1, 600.0), ScaledClock(speed)
    time = WalkTime(clock)
    sessions = answering(scene.modem(time.now_s)), talking(scene.receiver(), time)
    with PtyDevice(sessions[0]) as modem, PtyDevice(sessions[1]) as gnss:
        text = (
            f'[run]\ndirectory = "{tmp_path}"\n[modem]\nport = "{modem.path}"\n'
            f'poll_interval_s = 1.0\n[gnss]\nport = "{gnss.path}"\n'
            f"[live]\nmax_fix_age_s = {3.0 + 0.1 * speed}\n"
        )
        config = parse_config(text, "site.toml")
        under_way = Service(config, begin_run(config, text, clock), clock, threading.Event())
        with monkeypatch.context() as patched:
            patched.setattr(LiveTracker, "feed", failing)
            patched.setattr(Estimator, "_fail", fail_and_note)
            under_way.start()
            record_until(under_way, clock, lambda _: len(seen) > 450)
            run = read_run(under_way.stop("end of the test"))
    assert [text.split(" (")[0] for text in trouble] == ["no live estimate: MemoryError"] * 2
    notes = [record.value for _, record in run.records("notes")]
    assert [len(_notes(notes, code)) for code in (FAILED, RESTARTED)] == [2, 2]
    last = int(_notes(notes, RESTARTED)[-1].text.split()[1].strip(":"))
    assert any(record.value.scan_seq > last for _, record in run.records("live"))
    assert replay(run).equal


def test_position_and_next_way_are_in_degrees():
    beside = Estimator.of(LiveSettings(), Inbox())
    beside.start()
    for seq, record in walk(60):
        assert beside.give(seq, record)
    assert beside.finish(LIMIT_S)
    position, advice = beside.view.position, beside.view.next
    assert position.cell == "262-01-4711-1"
    assert abs(position.lat - 52.0) < 0.05
    assert position.r95_m > 0.0
    assert position.strongest.level_dbm == -70.0
    assert position.word == "nothing unusual"
    assert sum(mode.probability for mode in position.modes) <= 1.001
    rings = [polygon[0] for polygon in position.region.coordinates]
    assert all(len(ring) == 5 and ring[0] == ring[-1] for ring in rings)
    assert all(
        abs(lon - 13.0) < 1.0 and abs(lat - 52.0) < 1.0 for ring in rings for lon, lat in ring
    )
    assert 0.0 <= advice.azimuth_deg < 360.0
    assert advice.text


def test_a_street_file_is_an_event(tmp_path):
    path = tmp_path / "streets.geojson"
    path.write_text('{"type": "LineString", "coordinates": [[13.0, 51.99], [13.0, 52.01]]}')
    for name, code in ((path, "streets"), (tmp_path / "none", "streets-unreadable")):
        inbox = Inbox()
        beside = Estimator.of(LiveSettings(streets=str(name)), inbox)
        beside.start()
        for seq, record in walk(2):
            assert beside.give(seq, record)
        assert beside.finish(LIMIT_S)
        notes = [value for value in next_values(inbox) if isinstance(value, Note)]
        assert notes[0].code == code
        assert beside.view.left_out == (() if code == "streets" else (notes[0].text,))
        assert str(name) in notes[0].text
