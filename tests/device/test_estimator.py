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


def test_position_and_next_way_are_in_degrees():
    beside = Estimator.of(LiveSettings(), Inbox())
    beside.start()
    for seq, record in walk(60):
        assert beside.give(seq, record)
    assert beside.finish(LIMIT_S)
    position, advice = beside.position, beside.next_way
    assert position.cell == "262-01-4711-1"
    assert abs(position.lat - 52.0) < 0.05
    assert position.r95_m > 0.0
    assert position.strongest.level_dbm == -70.0
    assert sum(mode.probability for mode in position.modes) <= 1.001
    rings = [polygon[0] for polygon in position.region["coordinates"]]
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
        assert str(name) in notes[0].text
