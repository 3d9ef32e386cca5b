import os
import time

import pytest

from logger.doctor import single_tests as machine


def test_a_real_folder_has_a_speed_and_nothing_is_left_in_it(tmp_path):
    line = machine.speed(tmp_path)
    assert "MB/s, slowest write of 64 kB" in line.text
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("wait_s", "state"), [(0.0, "ok"), (0.4, "warn"), (1.1, "fail")])
def test_a_slow_card_is_reported(tmp_path, monkeypatch, wait_s, state):
    flushes = []

    def slow(descriptor):
        """Waits only as long as the case says: the card of the machine may be busy."""
        flushes.append(descriptor)
        time.sleep(wait_s * (len(flushes) == 3))

    monkeypatch.setattr(machine, "_SLOW_S", 0.3)
    monkeypatch.setattr(machine, "_TOO_SLOW_S", 1.0)
    monkeypatch.setattr(os, "fdatasync", slow)
    assert machine.speed(tmp_path).state == state


def test_a_folder_that_takes_no_file(tmp_path):
    assert machine.speed(tmp_path / "none").state == "fail"


@pytest.mark.parametrize(
    ("files", "state", "says"),
    [
        ({}, "ok", "not reported"),
        ({"errors_count": "0"}, "ok", "no errors"),
        ({"errors_count": "3"}, "fail", "3 errors"),
        ({"life_time": "0x02 0x01"}, "ok", "20 % used"),
        ({"life_time": "0x02 0x0b"}, "warn", "worn out"),
        ({"pre_eol_info": "0x03"}, "warn", "worn out"),
        ({"life_time": "junk"}, "ok", "not reported"),
    ],
)
def test_health_as_the_kernel_shows_it(tmp_path, files, state, says):
    """A card with a partition, in a tree as that of /sys."""
    sys, device = tmp_path / "sys", os.stat(tmp_path).st_dev
    disk = sys / "devices/block/mmcblk0"
    (disk / "mmcblk0p2").mkdir(parents=True)
    (disk / "mmcblk0p2/partition").write_text("2\n")
    (disk / "device").mkdir()
    (sys / "fs/ext4/mmcblk0p2").mkdir(parents=True)
    (sys / "dev/block").mkdir(parents=True)
    link = sys / f"dev/block/{os.major(device)}:{os.minor(device)}"
    link.symlink_to(disk / "mmcblk0p2")
    for name, value in files.items():
        folder = sys / "fs/ext4/mmcblk0p2" if name == "errors_count" else disk / "device"
        (folder / name).write_text(value + "\n")
    line = machine.health(tmp_path, sys)
    assert (line.state, says in line.text) == (state, True), line
