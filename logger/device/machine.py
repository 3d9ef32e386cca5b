"""State of the machine that matters to a recording: voltage, temperature, room on the card."""

from pathlib import Path

import msgspec

from logger.core.runfile import free_bytes

UNDERVOLTAGE_NOW, UNDERVOLTAGE_SINCE_BOOT = 0x1, 0x10000
"""Bits of get_throttled (Raspberry Pi documentation, `vcgencmd get_throttled`)."""

SYS = Path("/sys")


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
    try:
        return int((sys / "devices/platform/soc/soc:firmware/get_throttled").read_text(), 16)
    except (OSError, ValueError):
        return None


def _undervoltage(bits: int | None) -> str | None:
    if bits is None:
        return None
    if bits & UNDERVOLTAGE_NOW:
        return "now"
    return "since the start" if bits & UNDERVOLTAGE_SINCE_BOOT else "none"


def _temperature_c(sys: Path) -> float | None:
    """Of the processor, which the kernel gives in thousandths."""
    try:
        return int((sys / "class/thermal/thermal_zone0/temp").read_text()) / 1000.0
    except (OSError, ValueError):
        return None
