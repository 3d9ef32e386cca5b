from dataclasses import replace
from importlib.metadata import version

import pytest

from logger.core.errors import EstimationError
from logger.core.live import ADVICE, LiveTracker
from logger.core.live_settings import FAILED, FOLLOW, REFERENCE, RESTARTED, WITHIN, LiveSettings
from logger.core.runfile import read_run
from logger.core.suspicion.rule import Rate
from logger.core.suspicion.rules import RULES, RULES_CODE, rules_note
from logger.core.types import Fix, LiveEstimate, Note, Record, Scan
from postproc.cli import main
from postproc.replay import replay
from tests.kit import runs


def _record_walk(stream=(), settings=None):
    """A walk with the live estimates that the recorder would have added."""
    tracker = LiveTracker(settings or runs.meta().live)
    out = []
    for record in stream or runs.records(50):
        seq = len(out)
        out.append(record)
        out += [Record(record.t_ns, "live", value) for value in tracker.feed(seq, record)]
    return out


def test_a_cell_that_the_walker_followed_is_followed_again(tmp_path):
    weaker = Record(0, "page", Note("info", FOLLOW, "262-01-4711-2"))
    stream = runs.records(40)
    stream.insert(60, replace(weaker, t_ns=stream[60].t_ns))
    records = _record_walk(stream)
    assert any(value.cell == "262-01-4711-2" for value in _live(records) if "ref" in value.stage)
    assert _replay(tmp_path, records).equal
    without = [r for r in records if not (isinstance(r.value, Note) and r.value.code == FOLLOW)]
    (tmp_path / "without").mkdir()
    assert not _replay(tmp_path / "without", without).equal


def _live(records):
    return [record.value for record in records if isinstance(record.value, LiveEstimate)]


def _replay(tmp_path, records, *, close=True):
    path = tmp_path / "a.journal"
    runs.write_journal(path, records, close=close)
    return replay(read_run(path))


def test_what_was_live_comes_out_again_to_the_bit(tmp_path):
    records = _record_walk()
    found = _replay(tmp_path, records)
    assert found.equal
    assert found.n_recorded == found.n_replayed == len(_live(records)) > 50
    assert {value.stage for value in _live(records)} >= {"reference-ekf", "locator"}


def _advice_at(records):
    return [
        k
        for k, record in enumerate(records)
        if isinstance(record.value, Note) and record.value.code == ADVICE
    ]


def test_advice_comes_out_again(tmp_path):
    records = _record_walk(runs.records(200))
    at = _advice_at(records)
    assert len(at) >= 4
    assert _replay(tmp_path, records).equal
    changed = list(records)
    text = changed[at[2]].value.text
    changed[at[2]] = replace(changed[at[2]], value=Note("info", ADVICE, f"{text}."))
    (tmp_path / "changed").mkdir()
    found = _replay(tmp_path / "changed", changed)
    assert found.advice_differs
    assert not found.equal


def test_a_run_of_a_version_without_advice_is_equal(tmp_path):
    records = _record_walk(runs.records(60))
    numbers = [k for k, record in enumerate(records) if k not in _advice_at(records)]
    moved = {before: after for after, before in enumerate(numbers)}
    older = [records[k] for k in numbers]
    for k, record in enumerate(older):
        if isinstance(record.value, LiveEstimate):
            at = replace(record.value, scan_seq=moved[record.value.scan_seq])
            older[k] = replace(record, value=at)
    assert _advice_at(records)
    assert not _advice_at(older)
    assert _replay(tmp_path, older).equal


def test_a_far_reach_is_recorded_and_replayed(tmp_path):
    far = LiveSettings(reach="far")
    records = _record_walk(settings=far)
    assert _live(records) != _live(_record_walk())
    runs.write_journal(tmp_path / "a.journal", records, live=far)
    run = read_run(tmp_path / "a.journal")
    assert run.meta.live == far
    assert replay(run).equal


def test_an_area_is_recorded_and_replayed(tmp_path):
    within = LiveSettings(within_walk_m=100.0)
    asked = Record(runs.records(100)[-1].t_ns, "page", Note("info", WITHIN, "40"))
    walk = runs.records(200)
    middle = next(k for k, one in enumerate(walk) if one.t_ns >= asked.t_ns)
    records = _record_walk([*walk[:middle], asked, *walk[middle:]], settings=within)
    assert _live(records) != _live(_record_walk(walk, settings=within))
    runs.write_journal(tmp_path / "a.journal", records, live=within)
    run = read_run(tmp_path / "a.journal")
    assert run.meta.live == within
    assert replay(run).equal


_CAUSES = ", with other code or on another machine"


def test_one_bit_is_noticed(tmp_path):
    records = _record_walk()
    at = [i for i, record in enumerate(records) if isinstance(record.value, LiveEstimate)][20]
    value = records[at].value
    records[at] = replace(records[at], value=replace(value, x_m=value.x_m + 1e-9))
    found = _replay(tmp_path, records)
    assert not found.equal
    assert (found.n_equal, found.first_difference) == (len(_live(records)) - 1, value.scan_seq)
    assert 0.0 < found.largest_m < 2e-9
    assert (found.recorded_by, found.replayed_by) == (
        runs.meta().program,
        f"cellwalk {version('cellwalk')}",
    )
    assert f"recorded by {found.recorded_by}, replayed by {found.replayed_by}" in found.text
    alike = replace(found, recorded_by=found.replayed_by)
    assert alike.text.endswith("; both by " + alike.replayed_by + _CAUSES)


def test_what_is_recorded_or_replayed_alone_is_a_difference(tmp_path):
    records = _record_walk()
    last = _live(records)[-1]
    without = [one for one in records if not isinstance(one.value, LiveEstimate | Note)]
    found = _replay(tmp_path, without)
    assert found.n_recorded == 0
    assert isinstance(without[found.first_difference].value, Scan)
    assert f"first difference at record {found.first_difference}; recorded by" in found.text
    (tmp_path / "more").mkdir()
    more = _replay(tmp_path / "more", [*records, Record(records[-1].t_ns, "live", last)])
    assert (more.equal, more.first_difference) == (False, last.scan_seq)


def test_an_import_without_live_estimates_is_no_alarm(tmp_path, capsys):
    lines = [f"{i},52.5{i:03},13.4,-60,GSM,262,01,4711,7" for i in range(60)]
    text = "\n".join(["t_s,lat,lon,rssi_dbm,rat,mcc,mnc,lac,cid", *lines])
    (tmp_path / "walk.csv").write_text(text)
    assert main(["import", str(tmp_path / "walk.csv"), "-o", str(tmp_path / "run.h5")]) == 0
    capsys.readouterr()
    assert main(["replay", str(tmp_path / "run.h5")]) == 0
    assert capsys.readouterr().out.startswith("the run has no live estimates to compare with")


def test_a_cut_run_is_compared_as_far_as_it_goes(tmp_path):
    records = _record_walk()
    last = max(i for i, record in enumerate(records) if isinstance(record.value, LiveEstimate))
    found = _replay(tmp_path, records[:last] + records[last + 1 :], close=False)
    assert found.equal
    assert found.n_recorded == len(_live(records)) - 1


def test_a_finished_run_that_lacks_an_estimate_is_not_equal(tmp_path):
    records = _record_walk()
    last = max(i for i, record in enumerate(records) if isinstance(record.value, LiveEstimate))
    assert not _replay(tmp_path, records[:last] + records[last + 1 :]).equal


def _record_failing_walk(stream, failed, restarted):
    """As `_record_walk`; the estimate fails at one record of the stream, and begins at another."""
    tracker, follow, out = LiveTracker(runs.meta().live), None, []
    for k, record in enumerate(stream):
        seq = len(out)
        out.append(record)
        if _is_note(record, FOLLOW):
            follow = seq, record
        if k == failed:
            tracker = None
            out.append(Record(record.t_ns, "live", Note("error", FAILED, f"record {seq}: x")))
        elif k == restarted:
            tracker = LiveTracker(runs.meta().live)
            tracker.feed(*follow)
            note = Note("info", RESTARTED, f"record {seq}: again")
            out.append(Record(record.t_ns, "live", note))
        values = tracker.feed(seq, record) if tracker else []
        out += [Record(record.t_ns, "live", value) for value in values]
    return out


def test_a_failed_estimate_begins_anew_where_it_did_and_follows_the_same_cell(tmp_path):
    stream = runs.records(60)
    stream.insert(8, Record(stream[8].t_ns, "page", Note("info", FOLLOW, "262-01-4711-2")))
    fixes = [k for k, record in enumerate(stream) if isinstance(record.value, Fix)]
    records = _record_failing_walk(stream, fixes[20], fixes[30])
    later = records[max(k for k, record in enumerate(records) if _is_note(record, RESTARTED)) :]
    assert {v.cell for v in _live(later) if "ref" in v.stage} == {"262-01-4711-2"}
    assert _replay(tmp_path, records).equal
    without = [r for r in records if not _is_note(r, RESTARTED)]
    (tmp_path / "without").mkdir()
    assert not _replay(tmp_path / "without", without).equal


def _is_note(record, code):
    return isinstance(record.value, Note) and record.value.code == code


def test_an_estimate_that_fails_only_here_is_one_line(tmp_path, monkeypatch):
    def failing(*_):
        raise ZeroDivisionError("oops")

    records = _record_walk()
    monkeypatch.setattr(LiveTracker, "feed", failing)
    with pytest.raises(EstimationError, match=r"record \d+: ZeroDivisionError \("):
        _replay(tmp_path, records)


SUSPICIOUS = LiveSettings(target="suspicious")


@pytest.fixture
def walk_with_words(tmp_path):
    """A run that follows the cell of another continent, as its rules found it."""
    foreign = replace(runs.reading(9, -75.0, "neighbour"), mcc="310", mnc="260")
    stream = [Record(0, "live", rules_note()), *runs.records(60)]
    for k, record in enumerate(stream):
        if isinstance(record.value, Scan):
            readings = (*record.value.readings, foreign)
            stream[k] = replace(record, value=replace(record.value, readings=readings))
    records = _record_walk(stream, SUSPICIOUS)
    assert {value.cell for value in _live(records) if value.stage == REFERENCE} == {
        "262-01-4711-1", "310-260-4711-9",
    }  # fmt: skip
    runs.write_journal(tmp_path / "a.journal", records, live=SUSPICIOUS)
    return tmp_path / "a.journal", records


def test_words_by_the_same_rules_are_compared(walk_with_words, capsys):
    path, _ = walk_with_words
    assert not replay(read_run(path)).other_rules
    assert main(["replay", str(path)]) == 0
    assert "other rules" not in capsys.readouterr().out


def test_words_by_other_rules_are_not_compared_and_the_estimate_is(
    walk_with_words, monkeypatch, capsys
):
    path, records = walk_with_words
    other = replace(
        RULES["S8"], id="X1", check=lambda _, cell: {} if cell.name.endswith("-2") else None,
        sentence="is second", strength="suffices", detection=1.0, measured={},
        elsewhere=Rate(1, 10**6, 0.0, "a test"),
    )  # fmt: skip
    monkeypatch.setitem(RULES, "X1", other)
    # the added rule alone would let the walk follow another cell
    stream = [record for record in records if not isinstance(record.value, LiveEstimate)]
    cells = {value.cell for value in _live(_record_walk(stream, SUSPICIOUS))}
    assert "262-01-4711-2" in {
        value.cell for value in _live(_record_walk(stream, SUSPICIOUS)) if value.stage == REFERENCE
    }, cells
    found = replay(read_run(path))
    assert found.other_rules
    assert found.equal
    assert found.n_equal == len(_live(records))
    assert main(["replay", str(path)]) == 0
    assert capsys.readouterr().out == (
        f"replay equals live: {found.n_equal} estimates, to the last bit; words by other rules\n"
    )


def test_a_version_that_was_a_number_is_one_of_other_rules(walk_with_words, tmp_path):
    _, records = walk_with_words
    texts = (RULES_CODE, "version 6: P1 P2")
    records[0] = replace(records[0], value=Note("info", *texts))
    runs.write_journal(tmp_path / "b.journal", records, live=SUSPICIOUS)
    found = replay(read_run(tmp_path / "b.journal"))
    assert found.other_rules
    assert found.equal


def test_a_difference_of_the_estimate_is_one_by_other_rules_too(
    walk_with_words, monkeypatch, tmp_path
):
    _, records = walk_with_words
    monkeypatch.setitem(RULES, "X1", replace(RULES["S8"], id="X1"))
    at = next(k for k, record in enumerate(records) if isinstance(record.value, LiveEstimate))
    value = records[at].value
    records[at] = replace(records[at], value=replace(value, x_m=value.x_m + 1e-9))
    runs.write_journal(tmp_path / "b.journal", records, live=SUSPICIOUS)
    assert main(["replay", str(tmp_path / "b.journal")]) == 1


def test_advice_about_the_target_of_other_rules_is_not_compared(walk_with_words, tmp_path):
    _, records = walk_with_words
    advice = Record(records[-1].t_ns, "live", Note("info", ADVICE, "turn back"))
    other = replace(records[0], value=Note("info", RULES_CODE, "version 6: P1 P2"))
    for first, differs in ((records[0], True), (other, False)):
        path = tmp_path / f"{differs}.journal"
        runs.write_journal(path, [first, *records[1:], advice], live=SUSPICIOUS)
        assert replay(read_run(path)).advice_differs == differs
