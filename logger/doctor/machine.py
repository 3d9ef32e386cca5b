"""Tests of the machine: supply voltage, disk, where runs are stored, who else holds a port."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from logger.config import PowerSettings
from logger.device.battery import batteries, is_low
from logger.device.check_line import Line
from logger.device.machine import (
    UNDERVOLTAGE_NOW,
    UNDERVOLTAGE_SINCE_BOOT,
    kernel_number,
    kernel_text,
    throttled_bits,
)
from logger.device.mounts import MOUNTINFO, kept_in_memory

THROTTLED_NOW, THROTTLED_SINCE_BOOT = 0x6, 0x60000
"""Bits of get_throttled (Raspberry Pi documentation): frequency capped, and throttled."""

WARM_C, HOT_C = 70.0, 80.0
"""From 80 degrees on the firmware slows the processor down (Raspberry Pi documentation)."""

LOW_PERCENT = 20.0
"""A power bank of this charge is empty within the next walk."""

LOW_BYTES, TOO_LOW_BYTES = 1_000_000_000, 100_000_000
"""Free space: the first holds some days of walks, the second less than a day of one."""


def power(sys: Path = Path("/sys")) -> Line:
    """Undervoltage and throttling, as the firmware of a Raspberry Pi reports them."""
    bits = throttled_bits(sys)
    if bits is None:
        return Line("ok", "power", "not reported by this machine (no Raspberry Pi)")
    advice = "use a 5 V 3 A supply and a good cable; undervoltage restarts modems"
    if bits & UNDERVOLTAGE_NOW:
        return Line("fail", "power", f"undervoltage now: {advice}")
    if bits & UNDERVOLTAGE_SINCE_BOOT:
        return Line("warn", "power", f"there was undervoltage since the start: {advice}")
    if bits & (THROTTLED_NOW | THROTTLED_SINCE_BOOT):
        when = "is" if bits & THROTTLED_NOW else "was"
        text = f"the processor {when} slowed down by heat: recording goes on; give the case air"
        return Line("warn", "power", text)
    return Line("ok", "power", "no undervoltage since the start")


def temperature(sys: Path = Path("/sys")) -> Line:
    """The highest temperature that the kernel knows of the processor."""
    zones = sys.glob("class/thermal/thermal_zone*/temp")
    known = [milli / 1000.0 for zone in zones if (milli := kernel_number(zone)) is not None]
    if not known:
        return Line("ok", "temperature", "not reported by this machine")
    hottest = max(known)
    text = f"{hottest:.0f} degrees Celsius"
    if hottest >= WARM_C:
        advice = "the processor is slowed down" if hottest >= HOT_C else "close to slowing down"
        return Line("warn", "temperature", f"{text}, {advice}: give the case air, keep it shaded")
    return Line("ok", "temperature", text)


def battery(settings: PowerSettings, sys: Path = Path("/sys")) -> Line:
    """Batteries and UPS boards that the kernel knows."""
    seen = batteries(sys)
    limit = settings.stop_percent or settings.stop_volts
    if not seen:
        text = "none that the kernel knows"
        if limit:
            return Line("warn", "battery", f"{text}: [power] in site.toml has no effect")
        return Line("ok", "battery", text)
    text = "; ".join(map(str, seen))
    empty = [b for b in seen if b.percent is not None and b.percent <= LOW_PERCENT]
    if any(is_low(b, settings, rise=True) for b in seen):
        return Line("fail", "battery", f"{text}: too low to record by [power] in site.toml; charge")
    if any(not b.has_supply for b in empty):
        return Line("warn", "battery", f"{text}: charge it before a walk")
    if settings.stop_percent and all(b.percent is None for b in seen):
        text = f"{text}: knows no percentage, so stop_percent has no effect; set stop_volts"
        return Line("warn", "battery", text)
    return Line("ok", "battery", text)


def disk(folder: Path) -> Line:
    """Free space for runs."""
    free = shutil.disk_usage(folder).free
    text = f"{free / 1e9:.1f} GB free in {folder}"
    if free < TOO_LOW_BYTES:
        return Line("fail", "disk", f"{text}: move runs off the card")
    return Line("warn" if free < LOW_BYTES else "ok", "disk", text)


def plug(folder: Path, mountinfo: Path = MOUNTINFO) -> Line:
    """Whether runs survive a power cut."""
    if file_system := kept_in_memory(folder.resolve(), mountinfo.read_text(errors="replace")):
        text = (
            f"runs are stored in memory ({file_system}) and lost at a power cut: "
            "give them a partition (systemd/README.md, Read-only root)"
        )
        return Line("warn", "plug", text)
    return Line("ok", "plug", "runs survive a power cut")


def holders(name: str, port: str, proc: Path = Path("/proc")) -> Iterator[Line]:
    """Other processes that have the port open: usually ModemManager, gpsd or getty."""
    device = os.path.realpath(port)
    for folder in proc.glob("[0-9]*"):
        try:
            is_open = any(os.path.realpath(link) == device for link in (folder / "fd").iterdir())
            program = kernel_text(folder / "comm") or "a process without a name"
        except OSError:  # the process has ended, or belongs to another user
            continue
        if not is_open or int(folder.name) == os.getpid():
            continue
        is_unit = program in {"ModemManager", "gpsd"}
        stop = f"systemctl disable --now {program}" if is_unit else f"kill {folder.name}"
        text = f"{port} is held by {program} (process {folder.name}): sudo {stop}"
        yield Line("fail", name, text)
