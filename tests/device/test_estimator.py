"""The live estimate beside the recording: in order, never in its way."""

import threading

from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.suspicion.notes import start_note
from logger.core.types import Fix, LiveEstimate, Note, Record, Scan
from logger.device import estimator
from logger.device.estimator import Estimator
from logger.device.link import Inbox
from tests.kit import runs
from tests.kit.service import LIMIT_S, assert_ends

S = 10**9


def walk(n):
    for t in range(n):
        yield 2 * t, Record(t * S, "gnss", Fix(True, None, 52.0, 13.0 + 2e-5 * t, hdop=1.0))
        yield 2 * t + 1, Record(t * S + 1, "modem", Scan(t * S, (runs.reading(1, -70.0 - t % 7),)))


def next_values(inbox):
    values = []
    while (record := inbox.get(0.0)) is not None:
        values.append(record.value)
    return [v for v in values if v != start_note()]


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
    assert inbox.get(0.0).value == start_note()  # which rules are applied
    assert next_values(inbox) == expected
    assert (
        beside.latest
        == [v for v in expected if isinstance(v, LiveEstimate) and v.stage == "locator"][-1]
    )


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


def test_a_bug_in_the_estimate_is_an_event_and_no_end():
    class Broken(LiveTracker):
        def feed(self, seq, record):
            raise ZeroDivisionError("oops")

    inbox = Inbox()
    beside = Estimator(lambda *_: Broken(LiveSettings()), inbox)
    beside.start()
    beside.give(*next(walk(1)))
    assert not beside.finish(LIMIT_S)
    (note,) = next_values(inbox)
    assert isinstance(note, Note)
    assert (note.code, note.text) == ("internal", "ZeroDivisionError: oops")
