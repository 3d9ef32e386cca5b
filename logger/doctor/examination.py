"""All tests in their order, each `ok`, `warn` or `fail` with advice; the verdict comes first.

A report for others is without private numbers, names or places.
"""

import os
import platform
import re
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from logger.baseline_file import BaselineFile, configured_file
from logger.check import check
from logger.config import ModemSettings, SiteConfig, load_config
from logger.core.document import Column, Document, Part, Table, facts, terminal_lines
from logger.core.errors import ConfigError, RunFileError
from logger.core.runfile import Run, read_latest, read_run
from logger.core.source_tables import GNSS, MODEM
from logger.device.clock import Clock
from logger.device.link import NO_PORT, NOT_THERE, Line
from logger.device.machine import kernel_text
from logger.device.mode_switch import SavedModes, unrestored_modes
from logger.device.service import Service
from logger.device.sources import source_of
from logger.device.startup import begin_run, installed_versions, usable_folder
from logger.device.status import FOLDER, read_status, status_folder
from logger.doctor.single_tests import (
    LAST_S,
    TRIAL,
    battery,
    clock_line,
    disk,
    health,
    holders,
    open_journal,
    plug,
    power,
    run_lines,
    speed,
    status_lines,
    temperature,
    unit,
    wall_minus_boot_ns,
)
from logger.drivers.protocols.redaction import mask_labelled
from logger.drivers.registry import FAMILIES

TRIAL_S = 15.0
"""In this time the modem is polled several times, and a receiver sends fixes."""

ESSENTIAL = frozenset({"status", "card", "queue", "mode", "readings"})
"""A warning in one of these, or in a source, means that a walk would not be recorded properly."""
SOURCES = frozenset({MODEM, GNSS})
"""Names of the sources, unless the configuration has others."""
_READ_S = 600.0  # of a run that is being recorded: in this time there is a fix for the clock
_MOST_NOTES = 60
_EVENT_COLUMNS = (Column("time", ".1f", "s"), Column("level"), Column("code"), Column("event"))
_PRIVATE = (
    (re.compile(r"(?i)\b(?:[0-9a-f]{2}:){5}[0-9a-f]{2}\b"), "[address]"),
    (re.compile(r"\b\d{3}-\d{2,3}-\d+-\d+\b"), "[cell]"),
    (re.compile(r"-?\b\d{1,3}\.\d{3,}"), "[place]"),
    (re.compile(r"(by-id/\S*?)_[^_\s\"]+(-if\d)"), r"\1_[serial]\2"),
    (re.compile(r"\b\d{1,3}(?:\.\d{1,3}){3}\b"), "[address]"),
    (re.compile(r"(?<=://)[^/\s\"]+"), "[host]"),
    (re.compile(r"(/home/|/media/)[^/\s\"]+"), r"\1[user]"),
    (re.compile(r"(?i)\b(?:imei|imsi|iccid|lac|tac|cid|ci)\b[ =:]*\w+"), "[identity]"),
    (re.compile(r"(?i)(?<![.\w])(?=[\w]*\d)[0-9a-f]{6,}\b"), "[number]"),
    (re.compile(r"\d{6,}"), "[number]"),
)
"""What could name a person, a device or a place, and what stands for it."""
_SECRET = re.compile(r"(?i)^(\s*\S*(?:pass|secret|token|ssid|user)\S*\s*=).*")


@dataclass
class Examination:
    """All lines, the verdict first, and the run that was tested, if any."""

    lines: list[Line] = field(default_factory=list)
    run: Run | None = None


def examine(
    config_path: Path, seconds: float = TRIAL_S, progress: Callable[[str], None] = lambda _: None
) -> Examination:
    """Make all tests; `progress` receives what each of them is about.

    If the service is recording, the end of its run is tested; otherwise it records for some seconds
    into a temporary folder. Raises `ConfigError` for an unusable configuration.
    """
    examination = Examination()
    config, _ = load_config(config_path)
    for line in _tests(config_path, config, seconds, examination):
        progress(line.what)
        examination.lines.append(line)
    sources = SOURCES.union(source.name for source in config.source)
    examination.lines.insert(0, overall(examination.lines, sources))
    return examination


def overall(lines: Iterable[Line], sources: frozenset[str] = SOURCES) -> Line:
    """Sum up: ready to walk, or what to do first."""
    lines = list(lines)
    fails = [line for line in lines if line.state == "fail"]
    warnings = [line for line in lines if line.state == "warn"]
    problems = [*fails, *(line for line in warnings if line.what in ESSENTIAL | sources)]
    if not problems:
        names = ", ".join(line.what for line in warnings)
        return Line("ok", "overall", "ready to walk" + (f"; check also: {names}" if names else ""))
    first, *others = problems
    text = f"{first.what}: {first.text}" + (f" (and {len(others)} more below)" if others else "")
    if any(_is_wrong_port(line) for line in problems if line.what in sources):
        text += "; `fieldlogger probe --write site.toml` finds the ports"
    if fails:
        return Line("fail", "overall", f"not ready to walk: {text}")
    return Line("warn", "overall", f"not yet ready to walk: {text}")


def _is_wrong_port(line: Line) -> bool:
    # other faults of a source say themselves what to do
    return NOT_THERE in line.text or NO_PORT in line.text


def _tests(
    config_path: Path, config: SiteConfig, seconds: float, examination: Examination
) -> Iterator[Line]:
    """All lines but the verdict; keeps the run that they are about."""
    yield from check(config_path)
    yield power()
    yield battery(config.power)
    yield temperature()
    folder = usable_folder(config.run.directory)
    yield disk(folder)
    if os.access(folder, os.W_OK):
        yield speed(folder)
    yield health(folder)
    yield plug(folder)
    yield unit()
    journal = open_journal(folder)
    try:
        status = read_status(status_folder() or FOLDER)
    except OSError as error:
        text = f"{error}: run this with sudo, or join the group cellwalk"
        yield Line("fail", "status", text)
        return  # the service is there, and has the ports
    if status is not None:
        yield from status_lines(status)
        journal = Path(status.run)
    if journal is None:
        yield from _trial_lines(config, folder, seconds, examination)
        return
    text = f"{journal.name} is being written; the lines below are its last {LAST_S:.0f} s"
    yield Line("ok", "recording", text)
    examination.run = read_latest(journal, _READ_S)
    yield from _run_lines(config, examination.run)


def _run_lines(config: SiteConfig, run: Run) -> Iterator[Line]:
    folder = Path(config.run.directory).expanduser()
    with closing_baseline(configured_file(config.live.baseline, folder)) as baseline:
        yield from run_lines(run, sources=config.source, baseline=baseline)
    yield clock_line(run, wall_minus_boot_ns())


@contextmanager
def closing_baseline(path: Path | None) -> Iterator[BaselineFile | None]:
    """Earlier walks, None without a readable file: `check` has a line about that."""
    try:
        baseline = BaselineFile(path) if path else None
    except RunFileError:
        baseline = None
    try:
        yield baseline
    finally:
        if baseline is not None:
            baseline.close()


def _trial_lines(
    config: SiteConfig, folder: Path, seconds: float, examination: Examination
) -> Iterator[Line]:
    if changed := unrestored_modes(SavedModes(folder), FAMILIES.get):
        yield Line("warn", "mode", changed)
    for source in config.source:
        if source.port.startswith("/"):
            yield from holders(source.name, source.port)
        yield from source_of(source).examine()
    with tempfile.TemporaryDirectory(prefix="fieldlogger-doctor-") as temporary:
        examination.run = _trial_run(config, temporary, seconds)
        yield from _run_lines(config, examination.run)


def _trial_run(config: SiteConfig, folder: str, seconds: float) -> Run:
    """The real service records, without changing the modem's mode."""
    trial_config = msgspec.structs.replace(
        config,
        run=msgspec.structs.replace(config.run, directory=folder),
        source=tuple(
            msgspec.structs.replace(one, set_mode="") if isinstance(one, ModemSettings) else one
            for one in config.source
        ),
    )
    clock = Clock()
    writer = begin_run(trial_config, "", clock, origin=TRIAL)
    service = Service(trial_config, writer, clock, threading.Event())
    service.start()
    service.wait(seconds)
    return read_run(service.stop("end of the trial"))


def write_report(target: Path, lines: Iterable[Line], config: Path, run: Run | None) -> None:
    """Write the report as text; raises `ConfigError` where the file cannot be written."""
    said = Document(None, body=_report(list(lines), config, run))
    text = "\n".join([*terminal_lines(said), ""])
    try:
        target.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{target}: {error.strerror}") from error


def without_private(text: str) -> str:
    """A text without numbers of people and devices, addresses, cells and coordinates."""
    for pattern, stand_in in _PRIVATE:
        text = pattern.sub(stand_in, text)
    return mask_labelled(text.encode()).decode("utf-8", "replace")


def _report(lines: list[Line], config: Path, run: Run | None) -> Iterator[Part]:
    yield "fieldlogger doctor: numbers of people and devices, cells and places are left out"
    yield ""
    checks = [(line.state, f"{line.what}: {without_private(line.text)}") for line in lines]
    yield from facts(checks, len("fail"))
    yield "\nmachine"
    yield from facts([(f"  {name}:", value) for name, value in _machine()])
    yield "\nversions"
    yield from facts(
        [(f"  {name}", version) for name, version in sorted(installed_versions().items())]
    )
    yield "\nconfiguration"
    yield from (f"  {line}" for line in _settings(config))
    if run is not None:
        yield f"\nlast events of the run (of {len(run.tables['notes'])})"
        yield Table(_EVENT_COLUMNS, list(_events(run)))


def _machine() -> Iterator[tuple[str, str]]:
    """Board, system and kernel; not the name of the machine."""
    model = ((kernel_text(Path("/proc/device-tree/model")) or "").splitlines() or [""])[0]
    yield "model", model.strip("\0") or platform.machine()
    try:
        system = platform.freedesktop_os_release().get("PRETTY_NAME", "unknown")
    except (OSError, ValueError):
        system = "unknown"
    yield "system", system
    yield "kernel", f"{platform.release()} {platform.machine()}"
    yield "processors", str(os.cpu_count())
    yield "memory", f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 1e9:.1f} GB"


def _settings(config: Path) -> Iterator[str]:
    """Without comments, which may contain anything."""
    for line in config.read_text(encoding="utf-8", errors="replace").splitlines():
        setting = line.partition("#")[0].rstrip()
        if setting:
            yield without_private(_SECRET.sub(r"\1 [left out]", setting))


def _events(run: Run) -> Iterator[tuple[str | float, ...]]:
    for row in run.tables["notes"][-_MOST_NOTES:]:
        text = without_private(row["text"].decode())
        seconds = (int(row["t_ns"]) - run.meta.started_ns) / 1e9
        yield seconds, row["level"].decode(), row["code"].decode(), text
