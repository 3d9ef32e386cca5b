import json
import time

import msgspec
import pytest

from logger.cli import main
from logger.command_line import INTERRUPTED
from logger.core.answer import MultiPolygon, NextWay, StrongestReading
from logger.core.document import Document, terminal_lines
from logger.device.live_view import CellStatus, PositionStatus
from logger.device.status import FixStatus, Status, report, status_parts, write_status

S = 10**9
STATUS = Status(
    "recording", "9 s", "run-1.journal", 1, 9 * 10**9, 0, 8 * 10**9, 3, 2, 1, 0, 10, None, {},
    next=NextWay(44.0, 137.0, 52.0, 13.0, 2.0, "go, north-east, 137 m: two places fit"),
    position=PositionStatus(
        cell="262-01-4711-2", verdict="ambiguous", lat=52.0, lon=13.0, r95_m=88.0, r50_m=31.0,
        drms_m=40.0, area_m2=20_000.0, modes=(),
        region=MultiPolygon(type="MultiPolygon", coordinates=[]),
        strongest=StrongestReading(lat=52.0, lon=13.0, level_dbm=-60.0), word="suspicious",
        text="suspicious; ambiguous: two places fit",
    ),
    cells=(
        CellStatus("262-01-4711-1", is_serving=True, level_dbm=-60.0, heard_ns=8 * 10**9),
        CellStatus(
            "262-01-4711-2", "GSM", 17, level_dbm=-70.0, trend_db=-3.0, verdict="one place",
            word="suspicious",
        ),
    ),
    followed="262-01-4711-2",
)  # fmt: skip


def _lines(status):
    return list(terminal_lines(Document(None, body=status_parts(status))))


def test_the_lines_say_what_the_page_shows():
    lines = _lines(STATUS)
    assert lines[:2] == ["recording: 9 s", "durable 1.0 s ago in run-1.journal"]
    assert lines[2] == "go: 44 deg, north-east, 137 m: two places fit"
    assert lines[3] == "262-01-4711-2: suspicious; ambiguous: two places fit"
    assert "level (dBm)" in lines[4]
    assert lines[5].split() == ["262-01-4711-1", "+", "-60", "1"]
    assert lines[6].split()[:4] == ["262-01-4711-2", "*", "-70", "-3"]
    assert lines[6].endswith("one place, suspicious")


LOST = FixStatus(8 * S, False, None, None, None, None, None, 3)
FIXED = FixStatus(8 * S, True, None, 52.0, 13.0, None, 0.9, 9)
SILENT = msgspec.structs.replace(FIXED, t_ns=2 * S)


@pytest.mark.parametrize(
    ("state", "fix", "place", "has_way"),
    [
        ("no fix", LOST, "no position, 3", False),
        ("error", FIXED, "52.00000 13.00000", True),
        ("error", SILENT, "9 satellites, 7 s ago", False),
        ("recording", LOST, "no position", True),
    ],
)
def test_there_is_no_way_from_a_place_that_the_walker_has_left(state, fix, place, has_way):
    # in `recording` the latest position is a moment old
    lines = _lines(msgspec.structs.replace(STATUS, state=state, fix=fix))
    assert place in next(line for line in lines if line.startswith("position:"))
    assert any(line.startswith("go:") for line in lines) is has_way


def test_a_file_that_is_not_used_is_a_line():
    status = msgspec.structs.replace(STATUS, left_out=("/a/streets is no file",))
    assert "not used: /a/streets is no file" in _lines(status)


def test_what_the_rules_could_not_see_comes_last():
    status = msgspec.structs.replace(STATUS, unnoticed="Here a strong new station ...")
    assert _lines(status)[-1] == "Here a strong new station ..."


def _write(folder, *, age_s=0.0, **changes):
    """STATUS as the service wrote it `age_s` ago."""
    shift_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME) - STATUS.now_ns - int(age_s * 1e9)
    cells = tuple(
        msgspec.structs.replace(row, heard_ns=row.heard_ns + shift_ns) for row in STATUS.cells
    )
    now_ns, synced_ns = STATUS.now_ns + shift_ns, STATUS.synced_ns + shift_ns
    changes = {"now_ns": now_ns, "synced_ns": synced_ns, "cells": cells} | changes
    write_status(folder, msgspec.structs.replace(STATUS, **changes))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize(("state", "code"), [("recording", 0), ("no fix", 0), ("error", 1)])
def test_the_command_prints_text_or_json(folder, capsys, state, code):
    _write(folder, state=state)
    assert main(["status"]) == code
    assert capsys.readouterr().out.startswith(state)
    assert main(["status", "--json"]) == code
    document = json.loads(capsys.readouterr().out)
    assert (document["next"]["distance_m"], document["silent_s"]) == (137.0, 0.0)


def test_a_status_of_a_service_that_hangs_is_an_error(folder, capsys):
    _write(folder, age_s=20.0)
    assert main(["status"]) == 1
    first, before, *others = capsys.readouterr().out.splitlines()
    assert first.startswith("error: the recorder is silent for 20 s")
    assert before == "before that recording: 9 s"
    assert not any(line.startswith("go:") for line in others)
    assert others[-2].split()[-1] == "21"
    assert main(["status", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["silent_s"] == pytest.approx(20.0, abs=1.0)


@pytest.mark.parametrize(
    ("age_s", "first"),
    [(0.0, "stopped: the run is closed; its HDF5 file"), (9.0, "stopped: the run is closed")],
)
def test_a_run_that_is_closed_is_no_error_and_is_not_recorded(folder, capsys, age_s, first):
    text = "the run is closed; its HDF5 file is being made of run-1.journal"
    _write(folder, age_s=age_s, text=text, is_over=True)
    assert main(["status"]) == 1
    said = capsys.readouterr().out
    assert said.startswith(first)
    assert "error" not in said
    assert "go:" not in said
    assert main(["status", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["is_over"]


@pytest.mark.parametrize(
    ("content", "reason"),
    [(None, "sudo fieldlogger doctor says why"), ("{}", "damaged"), ("x", "damaged")],
)
def test_without_a_status_nothing_is_recorded(folder, capsys, content, reason):
    if content is not None:
        (folder / "status.json").write_text(content)
    assert main(["status"]) == 1
    assert reason in capsys.readouterr().out
    assert main(["status", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert (document["state"], reason in document["text"]) == ("error", True)


def test_who_may_not_read_the_status_is_told_so(folder, monkeypatch, capsys):
    def refuse(_folder):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("logger.device.status.read_status", refuse)
    assert main(["status"]) == 2
    assert "use sudo" in capsys.readouterr().err


def test_watching_goes_on_over_a_restart_of_the_service(folder, monkeypatch, capsys):
    def restart(_seconds):
        if (folder / "status.json").exists():
            raise KeyboardInterrupt
        _write(folder)

    monkeypatch.setattr("logger.cli.time.sleep", restart)
    assert main(["status", "--watch"]) == INTERRUPTED
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert "no service is recording" in first
    assert "by hand writes its status where RUNTIME_DIRECTORY says" in first
    assert second == "recording: 9 s"


def test_lines_fit_the_terminal(folder):
    reason = "two places fit, 109 m apart; on the way about -77 dBm if it is the north-east one"
    _write(folder, next=NextWay(44.0, 137.0, 52.0, 13.0, 2.0, reason))
    lines = list(terminal_lines(report(folder)[0], 80))
    assert max(map(len, lines)) <= 80
    assert reason in " ".join(line.strip() for line in lines)
