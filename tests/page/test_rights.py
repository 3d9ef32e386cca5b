"""The page with the user, group and folders that systemd gives it: what it may read and write."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from logger.device.status import Status, write_status
from tests.kit import page as kit
from tests.kit import service
from tests.kit.runs import records, write_journal

RECORDER, PAGE = 61_001, 61_002
"""Users that no machine has; the group of both is the recorder's."""
STATUS = Status("recording", "", "run-000002.journal", 1, 9, 0, 8, 3, 2, 1, 0, 10, None, {})

pytestmark = pytest.mark.skipif(
    os.getuid() != 0 or shutil.which("setpriv") is None, reason="needs root and setpriv"
)


@pytest.fixture
def folder():
    """As fieldlogger.service and fieldlogger-page.service make them, with UMask=0027."""
    with tempfile.TemporaryDirectory() as made:
        base = Path(made)
        base.chmod(0o755)
        write_status(kit.folders(base), STATUS)
        write_journal(base / "runs/run-000002.journal", records(30), close=False)
        for name, user, mode in (
            ("cellwalk", RECORDER, 0o750),
            ("runs", RECORDER, 0o750),
            ("cellwalk-page", PAGE, 0o750),
            ("state", PAGE, 0o700),
        ):
            (base / name).chmod(mode)
            os.chown(base / name, user, RECORDER)
            for file in (base / name).iterdir():
                os.chown(file, user, RECORDER)
                file.chmod(0o640)
        yield base


def _as_page(*command):
    ids = ("--reuid", str(PAGE), "--regid", str(RECORDER), "--clear-groups")
    return ["setpriv", *ids, *command]


def test_it_reads_the_walk_and_writes_requests_that_the_recorder_reads(folder, monkeypatch):
    port = kit.free_port()
    table = f'[page]\nlisten = "127.0.0.1:{port}"\n'
    config = service.site_toml(folder, "/dev/a", "/dev/b", table)
    monkeypatch.setattr(service, "FIELDLOGGER", tuple(_as_page(*service.FIELDLOGGER)))
    with kit.page_server(folder, config, port) as page, kit.recording(folder, STATUS) as notes:
        assert len(json.loads(page.request("track")[2])["points"]) > 5
        assert page.post("mark", "here!")[0] == 202
        file = (folder / "cellwalk-page/requests").stat()
        assert (file.st_uid, file.st_gid, file.st_mode & 0o777) == (PAGE, RECORDER, 0o640)
        assert (folder / "state/token").stat().st_uid == PAGE
    assert [note.text for note in notes] == ["here!"]


@pytest.mark.parametrize(
    "path", ["cellwalk/status.json", "cellwalk/new", "runs/run-000002.journal", "runs/new"]
)
def test_it_can_write_nothing_of_the_recorder(folder, path):
    script = f"import os; os.open({str(folder / path)!r}, os.O_WRONLY | os.O_CREAT)"
    done = subprocess.run(
        _as_page(sys.executable, "-c", script), capture_output=True, text=True, check=False
    )
    assert "PermissionError" in done.stderr
