from pathlib import Path

import pytest

from logger.device.machine import MOUNTINFO, Machine, kept_in_memory, machine

CARD = r"""
22 1 179:2 / / rw,noatime shared:1 - ext4 /dev/mmcblk0p2 rw
25 22 0:23 / /run rw,nosuid shared:5 - tmpfs tmpfs rw,size=184688k
31 22 179:3 / /var/lib/cellwalk rw,noatime - ext4 /dev/mmcblk0p3 rw
40 22 0:40 / /media/a\040stick rw - vfat /dev/sda1 rw
""".strip()
OVERLAID = """
30 1 0:27 / / rw,relatime shared:1 - overlay o rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/o
27 30 179:2 / /media/root-ro ro shared:2 - ext4 /dev/mmcblk0p2 ro
28 30 0:26 / /media/root-rw rw shared:3 - tmpfs tmpfs-root rw
""".strip()


def test_a_pi_says_what_it_has(tmp_path):
    throttled = tmp_path / "devices/platform/soc/soc:firmware/get_throttled"
    throttled.parent.mkdir(parents=True)
    zone = tmp_path / "class/thermal/thermal_zone0"
    zone.mkdir(parents=True)
    (zone / "temp").write_text("51540\n")
    for bits, word in (("0\n", "none"), ("50000\n", "since the start"), ("50005\n", "now")):
        throttled.write_text(bits)
        found = machine(tmp_path, tmp_path)
        assert (found.undervoltage, found.temperature_c) == (word, 51.54)
    assert found.free_bytes > 0


def test_what_is_unknown_is_none(tmp_path):
    assert machine(tmp_path / "none", tmp_path) == Machine()


@pytest.mark.parametrize(
    ("folder", "mountinfo", "where"),
    [
        ("/var/lib/cellwalk", CARD, ""),
        ("/home/walker/runs", CARD, ""),
        ("/media/a stick/runs", CARD, ""),
        ("/run/runs", CARD, "tmpfs at /run"),
        ("/var/lib/cellwalk", OVERLAID, "tmpfs at /media/root-rw"),
        ("/media/root-ro/runs", OVERLAID, ""),
        # a partition of its own, overlaid or not
        ("/var/lib/cellwalk",
         f"{OVERLAID}\n31 30 179:3 / /var/lib/cellwalk rw - ext4 /dev/mmcblk0p3 rw", ""),
        ("/runs",
         f"{OVERLAID}\n31 30 0:9 / /runs rw - overlay o rw,lowerdir=/a,upperdir=/media/root-rw/b",
         "tmpfs at /media/root-rw"),
        # mounted by an initramfs that has hidden its upper folder
        ("/var",
         "30 1 0:27 / / rw - overlay overlay rw,lowerdir=/lower,upperdir=/upper/data",
         "overlay at /"),
        # in a chroot, whose root is not listed
        ("/var/lib/cellwalk", CARD.split("\n", 1)[1], ""),
        # mounted over a card
        ("/var/lib/cellwalk", f"{CARD}\n50 31 0:50 / /var/lib/cellwalk rw - tmpfs t rw",
         "tmpfs at /var/lib/cellwalk"),
    ],
)  # fmt: skip
def test_what_a_folder_is_kept_on(folder, mountinfo, where):
    assert kept_in_memory(Path(folder), mountinfo) == where


def test_this_machine():
    mountinfo = MOUNTINFO.read_text()
    shared = Path("/dev/shm")
    if not shared.is_mount():
        pytest.skip("no /dev/shm here")
    assert kept_in_memory(shared, mountinfo) == "tmpfs at /dev/shm"
    assert kept_in_memory(Path("/proc/self"), mountinfo) == ""
