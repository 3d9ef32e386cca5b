"""A new item on the phone is a field of `LiveView` with its value, and a line of the page."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import logger

FIELD = "    left_out: tuple[str, ...] = ()\n"
VALUE = "cells=tuple(rows)"
EDITS = ((FIELD, f"{FIELD}    n_strong: int = 0\n"), (VALUE, f"{VALUE}, n_strong=_strong(rows)"))
ADDED = """

def _strong(rows: list[CellStatus]) -> int:
    return sum((row.level_dbm or -200.0) > -75.0 for row in rows)
"""
PROGRAM = """
from pathlib import Path
from msgspec.structs import asdict
from logger.core.types import CellReading, Record, Scan
from logger.device.live_view import CellTable, LiveView
from logger.device.status import Status, write_status
from logger.page.feed import Feed

levels_dbm = (-60.0, -72.0, -84.0)
readings = [CellReading("scan", "GSM", "262", "01", 4711, n, rssi_dbm=level_dbm)
            for n, level_dbm in enumerate(levels_dbm)]
table = CellTable()
table.feed(Record(1, "modem", Scan(0, tuple(readings))))
run = "run-000001.journal"
write_status(Path(), Status("recording", "", run, 1, 9, 0, 8, 3, 2, 1, 0, 10, None, {},
                            **asdict(table.fill(LiveView()))))
feed = Feed(Path(), Path())
feed.look()
print(feed.text.decode())
"""


def test_a_new_item_reaches_status_json_and_the_phones_from_one_file(tmp_path):
    package = tmp_path / "logger"
    shutil.copytree(Path(logger.__file__).parent, package)
    module = package / "device" / "live_view.py"
    source = module.read_text()
    for before, after in EDITS:
        assert source.count(before) == 1
        source = source.replace(before, after)
    module.write_text(source + ADDED)
    command = [sys.executable, "-c", PROGRAM]
    sent = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert json.loads((tmp_path / "status.json").read_text())["n_strong"] == 2
    assert json.loads(sent)["status"]["n_strong"] == 2
