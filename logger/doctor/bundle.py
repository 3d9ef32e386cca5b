"""A report for asking others: what the doctor found, without private numbers, names or places."""

import os
import platform
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from logger.core.document import Column, Document, Part, Table, facts, terminal_lines
from logger.core.errors import ConfigError
from logger.core.runfile import Run
from logger.device.check_line import Line
from logger.device.libraries import installed_versions
from logger.device.machine import kernel_text
from logger.drivers.privacy.redaction import mask_labelled

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
    """Settings that are in force; comments may contain anything."""
    for line in config.read_text(encoding="utf-8", errors="replace").splitlines():
        setting = line.partition("#")[0].rstrip()
        if setting:
            yield without_private(_SECRET.sub(r"\1 [left out]", setting))


def _events(run: Run) -> Iterator[tuple[str | float, ...]]:
    for row in run.tables["notes"][-_MOST_NOTES:]:
        text = without_private(row["text"].decode("utf-8", "replace"))
        seconds = (int(row["t_ns"]) - run.meta.started_ns) / 1e9
        yield seconds, row["level"].decode(), row["code"].decode(), text
