"""Tests of the machine, and of a run: whether modem and receiver give what a walk needs."""

import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from logger.config import GpsdSettings, ModemSettings, PowerSettings, SourceSettings
from logger.core.baseline import Baseline, square_of
from logger.core.places import UERE_M
from logger.core.rows import Rows, levels_dbm, numbered_texts, rows_of_each
from logger.core.runfile import Run
from logger.core.runfile.journal import is_recording
from logger.core.runfile.run_names import JOURNAL, first_part
from logger.core.source_tables import GNSS, MODEM
from logger.core.timebase import fit_run
from logger.core.types import (
    DEAD_RECKONING,
    EARLIEST_UTC_NS,
    IMPOSSIBLE_DATE,
    LATEST_UTC_NS,
    UNKNOWN_TIME,
    utc_text,
)
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
from logger.drivers.registry import FAMILIES

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
        for note in run.tables["notes"]:
            if note["code"] == IMPOSSIBLE_DATE.encode():
                return Line("warn", "clock", note["text"].decode())
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
    return unit_line(_systemctl("is-active"), _systemctl("is-enabled"))


def unit_line(active: str, enabled: str) -> Line:
    if (active, enabled) == ("active", "enabled"):
        return Line("ok", "service", "fieldlogger.service is active, and enabled for the next boot")
    if enabled in {"unknown", "not-found"}:  # an older systemctl prints nothing
        return Line("ok", "service", "it is not installed here: start `fieldlogger run` yourself")
    text = f"fieldlogger.service is {active} and {enabled}"
    if active in {"activating", "failed"}:
        text = f"{text}: journalctl -u fieldlogger says what keeps it from recording"
        return Line("fail", "service", text)
    return Line("warn", "service", f"{text}: sudo systemctl enable --now fieldlogger")


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
    for path in folder.glob(f"*{JOURNAL}*"):
        with suppress(PermissionError):  # of another user, who does not record here now
            if is_recording(path):
                return first_part(path)
    return None


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


# --- a run ---

COARSE_M = 15.0
"""Median accuracy of a receiver under open sky is well below this."""

GOOD_SHARE = 0.8
RECENT_FIXES = 10
"""The receiver works if this share of its latest fixes has a position."""

_RECENT_NS = 5 * 10**9  # every receiver lists its satellites once in this time
_USABLE_DBHZ = 25  # of carrier to noise: a satellite that a receiver can use
_ENOUGH = 5  # four satellites give a position; one more to be sure
_FASTEST_MPS = 70.0  # of a car on a motorway
_NOISE_M = 50.0  # reflections among houses move a position this far at once
_DEGREE_M = 111_200.0
_SENTENCE = re.compile(rb"\$(..)GSV,\d+,\d+,\d*((?:,\d*)*)(?:,[0-9A-F])?\*[0-9A-F]{2}")


def fixes_lines(run: Run, fixes: Rows) -> Iterator[Line]:
    """Evaluate fixes of a run, and the satellites in the receiver's latest sentences."""
    yield _fixes_line(fixes, satellites_in_use(run))
    n_jumps, farthest_m = jumps(fixes)
    if n_jumps:
        text = (
            f"the position jumped {n_jumps} times, once by {farthest_m:.0f} m: "
            "reflections between high houses, or a fake signal; walk on and try again"
        )
        yield Line("warn", "jumps", text)


def satellites_in_use(run: Run) -> int | None:
    """Satellites that are received well enough, by the receiver's GSV; None without one."""
    raw = run.tables["raw"]
    receivers = np.append(run.tables["fixes"]["source"], GNSS.encode())
    received = raw[np.isin(raw["source"], receivers) & (raw["sent"] == 0)]
    if not len(received):
        return None
    latest = received[received["t_ns"] >= received["t_ns"][-1] - _RECENT_NS]
    sentences = _SENTENCE.findall(run.bytes_of(latest))
    if not sentences:
        return None
    return len({key for talker, values in sentences for key in _usable(talker, values)})


def _usable(talker: bytes, values: bytes) -> Iterator[tuple[bytes, bytes]]:
    """`values` has number, elevation, azimuth and density of each satellite."""
    fields = values.split(b",")[1:]
    for i in range(0, len(fields) - 3, 4):
        if fields[i + 3].isdigit() and int(fields[i + 3]) >= _USABLE_DBHZ:
            yield talker, fields[i]


def jumps(fixes: Rows) -> tuple[int, float]:
    """Steps of the position that no car makes: number, and the longest in metres."""
    valid = fixes[(fixes["valid"] == 1) & np.isfinite(fixes["lat_deg"])]
    if len(valid) < 2:
        return 0, 0.0
    since_s = np.diff(valid["t_ns"]) / 1e9
    north_m = np.diff(valid["lat_deg"]) * _DEGREE_M
    east_m = np.diff(valid["lon_deg"]) * _DEGREE_M * np.cos(np.radians(valid["lat_deg"][1:]))
    step_m = np.hypot(north_m, east_m)
    is_jump = step_m > _NOISE_M + _FASTEST_MPS * since_s
    return int(np.count_nonzero(is_jump)), float(step_m[is_jump].max(initial=0.0))


def _fixes_line(fixes: Rows, satellites: int | None) -> Line:
    valid = fixes[fixes["valid"] == 1]
    if not len(valid):
        return Line("warn", "gnss", _no_position(satellites))
    recent = valid["quality"][-RECENT_FIXES:]
    if np.mean(recent == DEAD_RECKONING) > 1.0 - GOOD_SHARE:
        text = "positions by dead reckoning get little weight: has the antenna a clear sky?"
        return Line("warn", "gnss", text)
    sigma_m = np.where(np.isfinite(valid["acc_m"]), valid["acc_m"], valid["hdop"] * UERE_M)
    is_known = bool(np.any(np.isfinite(sigma_m)))
    median_m = float(np.nanmedian(sigma_m)) if is_known else 0.0
    accuracy = f"about {median_m:.0f} m" if is_known else "unknown"
    text = f"{len(valid)} of {len(fixes)} fixes with a position, accuracy {accuracy}"
    if np.mean(fixes["valid"][-RECENT_FIXES:]) <= GOOD_SHARE:
        text = f"{text}: it comes and goes, or has just come; wait a minute under open sky"
        return Line("warn", "gnss", text)
    if median_m > COARSE_M:
        return Line("warn", "gnss", f"{text}: has the antenna a clear sky?")
    return Line("ok", "gnss", text)


def _no_position(satellites: int | None) -> str:
    if satellites is None:
        return "the receiver has no position yet: a cold start under open sky takes minutes"
    if satellites < _ENOUGH:
        return f"no position: {satellites} satellites are received; go under open sky"
    return (
        f"no position although {satellites} satellites are received: a cold start takes a minute; "
        "if it lasts, the receiver is jammed or gets a fake signal: try another place"
    )


LOST_DB = 20.0
"""A modem without an antenna receives some 20 dB less; two modems differ by a few."""
WEAK_DBM: Mapping[bytes, float] = {b"GSM": -95.0, b"WCDMA": -105.0, b"LTE": -115.0}
"""Outdoors the strongest cell is seldom so weak, some 10 dB above what a modem can hear."""
_FEWEST = 3
"""Cells that are compared: one alone may have changed."""


def antenna_line(readings: Rows, fixes: Rows, baseline: Baseline | None) -> Line | None:
    """Compare with earlier walks here, else with what is usual outdoors; None without a level."""
    heard = _mean_levels(readings)
    if not heard:
        return None
    differences = _differences(heard, fixes, baseline)
    if len(differences) >= _FEWEST:
        median_db = float(np.median(differences))
        text = f"{len(differences)} cells are {abs(median_db):.0f} dB"
        if median_db <= -LOST_DB:
            text = f"{text} weaker here than on earlier walks: is the antenna connected?"
            return Line("warn", "antenna", text)
        side = "stronger" if median_db > 0 else "weaker"
        return Line("ok", "antenna", f"{text} {side} here than on earlier walks")
    return _absolute(readings)


def _mean_levels(readings: Rows) -> dict[str, float]:
    levels = levels_dbm(readings)
    usable = (readings["cell"] != b"") & np.isfinite(levels)
    names, which = numbered_texts(readings["cell"][usable])
    each = rows_of_each(which)
    return {names[k].decode(): float(np.mean(levels[usable][rows])) for k, rows in each}


def _differences(heard: dict[str, float], fixes: Rows, baseline: Baseline | None) -> list[float]:
    valid = fixes[fixes["valid"] == 1]
    if baseline is None or not len(valid):
        return []
    place = square_of(float(valid["lat_deg"][-1]), float(valid["lon_deg"][-1]))
    known = baseline.square(place).cells
    return [level - known[name].mean_dbm for name, level in heard.items() if name in known]


def _absolute(readings: Rows) -> Line:
    levels = levels_dbm(readings)
    for rat, weak_dbm in WEAK_DBM.items():
        own = levels[(readings["rat"] == rat) & np.isfinite(levels)]
        if not len(own):
            continue
        text = f"strongest {rat.decode()} cell {own.max():.0f} dBm"
        if own.max() < weak_dbm:
            text = f"{text}: weak for a place outdoors; is the antenna connected?"
            return Line("warn", "antenna", text)
        return Line("ok", "antenna", text)
    return Line("ok", "antenna", "no level of GSM, UMTS or LTE to compare")


TRIAL = "doctor"
"""Origin of a run that the doctor records itself."""

LAST_S = 60.0
"""The end of a run that is tested: a slow modem gives several scans in it."""


def run_lines(
    run: Run,
    *,
    sources: Sequence[SourceSettings] = (),
    baseline: Baseline | None = None,
) -> Iterator[Line]:
    """Evaluate the end of a run; `sources` are those of the configuration."""
    tables = run.tables
    end_ns = max((int(rows["t_ns"].max()) for rows in tables.values() if len(rows)), default=0)
    begin_ns = max(run.meta.started_ns, end_ns - round(LAST_S * 1e9))
    minutes = max(end_ns - begin_ns, 1) / 60e9
    scans, readings, fixes = (
        tables[name][tables[name]["t_ns"] >= begin_ns] for name in ("scans", "readings", "fixes")
    )
    names = [source.name for source in sources if source.gives_cells] or [MODEM]
    for name in names:
        notes = _notes_of(run, name)
        # a port is opened again and again while its modem gives no answer
        said = [note for note in notes if note[0] != "port-opened"] or notes
        event = said[-1][1] if said else ""
        n_scans = np.count_nonzero(scans["source"] == name.encode())
        # of one modem the line of the readings says it
        is_deaf = len(names) > 1 and name.encode() not in readings["source"]
        if n_scans and is_deaf:
            yield Line("warn", name, "no cell in any scan: is its antenna connected?")
        elif n_scans:
            yield Line("ok", name, f"{n_scans / minutes:.0f} scans a minute; {event}")
        else:
            yield Line("fail", name, f"no scan; last event: {event or 'none'}")
    every = [note for name in names for note in _notes_of(run, name)]
    modes = [one.set_mode for one in sources if isinstance(one, ModemSettings)]
    set_mode = next(filter(None, modes), "")
    yield _readings_line(readings, minutes, every, run.meta.origin == TRIAL, set_mode)
    if (antenna := antenna_line(readings, fixes, baseline)) is not None:
        yield antenna
    if len(fixes):
        yield from fixes_lines(run, fixes)
    else:
        yield Line("fail", "gnss", f"nothing received: {_doubt(sources)}")


def _doubt(sources: Sequence[SourceSettings]) -> str:
    receiver = next((source for source in sources if source.gives_positions), None)
    if isinstance(receiver, GpsdSettings):
        return "does gpsd run, and gpsmon show a receiver?"
    is_own = receiver is not None and receiver.gives_cells
    doubt = "has this modem a receiver" if is_own else "right port and baud"
    return f"{doubt}? see fieldlogger probe"


def _notes_of(run: Run, modem: str) -> list[tuple[str, str]]:
    return [
        (row["code"].decode(), row["text"].decode())
        for row in run.tables["notes"]
        if row["source"] == modem.encode()
    ]


def _readings_line(
    readings: Rows, minutes: float, notes: list[tuple[str, str]], is_trial: bool, set_mode: str
) -> Line:
    usable = (readings["cell"] != b"") & np.isfinite(levels_dbm(readings))
    cells = len(np.unique(readings["cell"][usable]))
    if cells:
        text = f"{np.count_nonzero(usable) / minutes:.0f} usable a minute, of {cells} cells"
    else:
        text = "no cell with identity and level: antenna connected? 2G here? SIM locked by its PIN?"
    others = _other_technologies(readings)
    if others:
        text = f"{text}; {others}; {_gsm_only(notes, set_mode)}"
    # a trial leaves the modem's mode alone, which the service will set
    is_set_later = is_trial and set_mode
    state: State = "warn" if not cells or (others and not is_set_later) else "ok"
    return Line(state, "readings", text)


def _other_technologies(readings: Rows) -> str:
    received = sorted({rat.decode() for rat in readings["rat"]} - {""})
    if not received or "GSM" in received:
        return ""
    return f"only {' and '.join(received)}: a 2G catcher would not be recorded"


def _gsm_only(notes: list[tuple[str, str]], set_mode: str) -> str:
    refusals = [text for code, text in notes if code == "mode-unchanged"]
    if refusals:
        return refusals[-1]
    if set_mode:
        return f'`fieldlogger run` sets it to GSM only (set_mode = "{set_mode}")'
    drivers = [text.rpartition(" ")[2] for code, text in notes if code == "modem-ready"]
    driver = FAMILIES.get(drivers[-1]) if drivers else None
    if driver is None or not driver.mode_commands:
        return "the driver has no command for GSM only: set the modem by hand, or use another"
    commands = " or ".join(command.set_to(command.gsm_only) for command in driver.mode_commands)
    return f'set_mode = "gsm" ({commands})'
