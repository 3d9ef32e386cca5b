from dataclasses import replace
from math import log10

import pytest

from logger.core import ekf
from logger.core.live import ADVICE, LiveTracker
from logger.core.live_settings import FOLLOW, STRONGEST, SUSPICIOUS, LiveSettings
from logger.core.places import Places, Utm
from logger.core.types import CellReading, Fix, LiveEstimate, Note, Record, Scan
from logger.device.live_view import live_view
from tests.kit.runs import reading

S = 10**9


def _fix(t_s, lon=13.0, valid=True):
    return Record(
        t_s * S, "gnss", Fix(valid, None, 52.0 if valid else None, lon if valid else None)
    )


def _scan(t_s, *readings):
    return Record(t_s * S, "modem", Scan(t_s * S, readings))


def _feed(tracker, *records):
    return [value for seq, record in enumerate(records) for value in tracker.feed(seq, record)]


def _knowing(settings, *cells):
    """A tracker that has received these cells once, before the first fix."""
    tracker = LiveTracker(settings)
    assert _feed(tracker, _scan(0, *(reading(cid, -100.0) for cid in cells))) == []
    return tracker


def test_dead_reckoning_counts_less():
    measured, reckoned = (LiveTracker(LiveSettings()) for _ in range(2))
    for tracker, quality in ((measured, 1), (reckoned, 6)):
        tracker.feed(0, Record(0, "gnss", Fix(True, None, 52.0, 13.0, hdop=1.0, quality=quality)))
    assert measured._track._fixes.last.place.sigma_m.item() == pytest.approx(4.0)
    assert reckoned._track._fixes.last.place.sigma_m.item() == pytest.approx(28.28, abs=0.01)


def test_locks_on_the_strongest_and_steps_the_reference_filter():
    tracker = _knowing(LiveSettings(), 1, 2)
    found = _feed(
        tracker,
        _fix(1),
        _scan(1, reading(1, -80.0), reading(2, -60.0)),
        _scan(2, reading(2, -61.0)),
    )
    note, first, second = found
    assert (note.code, first.cell, first.n, second.n) == ("target-locked", "262-01-4711-2", 1, 2)
    x_m, y_m = Utm.at(52.0, 13.0).to_xy(52.0, 13.0)
    expected = ekf.step(
        ekf.step(ekf.start(Places.of(x_m, y_m)), x_m, y_m, -60.0).state, x_m, y_m, -61.0
    )
    assert (second.x_m, second.p0_dbm, second.p_ee) == (
        expected.state.x_m,
        expected.state.p0_dbm,
        expected.state.p[9],
    )
    assert second.innovation_db == expected.innovation_db


def test_target_changes_only_beyond_the_hysteresis_and_starts_again():
    tracker = _knowing(LiveSettings(target=STRONGEST, hysteresis_db=6.0), 1, 2)
    found = _feed(
        tracker,
        _fix(1),
        _scan(1, reading(1, -60.0)),
        _scan(2, reading(1, -65.0), reading(2, -60.0)),
        _scan(3, reading(1, -66.0), reading(2, -59.0)),
    )
    codes = [value.code for value in found if isinstance(value, Note)]
    assert codes == ["target-locked", "target-changed"]
    assert [(e.cell[-1], e.n) for e in found if isinstance(e, LiveEstimate)] == [
        ("1", 1),
        ("1", 2),
        ("2", 1),
    ]


def _follow(t_s, cell):
    return Record(t_s * S, "page", Note("info", FOLLOW, cell))


def test_a_followed_cell_is_the_target_although_it_is_weaker_until_the_strongest_is_wanted():
    tracker = _knowing(LiveSettings(), 1, 2)
    both = reading(1, -60.0), reading(2, -90.0)
    targets = []
    for record in (
        _fix(1),
        _scan(1, *both),
        _follow(2, "262-01-4711-2"),
        _scan(2, reading(1, -60.0)),
        _scan(3, *both),
        _scan(4, *both),
        _follow(4, "strongest"),
        _scan(4, *both),
    ):
        tracker.feed(0, record)
        targets.append(tracker.target and tracker.target[-1])
    assert targets == [None, "1", "1", "1", "2", "2", "2", "1"]


def test_a_followed_cell_that_nobody_hears_changes_nothing():
    tracker = _knowing(LiveSettings(), 1)
    _feed(tracker, _fix(1), _scan(1, reading(1, -60.0)), _follow(1, "x" * 400))
    assert _feed(tracker, _scan(2, reading(1, -61.0)))[0].cell == "262-01-4711-1"


def test_a_target_not_received_for_a_while_gives_way():
    settings = LiveSettings(target=STRONGEST, lost_s=10.0, max_fix_age_s=100.0)
    tracker = _knowing(settings, 1, 2)
    records = [
        _fix(1),
        _scan(1, reading(1, -60.0)),
        *(_scan(t, reading(2, -90.0)) for t in range(2, 14)),
    ]
    found = _feed(tracker, *records)
    (changed,) = [v for v in found if isinstance(v, Note) and v.code == "target-changed"]
    assert "262-01-4711-2" in changed.text
    assert [v.cell[-1] for v in found if isinstance(v, LiveEstimate)] == ["1", "2", "2"]


def test_a_wished_target_is_kept():
    tracker = _knowing(LiveSettings(target="262-01-4711-1"), 1, 2)
    found = _feed(tracker, _fix(1), _scan(1, reading(1, -100.0), reading(2, -50.0)))
    assert [v.cell for v in found if isinstance(v, LiveEstimate)] == ["262-01-4711-1"]


def _receives_a_foreign_cell(target, settings=None):
    """Six scans with a foreign cell that is weaker than the cells of this country."""
    home = [reading(cid, -60.0 - cid) for cid in range(1, 5)]
    foreign = CellReading("neighbour", "GSM", "310", "260", 1, 9, 30, rssi_dbm=-80.0)
    records = [record for t in range(2, 40, 5) for record in (_fix(t), _scan(t, *home, foreign))]
    tracker = LiveTracker(settings or LiveSettings(target=target))
    return tracker, _feed(tracker, *records)


def test_the_most_suspicious_cell_is_followed_once_there_is_one():
    tracker, found = _receives_a_foreign_cell("suspicious")
    assert tracker.target == "310-260-1-9"
    notes = [value for value in found if isinstance(value, Note)]
    locked, changed = (note for note in notes if note.code.startswith("target-"))
    assert (locked.code, changed.code) == ("target-locked", "target-changed")
    assert "262-01-4711-1 at -61 dBm" in locked.text
    assert "310-260-1-9 at -80 dBm" in changed.text
    # the change follows the finding in the records, so that replay sees both in this order
    codes = [note.code for note in notes]
    assert codes.index("finding") < codes.index("target-changed")


def test_the_strongest_cell_stays_the_target_by_default():
    tracker, _ = _receives_a_foreign_cell("strongest")
    assert tracker.target == "262-01-4711-1"


@pytest.mark.parametrize("unusable", [
    CellReading("neighbour", "GSM", rssi_dbm=-40.0),
    CellReading("serving", "LTE", "262", "01", 1, 2, rssi_dbm=-40.0),
    CellReading("serving", "GSM", "262", "01", 1, 2),
])  # fmt: skip
def test_strongest_means_a_decoded_2g_cell_with_a_level(unusable):
    tracker = _knowing(LiveSettings(), 3)
    found = _feed(tracker, _fix(1), _scan(1, unusable, reading(3, -99.0)), _scan(2, unusable))
    assert [v.cell for v in found if isinstance(v, LiveEstimate)] == ["262-01-4711-3"]


def test_no_fix_an_old_fix_and_a_lost_fix_say_nothing():
    tracker = LiveTracker(LiveSettings(max_fix_age_s=3.0))
    assert _feed(tracker, _scan(1, reading(1, -60.0))) == []
    assert _feed(tracker, _fix(1), _scan(5, reading(1, -60.0))) == []
    assert _feed(tracker, _fix(6), _fix(7, valid=False), _scan(7, reading(1, -60.0))) == []


def test_beyond_84_degrees_warns_once():
    tracker = LiveTracker(LiveSettings())
    polar = Record(S, "gnss", Fix(True, None, 86.0, 13.0))
    found = _feed(tracker, polar, polar, _scan(1, reading(1, -60.0)))
    assert [value.code for value in found] == ["unmapped"]


def test_one_false_fix_accuses_nobody_and_moves_no_reading():
    """Berlin, and for one second 145 km east of it, in Poland."""
    tracker, false, found = LiveTracker(LiveSettings()), Fix(True, None, 52.5, 15.6), []
    for t in range(20):
        scan = _scan(t, *(reading(cid, -70.0 - cid) for cid in range(1, 5)))
        fix = Record(t * S, "gnss", false) if t == 10 else _fix(t)
        found += _feed(tracker, fix, scan)
        assert tracker._track.latest.place.t_ns.item() == (t - (t == 10)) * S
    assert [one.code for one in found if isinstance(one, Note)].count("position-leap") == 1
    assert tracker.suspicion.conspicuous() == []


def _walk(n, *, false=lambda t_s: (), most_cells=64, target="suspicious"):
    """A minute of walking past two cells, with a reading beside them that is said by `false`."""
    settings = LiveSettings(target=target, most_cells=most_cells, max_fix_age_s=1e6)
    tracker = LiveTracker(settings)
    found, seq = [], 0
    for t_s in range(1, n + 1):
        scan = _scan(t_s, *false(t_s), reading(1, -80.0 - t_s % 3), reading(2, -90.0 + t_s % 2))
        for record in (_fix(t_s, 13.0 + 2e-5 * t_s), scan):
            found += [(t_s, value) for value in tracker.feed(seq, record)]
            seq += 1
    return tracker, found


def test_a_cell_of_one_scan_is_never_the_target_and_never_located():
    tracker, found = _walk(60, false=lambda t_s: [reading(5000 + t_s, -10.0)], most_cells=2)
    assert tracker.target == "262-01-4711-1"
    assert [value.code for _, value in found if isinstance(value, Note)][:1] == ["target-locked"]
    assert {value.cell for _, value in found if isinstance(value, LiveEstimate)} == {
        "262-01-4711-1",
        "262-01-4711-2",
    }


def test_false_names_push_out_no_cell_and_change_no_estimate():
    _, plain = _walk(60, most_cells=2)
    _, found = _walk(
        60, false=lambda t_s: [reading(5000 + 7 * t_s + k, -10.0) for k in range(5)], most_cells=2
    )
    assert [str(value) for _, value in found] == [str(value) for _, value in plain]


@pytest.mark.parametrize("most_cells", [3, 4, 6])
def test_a_scan_of_more_cells_than_are_tracked_pushes_none_of_them_out(most_cells):
    """By turns they pushed each other out, and none was ever located."""
    _, found = _walk(
        60,
        false=lambda _: [reading(cid, -60.0 - cid) for cid in range(3, 7)],
        most_cells=most_cells,
    )
    last = {
        value.cell: value.n
        for _, value in found
        if isinstance(value, LiveEstimate) and value.stage == "locator"
    }
    assert list(last.values()) == [60] * most_cells


def test_a_target_that_comes_late_is_tracked_though_the_scan_has_too_many():
    others = [reading(cid, -60.0 - cid) for cid in range(3, 7)]
    target, late = "262-01-4711-9", [reading(9, -99.0)]
    _, found = _walk(60, false=lambda t_s: others + late * (t_s > 20), most_cells=3, target=target)
    last = {v.cell: v.n for _, v in found if isinstance(v, LiveEstimate) and v.stage == "locator"}
    assert last[target] == 40


def test_the_first_reading_of_a_cell_is_not_lost():
    _, found = _walk(60)
    last = [
        value for _, value in found if isinstance(value, LiveEstimate) and value.stage == "locator"
    ]
    assert {value.cell: value.n for value in last} == {"262-01-4711-1": 60, "262-01-4711-2": 60}


def test_an_unsure_identity_makes_no_cell_known():
    unsure = replace(reading(3, -20.0), identity_unsure=True)
    tracker, found = _walk(60, false=lambda _: [unsure])
    assert tracker.target == "262-01-4711-1"
    assert "262-01-4711-3" not in {
        value.cell for _, value in found if isinstance(value, LiveEstimate)
    }


def test_an_unsure_reading_of_a_known_cell_has_a_level():
    def false(t_s):
        return [replace(reading(3, -85.0), identity_unsure=t_s > 2)]

    tracker, found = _walk(60, false=false)
    last = [
        value
        for _, value in found
        if isinstance(value, LiveEstimate) and value.cell == "262-01-4711-3"
    ]
    assert last[-1].n == 60
    assert tracker.target == "262-01-4711-1"


def _walk_past(tracker, n=120, cell=1):
    """A walk to the east with one cell north of it; returns what is to be recorded."""
    results = []
    for t_s in range(n):
        x_m = 1.4 * t_s
        away_m = ((x_m - 100.0) ** 2 + 60.0**2) ** 0.5
        level_dbm = round(-30.0 - 28.0 * log10(away_m))
        lon = 13.0 + x_m / 68_600.0
        results += tracker.feed(2 * t_s, _fix(t_s, lon))
        results += tracker.feed(2 * t_s + 1, _scan(t_s, reading(cell, float(level_dbm))))
    return results


def test_the_target_has_advice_and_a_position():
    tracker = LiveTracker(LiveSettings())
    notes = [value for value in _walk_past(tracker) if isinstance(value, Note)]
    advice = [note.text for note in notes if note.code == ADVICE]
    assert 4 <= len(advice) <= 7  # every 25 m of 168 m
    assert all(text.startswith("262-01-4711-1: ") for text in advice)
    followed = tracker.followed
    assert followed.cell == "262-01-4711-1"
    assert followed.answer.verdict in {"located", "ambiguous", "cannot tell"}
    assert followed.answer.place.r50_m < 500.0
    assert followed.answer.word is None
    assert tracker.answer.word.word == "nothing unusual"
    assert live_view(tracker).position.text == tracker.answer.sentence == followed.answer.sentence


def test_another_target_is_followed_anew():
    tracker = LiveTracker(LiveSettings())
    _walk_past(tracker)
    tracker.feed(1000, Record(200 * S, "page", Note("info", FOLLOW, "262-01-4711-2")))
    for t_s in range(200, 203):
        tracker.feed(2 * t_s, _fix(t_s, 13.003))
        tracker.feed(2 * t_s + 1, _scan(t_s, reading(1, -60.0), reading(2, -90.0)))
    tracker.feed(1001, _fix(204, 13.003))
    assert tracker.target == "262-01-4711-2"
    assert tracker.followed.cell == "262-01-4711-2"
    assert tracker.followed.way is None


def _targets(settings, *records):
    """The target after each record, by the number of its cell."""
    tracker = _knowing(settings, 1, 2, 3)
    targets = []
    for seq, record in enumerate(records):
        tracker.feed(seq, record)
        targets.append(tracker.target and tracker.target[-1])
    return tracker, targets


def test_the_target_stays_although_another_cell_is_louder_or_it_is_not_heard():
    louder = [_scan(t, reading(1, -90.0), reading(2, -50.0)) for t in range(2, 50)]
    gone = [_scan(t, reading(2, -50.0)) for t in range(50, 100)]
    settings = LiveSettings(max_fix_age_s=1e6)
    tracker, targets = _targets(settings, _fix(1), _scan(1, reading(1, -60.0)), *louder, *gone)
    assert set(targets[1:]) == {"1"}
    assert not tracker.pursuit.over


def test_a_target_not_heard_for_ten_minutes_is_given_up_and_the_next_is_offered():
    heard = [_scan(1, reading(1, -60.0), reading(2, -90.0), reading(3, -80.0))]
    others = [
        record
        for t in range(2, 600, 20)
        for record in (_fix(t), _scan(t, reading(2, -90.0), reading(3, -80.0)))
    ]
    settings = LiveSettings(max_fix_age_s=100.0)
    tracker, targets = _targets(settings, _fix(1), *heard, *others)
    assert not tracker.pursuit.over
    notes = [value for value in tracker.feed(900, _fix(602)) if isinstance(value, Note)]
    assert [note.code for note in notes] == ["target-over"]
    assert tracker.pursuit.over == "not heard for 10 min"
    assert set(targets[1:]) == {"1"}
    assert tracker.offer == "262-01-4711-3"  # the strongest of the others
    tracker.feed(901, _follow(603, tracker.offer))
    tracker.feed(902, _scan(603, reading(3, -80.0)))
    assert tracker.target == "262-01-4711-3"
    assert tracker.pursuit.is_asked
    assert not tracker.pursuit.over


def test_a_suspicious_cell_takes_over_and_an_unusual_one_is_offered():
    tracker, found = _receives_a_foreign_cell(SUSPICIOUS)
    (word,) = {one.word for one in tracker.suspicion.conspicuous()}
    assert tracker.target == ("310-260-1-9" if word == "suspicious" else "262-01-4711-1")
    assert tracker.offer == (None if word == "suspicious" else "310-260-1-9")
    codes = [value.code for value in found if isinstance(value, Note)]
    assert codes.count("target-changed") == (word == "suspicious")


def test_only_an_ordinary_cell_that_a_person_chose_is_searched_for_without_a_limit():
    home = [reading(cid, -60.0 - cid) for cid in range(1, 5)]
    other_area = CellReading("neighbour", "GSM", "262", "01", 999, 9, 30, rssi_dbm=-80.0)
    heard = [r for t in range(2, 40, 5) for r in (_fix(t), _scan(t, *home, other_area))]
    tracker = LiveTracker(LiveSettings(target=SUSPICIOUS))
    _feed(tracker, *heard)
    assert [one.word for one in tracker.suspicion.conspicuous()] == ["unusual"]
    for seq, (cell, is_asked) in enumerate({home[1].cell: True, other_area.cell: False}.items()):
        tracker.feed(100 + seq, _follow(40, cell))
        tracker.feed(200 + seq, _scan(40, *home, other_area))
        assert (tracker.target, tracker.pursuit.is_asked) == (cell, is_asked)


def test_a_run_from_before_the_target_stayed_is_followed_as_then():
    old = LiveSettings(target=SUSPICIOUS, give_up_s=0.0)
    tracker, _ = _receives_a_foreign_cell(SUSPICIOUS, old)
    assert tracker.target == "310-260-1-9"  # of any word


def test_the_program_chooses_anew_once_it_may():
    both = reading(1, -60.0), reading(2, -90.0)
    _, targets = _targets(
        LiveSettings(),
        _fix(1),
        _scan(1, *both),
        _follow(1, "262-01-4711-2"),
        _scan(2, *both),
        _follow(2, SUSPICIOUS),
        _scan(3, *both),
    )
    assert targets == [None, "1", "1", "2", "2", "1"]
