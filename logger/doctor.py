"""`fieldlogger doctor`: is it working? Each line ok, warn or fail, with what to do."""

import os
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np

from logger.check import Line, State, check
from logger.config import SiteConfig, load_config
from logger.core.errors import DeviceError
from logger.core.observations import UERE_M
from logger.core.runfile import Run, read_run
from logger.core.runfile.journal_file import is_recording
from logger.core.runfile.names import JOURNAL, first_part
from logger.core.scale import levels_dbm
from logger.core.schema import Rows
from logger.device.clock import SystemClock
from logger.device.mounts import MOUNTINFO, kept_in_memory
from logger.device.port import Port
from logger.device.service import Service, usable_folder
from logger.device.status import FOLDER, Status, read_status, status_folder
from logger.drivers.dialogue import Command, Dialogue
from logger.probe import converse

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


def examine(config_path: Path, seconds: float = TRIAL_S) -> Iterator[Line]:
    """Lines as they are found; raises `ConfigError` for a configuration that cannot be used.

    Where the service records, its run is looked at; where not, it is run for some seconds into a temporary folder.
    """
    config, _ = load_config(config_path)
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
        yield Line("ok", "recording", f"{journal.name} is being written; the lines below are its last {LAST_S:.0f} s")
        yield from of_run(read_run(journal))
        return
    for name, url in (("modem", config.modem.port), ("gnss", config.gnss.port)):
        if url.startswith("/"):
            yield from holders(name, url)
    yield sim_card(config)
    with tempfile.TemporaryDirectory(prefix="fieldlogger-doctor-") as temporary:
        yield from of_run(_trial(config, temporary, seconds))


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
        advice = "give them a partition of their own (systemd/README.md, A root that is never written)"
        return Line("warn", "plug", f"runs are kept in memory ({where}), a pulled plug takes them: {advice}")
    return Line("ok", "plug", "runs are kept when it is pulled")


def service() -> Line:
    """Whether systemd runs the logger and will at the next boot."""
    if not Path("/run/systemd/system").is_dir():
        return Line("ok", "service", "no systemd here: start `fieldlogger run` yourself")
    said = [_systemctl(verb) for verb in ("is-active", "is-enabled")]
    if said == ["active", "enabled"]:
        return Line("ok", "service", "fieldlogger.service is active, and enabled for the next boot")
    return Line(
        "warn", "service", f"fieldlogger.service is {said[0]} and {said[1]}: systemctl enable --now fieldlogger"
    )


def _systemctl(verb: str) -> str:
    done = subprocess.run(["systemctl", verb, "fieldlogger.service"], capture_output=True, text=True, check=False)  # noqa: S603, S607
    return done.stdout.strip() or "unknown"


def recording(folder: Path) -> Path | None:
    """The journal that some logger holds open."""
    held = (first_part(path) for path in folder.glob(f"*{JOURNAL}*") if is_recording(path))
    return next(held, None)


def of_status(told: Status) -> Iterator[Line]:
    """What a running service says of itself."""
    age_s = (SystemClock().now_ns() - told.now_ns) / 1e9
    if age_s > _TELLS_EACH_S:
        yield Line("fail", "status", f"the service has said nothing for {age_s:.0f} s: systemctl restart fieldlogger")
        return
    state: State = "fail" if told.state == "error" else "warn" if told.state == "no fix" else "ok"
    yield Line(state, "status", f"{told.state}: {told.text}")
    card_s = (told.now_ns - (told.since_ns if told.synced_ns is None else told.synced_ns)) / 1e9
    yield Line("fail" if card_s > _TELLS_EACH_S else "ok", "card", f"has taken everything up to {card_s:.1f} s ago")
    full = told.waiting > told.room / 2
    yield Line("warn" if full else "ok", "queue", f"{told.waiting} of {told.room} records wait for the card")
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
            stop = f"systemctl disable --now {who}" if who in {"ModemManager", "gpsd"} else f"kill {folder.name}"
            yield Line("fail", name, f"{port} is held by {who} (process {folder.name}): sudo {stop}")


def sim_card(config: SiteConfig) -> Line:
    """What the modem says of its SIM, which it need not have."""
    try:
        with Port(config.modem.port, config.modem.baud, 0.1) as port:
            said = converse(port, _sim_state())
    except DeviceError as error:
        return Line("fail", "modem", str(error))
    if said is None:
        return Line("fail", "modem", "gives no answer to AT: powered? right port and baud? see fieldlogger probe")
    return Line("ok", "SIM", f"{said} (none is needed to listen)")


def _sim_state() -> Dialogue[str | None]:
    reply = yield Command("AT", timeout_s=1.0)
    reply = yield Command("AT+CMEE=2")
    reply = yield Command("AT+CPIN?", timeout_s=5.0)
    if reply.final is None:
        return None
    return " ".join(line.strip() for line in reply.lines) or reply.final


def _trial(config: SiteConfig, folder: str, seconds: float) -> Run:
    """A run of some seconds by the real service."""
    here = msgspec.structs.replace(config, run=msgspec.structs.replace(config.run, directory=folder))
    trial = Service(here, SystemClock(), threading.Event(), config_text="", origin="doctor")
    trial.start()
    trial.wait(seconds)
    return read_run(trial.stop("trial over"))


def of_run(run: Run, last_s: float = LAST_S) -> Iterator[Line]:
    """What the end of a run tells of the modem and the receiver."""
    tables = run.tables
    end_ns = max((int(rows["t_ns"].max()) for rows in tables.values() if len(rows)), default=0)
    begin_ns = max(run.meta.started_ns, end_ns - round(last_s * 1e9))
    minutes = max(end_ns - begin_ns, 1) / 60e9
    scans, readings, fixes = (tables[name][tables[name]["t_ns"] >= begin_ns] for name in ("scans", "readings", "fixes"))
    notes = [row["text"].decode() for row in tables["notes"] if row["source"] == b"modem"]
    if len(scans):
        yield Line("ok", "modem", f"{len(scans) / minutes:.0f} scans a minute; {notes[-1] if notes else ''}")
    else:
        yield Line("fail", "modem", f"no scan; last event: {notes[-1] if notes else 'none'}")
    usable = (readings["cell"] != b"") & np.isfinite(levels_dbm(readings))
    cells = len(np.unique(readings["cell"][usable]))
    text = f"{np.count_nonzero(usable) / minutes:.0f} usable a minute, of {cells} cells"
    no_cell = "no cell with identity and level: antenna connected? 2G here? SIM blocked by its PIN?"
    yield Line("ok", "readings", text) if cells else Line("warn", "readings", no_cell)
    yield _of_fixes(fixes)


def _of_fixes(fixes: Rows) -> Line:
    if not len(fixes):
        return Line("fail", "gnss", "nothing heard: right port and baud? see fieldlogger probe")
    valid = fixes[fixes["valid"] == 1]
    if not len(valid):
        return Line(
            "warn", "gnss", "the receiver speaks but has no position: a cold start under open sky takes minutes"
        )
    sigma_m = np.where(np.isfinite(valid["acc_m"]), valid["acc_m"], valid["hdop"] * UERE_M)
    accuracy = f"about {np.nanmedian(sigma_m):.0f} m" if np.any(np.isfinite(sigma_m)) else "unknown"
    text = f"{len(valid)} of {len(fixes)} fixes with a position, accuracy {accuracy}"
    good = np.mean(fixes["valid"][-_RECENT_FIXES:]) > _MOST_VALID and not np.nanmedian(sigma_m) > _COARSE_M
    return Line("ok" if good else "warn", "gnss", text)
