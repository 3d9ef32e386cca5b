"""State of the machine that matters to a recording: voltage, temperature, room on the card."""

from pathlib import Path

import msgspec

from logger.core.foreign import read_regular
from logger.core.runfile import free_bytes

UNDERVOLTAGE_NOW, UNDERVOLTAGE_SINCE_BOOT = 0x1, 0x10000
"""Bits of get_throttled (Raspberry Pi documentation, `vcgencmd get_throttled`)."""

SYS = Path("/sys")
_MOST_BYTES = 65_536
"""The kernel gives at most a page of memory."""


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
    """What a file of the kernel says; None without it, or where a driver refuses for now."""
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
    """Of the processor, which the kernel gives in thousandths."""
    thousandths = kernel_number(sys / "class/thermal/thermal_zone0/temp")
    return None if thousandths is None else thousandths / 1000.0
