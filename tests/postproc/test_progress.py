"""Long work says how far it is where there is no terminal; short work says nothing."""

import re
import time

from postproc import progress


def test_long_work_writes_lines(capsys, monkeypatch):
    monkeypatch.setattr(progress, "_SILENCE_S", 0.05)

    def work():
        for item in range(3):
            time.sleep(0.2)  # before the first item too
            yield item

    assert list(progress.with_progress(work(), "locating", 3)) == [0, 1, 2]
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "locating: 0 of 3 after 0 s"  # nobody knows yet
    later = re.compile(r"locating: 2 of 3 after \d s, about \d s left")
    assert any(map(later.fullmatch, lines))


def test_short_work_writes_nothing(capsys):
    assert list(progress.with_progress(iter("abc"), "reading", 3)) == ["a", "b", "c"]
    assert capsys.readouterr().err == ""


def test_a_count_without_a_total_is_written_too(monkeypatch, capsys):
    monkeypatch.setattr(progress, "_SILENCE_S", 0.05)

    def rows():
        yield 0
        time.sleep(0.2)
        yield 1

    assert list(progress.with_count(rows(), "log.csv: rows")) == [0, 1]
    assert capsys.readouterr().err.startswith("log.csv: rows: 1 after 0 s\n")
