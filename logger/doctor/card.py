"""Tests of the card: how fast records become durable, and what it says of its own health."""

import os
import tempfile
import time
from pathlib import Path

from logger.device.check_line import Line

_BLOCK = 65_536
_BLOCKS = 32
_SLOW_S, _TOO_SLOW_S = 0.5, 2.0
"""The recorder flushes once a second; while a flush takes longer, records wait in memory."""
_WORN_LIFE = 0x0A
"""JESD84-B51 7.4.113: 0x0A is 90 to 100 % of the estimated life time used, 0x0B is more."""
_URGENT = 3
"""PRE_EOL_INFO, the same standard: 2 is 80 % of the reserved blocks used, 3 is 90 %."""


def speed(folder: Path) -> Line:
    """The time of the slowest durable write of 64 kB into the folder of the runs, of 2 MB."""
    try:
        slowest_s, total_s = _write_times(folder)
    except OSError as error:
        return Line("fail", "card speed", f"{folder} cannot be written: {error.strerror}")
    rate = _BLOCK * _BLOCKS / 1e6 / max(total_s, 1e-6)
    text = f"{rate:.1f} MB/s, slowest write of 64 kB {slowest_s * 1e3:.0f} ms"
    if slowest_s > _TOO_SLOW_S:
        return Line("fail", "card speed", f"{text}: use another card (class A1 or better)")
    if slowest_s > _SLOW_S:
        return Line("warn", "card speed", f"{text}: the card is slow, records wait in memory")
    return Line("ok", "card speed", text)


def _write_times(folder: Path) -> tuple[float, float]:
    block, slowest_s = os.urandom(_BLOCK), 0.0
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".doctor-", buffering=0) as file:
        begin_s = time.monotonic()
        for _ in range(_BLOCKS):
            before_s = time.monotonic()
            file.write(block)
            os.fdatasync(file.fileno())
            slowest_s = max(slowest_s, time.monotonic() - before_s)
        return slowest_s, time.monotonic() - begin_s


def health(folder: Path, sys: Path = Path("/sys")) -> Line:
    """Errors of the file system and, of a device that reports it, the life time used."""
    device = folder.stat().st_dev
    block = (sys / f"dev/block/{os.major(device)}:{os.minor(device)}").resolve()
    errors = _number(sys / "fs/ext4" / block.name / "errors_count")
    if errors:
        text = f"the file system has met {errors} errors: save the runs and use another card"
        return Line("fail", "card health", text)
    disk = block.parent if (block / "partition").exists() else block
    life = max((_number(disk / "device/life_time", i, 16) or 0 for i in (0, 1)), default=0)
    reserve = _number(disk / "device/pre_eol_info", 0, 16) or 0
    if life >= _WORN_LIFE or reserve >= _URGENT:
        return Line("warn", "card health", "the card reports that it is worn out: use another one")
    if errors is None and not life:
        return Line("ok", "card health", "not reported by this device")
    return Line("ok", "card health", "no errors" + (f", {life * 10} % used" if life else ""))


def _number(path: Path, field: int = 0, base: int = 10) -> int | None:
    try:
        return int(path.read_text().split()[field], base)
    except (OSError, ValueError, IndexError):
        return None
