"""`fieldlogger doctor`: is it working? Each line ok, warn or fail, with what to do; the last one is
of them all.
"""

import os
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec
import numpy as np

from logger.check import NOT_THERE, Line, State, check, site_config
from logger.config import SiteConfig
from logger.core.censoring import levels_dbm
from logger.core.errors import DeviceError
from logger.core.rows import Rows
from logger.core.runfile import Run, read_run
from logger.core.runfile.journal_file import is_recording
from logger.core.runfile.run_names import JOURNAL, first_part
from logger.core.track import UERE_M
from logger.core.types import DEAD_RECKONING
from logger.device.clock import SystemClock
from logger.device.mode_switch import left_changed
from logger.device.mounts import MOUNTINFO, kept_in_memory
from logger.device.port import Port
from logger.device.saved_modes import KeptModes
from logger.device.service import Service
from logger.device.startup import begin_run, usable_folder
from logger.device.status import FOLDER, Status, read_status, status_folder
from logger.drivers.family import wake
from logger.drivers.protocols.dialogue import Command, Dialogue
from logger.drivers.registry import FAMILIES
from logger.probe import converse

TRIAL = "doctor"
TRIAL_S = 15.0
"""The modem is set up and polled some times, and a receiver speaks, within this time."""
LAST_S = 60.0
_TELLS_EACH_S = 5.0
"""A service that is well tells more often, and its card takes what there is more often."""
_LITTLE_BYTES, _TOO_LITTLE_BYTES = 1_000_000_000, 100_000_000
_COARSE_M = 15.0
_MOST_VALID = 0.8
_RECENT_FIXES = 10
"""A receiver that has found its position just now is well."""
_NEEDED = frozenset({"status", "card", "queue", "modem", "mode", "readings", "gnss"})
"""A warning of these means that a walk would not be recorded as it should."""
_PORTS = frozenset({"modem", "gnss"})


def examine(config_path: Path, seconds: float = TRIAL_S) -> Iterator[Line]:
    """Lines as they are found; raises `ConfigError` for a configuration that cannot be used.

    Where the service records, its run is looked at; where not, it is run for some seconds into a
    temporary folder. The last line says whether one may walk.
    """
    lines = []
    for line in _examined(config_path, seconds):
        lines.append(line)
        yield line
    yield overall(lines)


def overall(lines: Iterable[Line]) -> Line:
    """What all lines mean to the walker: go, or what to do first."""
    every = list(lines)
    fails = [line for line in every if line.state == "fail"]
    waits = [line for line in every if line.state == "warn" and line.what in _NEEDED]
    if not fails and not waits:
        others = ", ".join(line.what for line in every if line.state == "warn")
        return Line(
            "ok", "overall", "ready to walk" + (f"; to be seen to: {others}" if others else "")
        )
    first, *more = [*fails, *waits]
    text = f"{first.what}: {first.text}" + (f" (and {len(more)} more above)" if more else "")
    if any(
        line.what in _PORTS and (line.state == "fail" or NOT_THERE in line.text)
        for line in (first, *more)
    ):
        text += "; `fieldlogger probe --write site.toml` finds the ports"
    if fails:
        return Line("fail", "overall", f"not ready to walk: {text}")
    return Line("warn", "overall", f"not yet ready to walk: {text}")


def _examined(config_path: Path, seconds: float) -> Iterator[Line]:
    """The lines before the last."""
    config = site_config(config_path)
    yield from check(config_path)
    yield power()
    folder = usable_folder(config.run.directory)
    yield disk(folder)
    yield plug(folder)
    yield service()
    journal = recording(folder)
    try:
        told = read_status(status_folder() or FOLDER)
    except OSError as error:
        told = None
        yield Line("warn", "status", f"{error}: run this with sudo, or join the group cellwalk")
    if told is not None:
        yield from of_status(told)
        journal = Path(told.run)
    if journal is not None:
        yield Line(
            "ok",
            "recording",
            f"{journal.name} is being written; the lines below are its last {LAST_S:.0f} s",
        )
        yield from of_run(read_run(journal), set_mode=config.modem.set_mode)
        return
    if left := left_changed(KeptModes(folder), FAMILIES.get):
        yield Line("warn", "mode", left)
    for name, url in (("modem", config.modem.port), ("gnss", config.gnss.port)):
        if url.startswith("/"):
            yield from holders(name, url)
    yield sim_card(config)
    with tempfile.TemporaryDirectory(prefix="fieldlogger-doctor-") as temporary:
        yield from of_run(_trial(config, temporary, seconds), set_mode=config.modem.set_mode)


def power(sys: Path = Path("/sys")) -> Line:
    """Undervoltage, as the firmware of a Raspberry Pi tells it."""
    throttled = sys / "devices/platform/soc/soc:firmware/get_throttled"
    try:
        bits = int(throttled.read_text(), 16)
    except (OSError, ValueError):
        return Line("ok", "power", "this machine does not tell (no Raspberry Pi)")
    advice = "use a supply and a cable for 5 V 3 A; brown-outs restart modems"
    if bits & 0x1:
        return Line("fail", "power", f"undervoltage now: {advice}")
    if bits & 0x10000:
        return Line("warn", "power", f"there was undervoltage since the start: {advice}")
    return Line("ok", "power", "no undervoltage since the start")


def disk(folder: Path) -> Line:
    """Room for runs."""
    free = shutil.disk_usage(folder).free
    text = f"{free / 1e9:.1f} GB free in {folder}"
    if free < _TOO_LITTLE_BYTES:
        return Line("fail", "disk", f"{text}: take runs off the card")
    return Line("warn" if free < _LITTLE_BYTES else "ok", "disk", text)


def plug(folder: Path, mountinfo: Path = MOUNTINFO) -> Line:
    """Whether a pulled plug takes the runs."""
    if where := kept_in_memory(folder.resolve(), mountinfo.read_text()):
        advice = (
            "give them a partition of their own (systemd/README.md, Read-only root)"
        )
        return Line(
            "warn", "plug", f"runs are kept in memory ({where}), a pulled plug takes them: {advice}"
        )
    return Line("ok", "plug", "runs are kept when it is pulled")


def service() -> Line:
    """Whether systemd runs the logger and will at the next boot."""
    if not Path("/run/systemd/system").is_dir():
        return Line("ok", "service", "no systemd here: start `fieldlogger run` yourself")
    said = [_systemctl(verb) for verb in ("is-active", "is-enabled")]
    if said == ["active", "enabled"]:
        return Line("ok", "service", "fieldlogger.service is active, and enabled for the next boot")
    return Line(
        "warn",
        "service",
        f"fieldlogger.service is {said[0]} and {said[1]}: systemctl enable --now fieldlogger",
    )


def _systemctl(verb: str) -> str:
    done = subprocess.run(  # noqa: S603
        ["systemctl", verb, "fieldlogger.service"],  # noqa: S607
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout.strip() or "unknown"


def recording(folder: Path) -> Path | None:
    """The journal that some logger holds open."""
    held = (first_part(path) for path in folder.glob(f"*{JOURNAL}*") if is_recording(path))
    return next(held, None)


def of_status(told: Status) -> Iterator[Line]:
    """What a running service says of itself."""
    age_s = (SystemClock().now_ns() - told.now_ns) / 1e9
    if age_s > _TELLS_EACH_S:
        yield Line(
            "fail",
            "status",
            f"the service has said nothing for {age_s:.0f} s: systemctl restart fieldlogger",
        )
        return
    state: State = "fail" if told.state == "error" else "warn" if told.state == "no fix" else "ok"
    yield Line(state, "status", f"{told.state}: {told.text}")
    card_s = (told.now_ns - (told.since_ns if told.synced_ns is None else told.synced_ns)) / 1e9
    yield Line(
        "fail" if card_s > _TELLS_EACH_S else "ok",
        "card",
        f"has taken everything up to {card_s:.1f} s ago",
    )
    full = told.waiting > told.room / 2
    yield Line(
        "warn" if full else "ok",
        "queue",
        f"{told.waiting} of {told.room} records wait for the card",
    )
    for name, port in told.ports.items():
        if not port.is_open:
            yield Line("fail", name, port.event or f"{port.url} is not open")


def holders(name: str, port: str, proc: Path = Path("/proc")) -> Iterator[Line]:
    """Who else has the port open: ModemManager, gpsd and getty are the usual ones."""
    device = os.path.realpath(port)
    for folder in proc.glob("[0-9]*"):
        try:
            held = any(os.path.realpath(link) == device for link in (folder / "fd").iterdir())
            who = (folder / "comm").read_text().strip()
        except OSError:  # gone meanwhile, or another user's
            continue
        if held and int(folder.name) != os.getpid():
            stop = (
                f"systemctl disable --now {who}"
                if who in {"ModemManager", "gpsd"}
                else f"kill {folder.name}"
            )
            yield Line(
                "fail", name, f"{port} is held by {who} (process {folder.name}): sudo {stop}"
            )


def sim_card(config: SiteConfig) -> Line:
    """What the modem says of its SIM, which it need not have."""
    try:
        with Port(config.modem.port, config.modem.baud, 0.1) as port:
            said = converse(port, _sim_state())
    except DeviceError as error:
        return Line("fail", "modem", str(error))
    if said is None:
        return Line(
            "fail",
            "modem",
            "gives no answer to AT: powered? right port and baud? see fieldlogger probe",
        )
    return Line("ok", "SIM", f"{said} (none is needed to listen)")


def _sim_state() -> Dialogue[str | None]:
    if not (yield from wake()):
        return None
    yield Command("AT+CMEE=2")
    reply = yield Command("AT+CPIN?", timeout_s=5.0)
    if reply.final is None:
        return None
    return " ".join(line.strip() for line in reply.lines) or reply.final


def _trial(config: SiteConfig, folder: str, seconds: float) -> Run:
    """A run of some seconds by the real service, which leaves the modem as it is."""
    here = msgspec.structs.replace(
        config,
        run=msgspec.structs.replace(config.run, directory=folder),
        modem=msgspec.structs.replace(config.modem, set_mode=""),
    )
    clock = SystemClock()
    trial = Service(here, begin_run(here, "", clock, origin=TRIAL), clock, threading.Event())
    trial.start()
    trial.wait(seconds)
    return read_run(trial.stop("trial over"))


def of_run(run: Run, last_s: float = LAST_S, *, set_mode: str = "") -> Iterator[Line]:
    """What the end of a run tells of the modem and the receiver; `set_mode` is the setting in
    [modem].
    """
    tables = run.tables
    end_ns = max((int(rows["t_ns"].max()) for rows in tables.values() if len(rows)), default=0)
    begin_ns = max(run.meta.started_ns, end_ns - round(last_s * 1e9))
    minutes = max(end_ns - begin_ns, 1) / 60e9
    scans, readings, fixes = (
        tables[name][tables[name]["t_ns"] >= begin_ns] for name in ("scans", "readings", "fixes")
    )
    notes = [row["text"].decode() for row in tables["notes"] if row["source"] == b"modem"]
    if len(scans):
        yield Line(
            "ok",
            "modem",
            f"{len(scans) / minutes:.0f} scans a minute; {notes[-1] if notes else ''}",
        )
    else:
        yield Line("fail", "modem", f"no scan; last event: {notes[-1] if notes else 'none'}")
    usable = (readings["cell"] != b"") & np.isfinite(levels_dbm(readings))
    cells = len(np.unique(readings["cell"][usable]))
    text = f"{np.count_nonzero(usable) / minutes:.0f} usable a minute, of {cells} cells"
    if not cells:
        text = (
            "no cell with identity and level: antenna connected? 2G here? SIM blocked by its PIN?"
        )
    without = _without_gsm(readings)
    is_set_later = without and set_mode and run.meta.origin == TRIAL
    state: State = "warn" if not cells or (without and not is_set_later) else "ok"
    yield Line(
        state, "readings", f"{text}; {without}; {_gsm_only(run, set_mode)}" if without else text
    )
    yield _of_fixes(fixes)


def _without_gsm(readings: Rows) -> str:
    """Which technologies are heard where GSM is not; empty where it is, or where none is known."""
    heard = sorted({rat.decode() for rat in readings["rat"]} - {""})
    if not heard or "GSM" in heard:
        return ""
    return f"only {' and '.join(heard)}: a 2G catcher would not be recorded"


def _gsm_only(run: Run, set_mode: str) -> str:
    """What to do that the modem hears GSM."""
    notes = [
        (row["code"].decode(), row["text"].decode())
        for row in run.tables["notes"]
        if row["source"] == b"modem"
    ]
    drivers = [text.rpartition(" ")[2] for code, text in notes if code == "modem-ready"]
    driver = FAMILIES.get(drivers[-1]) if drivers else None
    refused: list[str] = [text for code, text in notes if code == "mode-unchanged"]
    if refused:
        return refused[-1]
    if set_mode:
        return f'`fieldlogger run` sets it to GSM only (set_mode = "{set_mode}")'
    if driver is None or not driver.mode_commands:
        return (
            "the driver has no command for GSM only: set the modem to it by hand, or take another"
        )
    commands: str = " or ".join(
        command.set_to(command.gsm_only) for command in driver.mode_commands
    )
    return f'set_mode = "gsm" ({commands})'


def _of_fixes(fixes: Rows) -> Line:
    if not len(fixes):
        return Line("fail", "gnss", "nothing heard: right port and baud? see fieldlogger probe")
    valid = fixes[fixes["valid"] == 1]
    if not len(valid):
        return Line(
            "warn",
            "gnss",
            "the receiver speaks but has no position: a cold start under open sky takes minutes",
        )
    sigma_m = np.where(np.isfinite(valid["acc_m"]), valid["acc_m"], valid["hdop"] * UERE_M)
    accuracy = f"about {np.nanmedian(sigma_m):.0f} m" if np.any(np.isfinite(sigma_m)) else "unknown"
    if np.mean(valid["quality"][-_RECENT_FIXES:] == DEAD_RECKONING) > 1.0 - _MOST_VALID:
        text = "positions by dead reckoning, without satellites: they count little; has the antenna a free sky?"
        return Line("warn", "gnss", text)
    text = f"{len(valid)} of {len(fixes)} fixes with a position, accuracy {accuracy}"
    good = (
        np.mean(fixes["valid"][-_RECENT_FIXES:]) > _MOST_VALID
        and not np.nanmedian(sigma_m) > _COARSE_M
    )
    return Line("ok" if good else "warn", "gnss", text)
