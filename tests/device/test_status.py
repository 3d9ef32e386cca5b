import json
import os
import shutil
import subprocess
import threading
from dataclasses import replace

import pytest

from logger.core.places import Utm
from logger.core.types import Fix, LiveEstimate, Note, RawBytes, Record
from logger.device.status import Status, read_status, status_folder, write_status
from logger.device.target import target_status
from logger.device.watched_inbox import WatchedInbox
from logger.sim.ptys import PtyDevice
from logger.sim.scenario import scenario
from tests.kit import service
from tests.kit.recorded_replies import NmeaPlayer
from tests.kit.simulated_devices import simulated_devices

STATUS = Status("recording", "", "run-1.journal", 1, 9, 0, 8, 3, 2, 1, 0, 10, None, None, {})
ESTIMATE = LiveEstimate(
    7, "locator", "262-01-4711-1", 30, 33, 400_000.0, 5_800_000.0, -40.0, 3.0,
    100.0, 0.0, 5.0, 0.1, 25.0, 4.0, 0.2, 9.0, 0.3, 0.2, 1.0, 4.0, 0.6,
)  # fmt: skip


def test_it_is_read_as_it_was_written_and_is_plain_json(tmp_path):
    write_status(tmp_path, STATUS)
    assert read_status(tmp_path) == STATUS
    assert json.loads((tmp_path / "status.json").read_text())["synced_ns"] == 8
    assert [path.name for path in tmp_path.iterdir()] == ["status.json"]


def _with_fixes(n):
    return Status("recording", "x" * (n % 7) * 1000, "", 1, 9, 0, 8, n, 2, 1, 0, 10, None, None, {})


def test_a_reader_never_sees_half_of_it(tmp_path):
    done = threading.Event()

    def write():
        for n in range(500):
            write_status(tmp_path, _with_fixes(n))
        done.set()

    write_status(tmp_path, _with_fixes(0))
    writer = threading.Thread(target=write)
    writer.start()
    seen = []
    while not done.is_set():
        seen.append(json.loads((tmp_path / "status.json").read_text())["fixes"])
    writer.join()
    assert seen == sorted(seen)


@pytest.mark.parametrize("text", [None, "", "{", '{"state": "recording"}', "[]"])
def test_what_is_no_status_is_none(tmp_path, text):
    if text is not None:
        (tmp_path / "status.json").write_text(text)
    assert read_status(tmp_path) is None


def test_the_inbox_remembers_the_fix_and_the_ports(tmp_path):
    inbox = WatchedInbox({"modem": "/dev/a", "gnss": "/dev/b"})
    inbox.put(Record(1, "modem", Note("info", "port-opened", "/dev/a opened")))
    inbox.put(Record(2, "gnss", Fix(True, 0, 52.0, 13.0, sats_used=9)))
    inbox.put(Record(3, "gnss", Fix(False)))
    inbox.put(Record(4, "modem", RawBytes(b"x")))
    inbox.put(Record(5, "live", Note("info", "ekf-started", "elsewhere")))
    assert (inbox.waiting, inbox.room) == (5, 20_000)
    assert (inbox.fix.valid, inbox.valid_ns) == (False, 2)
    assert (inbox.ports["modem"].is_open, inbox.ports["gnss"].is_open) == (True, False)
    inbox.put(Record(6, "modem", Note("warning", "port-lost", "no such port")))
    assert inbox.ports["modem"].event == "no such port"
    assert not inbox.ports["modem"].is_open
    polls = inbox.n_polls
    assert inbox.get(0.0).t_ns == 1
    assert inbox.n_polls == polls + 1


def test_the_target_is_said_as_sure_as_it_is():
    assert target_status(None, ESTIMATE) is None
    assert target_status("262-01-4711-2", ESTIMATE).verdict == "cannot tell"
    assert target_status(ESTIMATE.cell, None).lat_deg is None
    several = target_status(ESTIMATE.cell, ESTIMATE)
    assert several.verdict == "several places"
    assert (several.semi_major_m, several.semi_minor_m, several.azimuth_deg) == (24.5, 12.2, 90.0)
    assert (several.lat_deg, several.lon_deg) == pytest.approx(
        Utm(33).to_latlon(400_000.0, 5_800_000.0), abs=1e-6
    )
    assert target_status(ESTIMATE.cell, replace(ESTIMATE, probability=0.99)).verdict == "one place"
    one = target_status(ESTIMATE.cell, replace(ESTIMATE, probability=0.99))
    assert several.r95_m is None  # the other places have too much of it
    assert one.r50_m < 0.5 * one.r95_m < 0.5 * 1.3 * one.semi_major_m
    radii = f"most likely within {one.r50_m:.0f} m, surely within {one.r95_m:.0f} m"
    assert str(one).endswith(f", {radii}")
    assert str(several).startswith(
        f"target {ESTIMATE.cell}: several places ({ESTIMATE.probability:.2f}), "
    )
    assert str(target_status(ESTIMATE.cell, None)) == f"target {ESTIMATE.cell}: cannot tell"
    assert (
        target_status(ESTIMATE.cell, replace(ESTIMATE, stage="ekf", probability=1.0)).verdict
        == "one close place"
    )


def test_the_folder_is_that_of_systemd(tmp_path):
    assert status_folder({}) is None
    assert status_folder({"RUNTIME_DIRECTORY": str(tmp_path)}) == tmp_path


def test_status_json_says_how_it_goes(tmp_path, monkeypatch):
    folder = tmp_path / "status"
    folder.mkdir()
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(folder))
    link = tmp_path / "gnss"

    def wait_status(condition):
        """The first status for which it holds."""
        found = []

        def status_now():
            status = read_status(folder)
            found.extend([status] if status is not None and condition(status) else [])
            return found

        service.wait_for(status_now)
        return found[0]

    with simulated_devices() as (modem, gnss, _):
        link.symlink_to(gnss.path)
        site = service.site_toml(tmp_path, modem.path, str(link), '[status]\nled = "no-such-led"\n')
        with service.running_service(site) as logger:
            status = wait_status(
                lambda s: s.state == "recording" and s.target and s.fix.valid and s.synced_ns
            )
            assert status.pid == logger.pid
            assert status.since_ns < status.synced_ns <= status.now_ns
            assert min(status.fixes, status.scans, status.readings) > 0
            assert {name: port.is_open for name, port in status.ports.items()} == {
                "modem": True,
                "gnss": True,
            }
            assert status.fix.lat_deg == pytest.approx(
                scenario("block", 1, 600.0).world.origin_lat_deg, abs=0.1
            )
            link.unlink()
            gnss.unplug()
            status = wait_status(lambda s: s.state == "error" and not s.ports["gnss"].is_open)
            assert "gnss" in status.text
            service.stop_service(logger)


def test_a_full_card_is_told_and_is_no_reason_for_a_restart(tmp_path, monkeypatch):
    """A restart would lose what waits in memory."""
    card = tmp_path / "runs"
    card.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=30m", "tmpfs", card], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("no file system can be mounted here")
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    try:
        # for minutes, and too slow to fill the card by itself before
        noise = NmeaPlayer(os.urandom(1_000_000) * 50, bytes_per_s=200_000)
        with service.systemd(monkeypatch, tmp_path) as messages, PtyDevice(noise) as gnss:
            with service.running_service(
                service.site_toml(tmp_path, str(tmp_path / "none"), gnss.path)
            ) as logger:
                service.wait_for(lambda: "READY=1" in messages())
                (filler := card / "filler").write_bytes(bytes(shutil.disk_usage(card).free))
                service.wait_for(
                    lambda: (read_status(tmp_path) or STATUS).text.startswith("waiting")
                )
                fed, synced_ns = messages().count("WATCHDOG=1"), read_status(tmp_path).synced_ns
                service.wait_for(lambda: messages().count("WATCHDOG=1") >= fed + 3)
                assert read_status(tmp_path).synced_ns == synced_ns
                filler.unlink()
                service.wait_for(lambda: read_status(tmp_path).synced_ns > synced_ns)
                service.stop_service(logger)
    finally:
        subprocess.run(["umount", "-l", card], check=False)
