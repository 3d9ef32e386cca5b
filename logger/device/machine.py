"""State of the machine that matters to a recording: voltage, temperature, room and kind of card."""

import re
from pathlib import Path
from typing import NamedTuple

import msgspec

from logger.core.foreign import read_regular
from logger.core.runfile import free_bytes

UNDERVOLTAGE_NOW, UNDERVOLTAGE_SINCE_BOOT = 0x1, 0x10000
"""Bits of get_throttled (Raspberry Pi documentation, `vcgencmd get_throttled`)."""

SYS = Path("/sys")
_MOST_BYTES = 65_536
"""The kernel gives at most a page of memory."""
MOUNTINFO = Path("/proc/self/mountinfo")


class Machine(msgspec.Struct, frozen=True):
    """What is unknown here is None; `undervoltage` is "now", "since the start" or "none"."""

    free_bytes: int | None = None
    temperature_c: float | None = None
    undervoltage: str | None = None


def machine(folder: Path, sys: Path = SYS) -> Machine:
    """The machine now; `folder` is where runs are stored."""
    try:
        free = free_bytes(folder)
    except OSError:
        free = None
    return Machine(free, _temperature_c(sys), _undervoltage(throttled_bits(sys)))


def throttled_bits(sys: Path = SYS) -> int | None:
    """What the firmware of a Raspberry Pi reports; None elsewhere."""
    bits = kernel_number(sys / "devices/platform/soc/soc:firmware/get_throttled", 16)
    return None if bits is None else int(bits)


def kernel_text(path: Path) -> str | None:
    """What a file of the kernel says; None without it, or where a driver refuses."""
    try:
        return read_regular(path, _MOST_BYTES).decode(errors="replace").strip()
    except OSError:
        return None


def kernel_number(path: Path, base: int = 10) -> float | None:
    """The integer in a file of the kernel; None where there is none."""
    try:
        return float(int(kernel_text(path) or "", base))
    except (ValueError, OverflowError):
        return None


def _undervoltage(bits: int | None) -> str | None:
    if bits is None:
        return None
    if bits & UNDERVOLTAGE_NOW:
        return "now"
    return "since the start" if bits & UNDERVOLTAGE_SINCE_BOOT else "none"


def _temperature_c(sys: Path) -> float | None:
    """Of the processor; the kernel gives thousandths."""
    thousandths = kernel_number(sys / "class/thermal/thermal_zone0/temp")
    return None if thousandths is None else thousandths / 1000.0


class _Mount(NamedTuple):
    kind: str
    point: str
    options: str


def kept_in_memory(folder: Path, mountinfo: str) -> str:
    """Kind and mount point of the file system in memory that holds a folder; empty for a card.

    `mountinfo` is the text of /proc/self/mountinfo (proc(5)), the folder's path is without links.
    An overlay stores in its upper folder; if that is invisible, an initramfs mounted it, which has
    only memory.
    """
    mounts = {
        mount.point: mount for mount in map(_mount, mountinfo.splitlines())
    }  # the last one on a point counts
    mount = _under(folder, mounts)
    upper = re.search("upperdir=([^,]+)", mount.options)
    if mount.kind == "overlay" and upper:
        hidden = _under(Path(upper[1]), mounts) == mount
        return f"overlay at {mount.point}" if hidden else kept_in_memory(Path(upper[1]), mountinfo)
    return f"{mount.kind} at {mount.point}" if mount.kind in {"tmpfs", "ramfs"} else ""


def _mount(line: str) -> _Mount:
    """Parse `36 35 98:0 /root /point rw,noatime master:1 - ext4 /dev/source rw,option=value`.

    Blanks in names are octal escapes.
    """
    here, there = (part.split() for part in line.split(" - ", 1))
    return _Mount(
        there[0], re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), here[4]), there[-1]
    )


def _under(path: Path, mounts: dict[str, _Mount]) -> _Mount:
    """In a chroot the root of a path may be no mount, and of no known kind."""
    holding = (mounts[str(one)] for one in (path, *path.parents) if str(one) in mounts)
    return next(holding, _Mount("", "/", ""))
