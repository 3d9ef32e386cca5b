"""Machines of the boot rig with the logger installed, and queries of their state."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
RIG = REPOSITORY.parent / "shared/bootrig"
CACHE = Path(os.environ.get("CELLWALK_BOOT_CACHE", "~/.cache/cellwalk-boot")).expanduser()
BOARD = os.environ.get("CELLWALK_BOARD", "amd64")
USB = {"modem": "MODEM01", "gps": "GPS01"}
RUNS = "/var/lib/cellwalk"
BOOT_S = 540.0
"""Longest boot of a busy machine without KVM."""

sys.path.append(str(RIG))
rig = pytest.importorskip("rig", reason="the boot rig is not beside this repository")


PACKAGES = "apt,overlayroot,busybox"
"""apt, as every Debian has it, and what Raspberry Pi OS makes a root read-only with."""


def image_folder(packages: str = PACKAGES) -> Path:
    """Folder of the image with these packages besides those of the rig, and of its kernel."""
    return CACHE / packages.replace(",", "-")


def build_image(packages: str = PACKAGES) -> Path:
    """The image with these packages, built once; skips where that cannot be done."""
    board, folder = rig.BOARDS[BOARD], image_folder(packages)
    if shutil.which(board["qemu"][0]) is None:
        pytest.skip(f"no {board['qemu'][0]} here")
    image = folder / f"base-{board['arch']}.raw"
    if not image.exists() and os.getuid() != 0:
        pytest.skip("only root can build the image of the boot rig")
    subprocess.run(
        [RIG / "build_image.sh", folder, board["arch"]],
        check=True,
        env=os.environ | {"EXTRA_PACKAGES": packages},
    )
    return image


def build_packages() -> Path:
    """Folder of the logger's package and of all that it needs, without a network."""
    arch = rig.BOARDS[BOARD]["arch"]
    command = ["make", "-C", REPOSITORY, "card-debs", f"ARCH={arch}", "SUITE=bookworm"]
    subprocess.run(command, check=True)
    return REPOSITORY / f"dist/card-bookworm-{arch}"


def machine(card, folder: Path, share: Path | None = None, kernel: Path | None = None):
    """A machine with both adapters; to be used in a `with`.

    `kernel` is the folder of the kernel and its initrd, if not those of the image.
    """
    return rig.Machine(card, kernel or image_folder(), folder, board=BOARD, usb=USB, share=share)


def status(m) -> dict:
    """Content of status.json; empty while there is no such file."""
    text = m.run("cat /run/cellwalk/status.json", check=False)
    return json.loads(text) if text.startswith("{") else {}


def wait_recording(m, more_fixes: int = 0, seconds: float = 180.0) -> None:
    """Wait until the logger records positions, and then for more of them."""
    end_s, wanted = time.monotonic() + seconds, None
    while True:
        now = status(m)
        if now.get("state") == "recording" and wanted is None:
            wanted = now["fixes"] + more_fixes
        if wanted is not None and now.get("fixes", 0) >= wanted:
            return
        assert time.monotonic() < end_s, now or m.run(
            "journalctl -b -u fieldlogger | tail", check=False
        )
        time.sleep(1.0)


def boottime_zero_s(m) -> float:
    """The host's monotonic time when CLOCK_BOOTTIME of the guest was 0.

    The value is never late, and early by milliseconds.
    """
    zeros = []
    for _ in range(5):
        asked_s = time.monotonic()
        zeros.append(asked_s - float(m.run("cut -d' ' -f1 /proc/uptime")))
    return max(zeros)
