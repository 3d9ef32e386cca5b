import pytest

from logger.core.runfile import read_run
from logger.core.types import IMPOSSIBLE_DATE, Fix, Note, Record
from logger.doctor.single_tests import clock_line
from tests.kit import runs

S = 10**9


def _line(tmp_path, wall_off_s, utc=lambda t: runs.UTC0_NS + t * S, *notes):
    fixes = [Record(t * S, "gnss", Fix(True, utc(t), 52.0, 13.0, hdop=1.0)) for t in range(1, 41)]
    runs.write_journal(tmp_path / "a.journal", [*(Record(0, "gnss", n) for n in notes), *fixes])
    return clock_line(read_run(tmp_path / "a.journal"), runs.UTC0_NS + round(wall_off_s * S))


@pytest.mark.parametrize(
    ("off_s", "says"),
    [
        (1.0, "agrees"),
        (-3600.0, "3600 s behind the receiver"),
        (3 * 86_400.0, "3 days ahead of the receiver"),
    ],
)
def test_a_wrong_clock_of_the_machine_is_harmless(tmp_path, off_s, says):
    line = _line(tmp_path, off_s)
    assert (line.state, says in line.text) == ("ok", True), line


def test_a_receiver_with_a_wrong_date_is_reported(tmp_path):
    line = _line(tmp_path, 0.0, lambda t: runs.UTC0_NS + t * S - 1024 * 7 * 86_400 * S)
    assert (line.state, "date of its runs will be unknown" in line.text) == ("warn", True)


def test_times_that_contradict_each_other(tmp_path):
    line = _line(tmp_path, 0.0, lambda t: runs.UTC0_NS + t * (1 + 90 * (t % 2)) * S)
    assert (line.state, "contradict" in line.text) == ("warn", True)


def test_without_a_time(tmp_path):
    assert "no time from the receiver" in _line(tmp_path, 0.0, lambda _: None).text


def test_a_date_that_was_dropped_is_reported(tmp_path):
    note = Note("warning", IMPOSSIBLE_DATE, "2007-02-04 is the receiver's date")
    line = _line(tmp_path, 0.0, lambda _: None, note)
    assert (line.state, line.text) == ("warn", note.text)
