import json

import pytest

from logger.cli import main
from logger.core.guidance.next_way import NextWay
from logger.device.status import CellStatus, PositionStatus, Status, write_status
from logger.device.status_text import status_lines

STATUS = Status(
    "recording", "9 s", "run-1.journal", 1, 9 * 10**9, 0, 8 * 10**9, 3, 2, 1, 0, 10, None, None, {},
    next=NextWay(44.0, 137.0, 52.0, 13.0, 2.0, "two places fit"),
    position=PositionStatus("262-01-4711-2", "ambiguous", 52.0, 13.0, 88.0),
    cells=(
        CellStatus("262-01-4711-1", is_serving=True, level_dbm=-60.0, heard_ns=8 * 10**9),
        CellStatus(
            "262-01-4711-2", "GSM", 17, level_dbm=-70.0, trend_db=-3.0, verdict="one place",
            word="suspicious",
        ),
    ),
    followed="262-01-4711-2",
)  # fmt: skip


def test_the_lines_say_what_the_page_shows():
    lines = list(status_lines(STATUS))
    assert lines[:2] == ["recording: 9 s", "durable 1.0 s ago in run-1.journal"]
    assert lines[2] == "go: NE (44 deg), 137 m: two places fit"
    assert lines[3] == "262-01-4711-2: ambiguous, 52.00000 13.00000, 95 % within 88 m"
    assert lines[4].split() == ["+", "262-01-4711-1", "-60", "dBm", "1", "s"]
    assert lines[5].split()[:5] == ["*", "262-01-4711-2", "-70", "dBm", "-3"]
    assert lines[5].endswith("one place, suspicious")


@pytest.mark.parametrize(("state", "code"), [("recording", 0), ("error", 1)])
def test_the_command_prints_text_or_json(tmp_path, monkeypatch, capsys, state, code):
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    assert main(["status"]) == 2
    assert "no service is recording" in capsys.readouterr().err
    fields = {name: getattr(STATUS, name) for name in STATUS.__struct_fields__}
    write_status(tmp_path, Status(**fields | {"state": state}))
    assert main(["status"]) == code
    assert capsys.readouterr().out.startswith(state)
    assert main(["status", "--json"]) == code
    assert json.loads(capsys.readouterr().out)["next"]["distance_m"] == 137.0
