"""Tests of the machine: supply voltage, disk, where runs are stored, who else holds a port."""

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from logger.config import PowerSettings
from logger.core.runfile import Run
from logger.core.runfile.journal import is_recording
from logger.core.runfile.run_names import JOURNAL, first_part
from logger.core.timebase import fit_run
from logger.core.types import EARLIEST_UTC_NS, LATEST_UTC_NS, UNKNOWN_TIME, utc_text
from logger.device.battery import batteries, is_low
from logger.device.link import Line, State
from logger.device.machine import (
    MOUNTINFO,
    UNDERVOLTAGE_NOW,
    UNDERVOLTAGE_SINCE_BOOT,
    kept_in_memory,
    kernel_number,
    kernel_text,
    throttled_bits,
)
from logger.device.status import Status, status_age_s

THROTTLED_NOW, THROTTLED_SINCE_BOOT = 0x6, 0x60000
"""Bits of get_throttled (Raspberry Pi documentation): frequency capped, and throttled."""

WARM_C, HOT_C = 70.0, 80.0
"""From 80 degrees on the firmware slows the processor down (Raspberry Pi documentation)."""

LOW_PERCENT = 20.0
"""A power bank of this charge is empty within the next walk."""

LOW_BYTES, TOO_LOW_BYTES = 1_000_000_000, 100_000_000
"""Free space: for some days of walks, and for less than a day of one."""


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


_CLOSE_S = 5.0


def wall_minus_boot_ns() -> int:
    """UTC by the machine's clock at a time since boot of 0."""
    return time.clock_gettime_ns(time.CLOCK_REALTIME) - time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def clock_line(run: Run, wall_ns: int) -> Line:
    """Compare the receiver's UTC with the machine's clock; `wall_ns` is `wall_minus_boot_ns`."""
    fixes = run.tables["fixes"]
    valid = fixes[(fixes["valid"] == 1) & (fixes["utc_ns"] != UNKNOWN_TIME)]
    if not len(valid):
        return Line("ok", "clock", "no time from the receiver yet; the machine's clock is not used")
    utc_ns = int(valid["utc_ns"][-1])
    if not EARLIEST_UTC_NS <= utc_ns < LATEST_UTC_NS:
        text = f"the receiver reports {utc_text(utc_ns)}: the date of its runs will be unknown"
        return Line("warn", "clock", text)
    timebase = fit_run(run.meta.origin, fixes)
    if timebase is None:
        text = "the receiver's times contradict each other: a bad connection, or a fake signal"
        return Line("warn", "clock", text)
    off_s = (wall_ns - timebase.utc_ns(0)) / 1e9
    if abs(off_s) <= _CLOSE_S:
        return Line("ok", "clock", "the machine's clock agrees with the receiver")
    days, seconds = divmod(abs(off_s), 86_400)
    amount = f"{days:.0f} days" if days else f"{seconds:.0f} s"
    side = "ahead of" if off_s > 0 else "behind"
    text = f"the machine's clock is {amount} {side} the receiver; runs take their time from it"
    return Line("ok", "clock", text)


_BLOCK = 65_536
_BLOCKS = 32
_SLOW_S, _TOO_SLOW_S = 0.5, 2.0
"""The recorder flushes once a second; while a flush takes longer, records wait in memory."""
_WORN_LIFE = 0x0A
"""JESD84-B51 7.4.113: 0x0A is 90 to 100 % of the estimated life time used, 0x0B is more."""
_URGENT = 3
"""PRE_EOL_INFO, the same standard: 2 is 80 % of the reserved blocks used, 3 is 90 %."""


def speed(folder: Path) -> Line:
    """Time of the slowest of durable writes of 64 kB, 2 MB in all, into the runs' folder."""
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
    """Errors of the file system and, if reported, the life time used."""
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


MAX_AGE_S = 5.0
"""A working service writes its status, and its records to the card, every second."""


def unit() -> Line:
    """Whether systemd runs the logger and starts it at the next boot."""
    if not Path("/run/systemd/system").is_dir():
        return Line("ok", "service", "no systemd here: start `fieldlogger run` yourself")
    active, enabled = _systemctl("is-active"), _systemctl("is-enabled")
    if (active, enabled) == ("active", "enabled"):
        return Line("ok", "service", "fieldlogger.service is active, and enabled for the next boot")
    text = f"fieldlogger.service is {active} and {enabled}: systemctl enable --now fieldlogger"
    return Line("warn", "service", text)


def _systemctl(verb: str) -> str:
    done = subprocess.run(  # noqa: S603
        ["systemctl", verb, "fieldlogger.service"],  # noqa: S607
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout.strip() or "unknown"


def open_journal(folder: Path) -> Path | None:
    """The journal in a folder that a logger is writing, None without one."""
    journals = (first_part(path) for path in folder.glob(f"*{JOURNAL}*") if is_recording(path))
    return next(journals, None)


def status_lines(status: Status) -> Iterator[Line]:
    """What the status of a running service means."""
    age = status_age_s(status)
    if age > MAX_AGE_S:
        text = f"the service has not reported for {age:.0f} s: systemctl restart fieldlogger"
        yield Line("fail", "status", text)
        return
    states: dict[str, State] = {"error": "fail", "no fix": "warn"}
    yield Line(states.get(status.state, "ok"), "status", f"{status.state}: {status.text}")
    if status.no_estimate:
        yield Line("warn", "estimate", f"{status.no_estimate}; the recording goes on")
    for reason in status.left_out:
        yield Line("warn", "estimate", reason)
    synced_ns = status.since_ns if status.synced_ns is None else status.synced_ns
    unsynced_s = (status.now_ns - synced_ns) / 1e9
    yield Line(
        "fail" if unsynced_s > MAX_AGE_S else "ok",
        "card",
        f"all records up to {unsynced_s:.1f} s ago are on the card",
    )
    yield Line(
        "warn" if status.waiting > status.room / 2 else "ok",
        "queue",
        f"{status.waiting} of {status.room} records wait for the card",
    )
    for name, port in status.ports.items():
        if not port.is_open:
            yield Line("fail", name, port.event or f"{port.url} is not open")
