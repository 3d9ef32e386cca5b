"""Receivers: one at a serial port, which is only read, or those of a gpsd."""

import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

from logger.config import GpsdSettings, NmeaSettings
from logger.core.types import (
    BY_HAND,
    DEAD_RECKONING,
    EARLIEST_UTC_NS,
    IMPOSSIBLE_DATE,
    SIMULATED,
    Fix,
)
from logger.device.link import NO_EPOCHS, Device, Link, Source
from logger.device.port import Port
from logger.drivers.protocols.gpsd import (
    Device as GpsdDevice,
)
from logger.drivers.protocols.gpsd import (
    Devices,
    Error,
    GpsdFixes,
    GpsdFramer,
    Report,
    Version,
    watch,
)
from logger.drivers.protocols.line_noise import Garbage
from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer, Sentence

SILENT_S = 1.5
"""Longer than the pause between epochs at 1 Hz: after it an epoch is complete."""
EPOCH_WITHIN_S = 10.0
"""A receiver sends an epoch each second, without a fix too; a start or a busy Pi takes less."""
PROBE_S = 1.3
"""A receiver at 1 Hz has printed an epoch by then."""
_SENTENCES = 2
"""Right checksums that make a receiver: one may be noise."""

_UNMEASURED = {
    DEAD_RECKONING: (
        "dead-reckoning",
        1,
        "positions by dead reckoning, without satellites; they get little weight",
    ),
    BY_HAND: ("position-by-hand", 1, "positions entered by hand; none is used"),
    SIMULATED: ("position-simulated", 1, "positions simulated by the receiver; none is used"),
}
"""By quality: code of the note, count of each, text."""
# a receiver's time goes on each second, and a modem repeats its last for a second or two
OLD_S = 3.0
_REPEATED = "positions with a time that stands still: the receiver repeats its last; none is used"
_NOT_USED = "is the receiver's date, which cannot be (a rollover of its GPS weeks?); it is not used"
PAUSE_S = 0.1
"""gpsd writes an epoch in one go: after a pause there is no more of it."""


class Framer(Protocol):
    """Splits bytes into events, some of which may be `Garbage`."""

    def feed(self, data: bytes) -> Iterator[Any]: ...


class Assembler(Protocol):
    """Combines events into fixes with their times."""

    def feed(self, event: Any, t_ns: int, /) -> Iterator[tuple[int, Fix]]: ...
    def flush(self) -> Iterator[tuple[int, Fix]]: ...
    @property
    def time(self) -> object: ...
    @property
    def impossible_date(self) -> date | None: ...


class NmeaSource(Source[NmeaSettings]):
    """Gives one fix for each epoch of a receiver."""

    may_be_swapped = True

    def open(self, read_timeout_s: float) -> Port:
        return Port(self.port, self.settings.baud, read_timeout_s)

    def session(self, link: Link, folder: Path) -> None:
        del folder
        wanted = f"NMEA with GGA or RMC, at {self.settings.baud} baud"
        unreadable = f"receiver sends nothing readable: is it {wanted}?"
        faults = ("receiver sends nothing: check its cable, port and baud rate", unreadable)
        record_fixes(link, NmeaFramer(), FixAssembler(), SILENT_S, faults)

    @classmethod
    def probe(cls, port: Port) -> Device | None:
        """A receiver sends sentences by itself."""
        framer, n_sentences, end_s = NmeaFramer(), 0, time.monotonic() + PROBE_S
        while time.monotonic() < end_s:
            n_sentences += sum(isinstance(event, Sentence) for event in framer.feed(port.read()))
            if n_sentences >= _SENTENCES:
                return Device("gnss", "NMEA")
        return None


def record_fixes(
    link: Link, framer: Framer, assembler: Assembler, silent_s: float, faults: tuple[str, str]
) -> None:
    """Record the fixes of a receiver; an epoch also ends after a silence and at the stop.

    `faults` are the notes about a receiver without epochs: where no byte comes, and where some do.
    """
    received_ns = heard_ns = epoch_ns = link.clock.now_ns()
    fault, is_date_noted = "", False
    try:
        while not link.stop.is_set():
            t_ns, data = link.read()
            heard_ns = t_ns if link.has_heard else heard_ns
            n_fixes = 0
            if data:
                received_ns = t_ns
                n_fixes = _record(link, framer, assembler, data, t_ns)
            elif t_ns - received_ns > silent_s * 1e9:
                n_fixes = _emit(link, assembler, assembler.flush())
            if n_fixes:
                epoch_ns, fault = t_ns, ""
                if not is_date_noted and (day := assembler.impossible_date):
                    is_date_noted = True
                    note_impossible_date(link, day)
            due = faults[heard_ns > epoch_ns]
            if t_ns - epoch_ns > EPOCH_WITHIN_S * 1e9 and due != fault:
                fault = due
                link.note("warning", NO_EPOCHS, fault)
    finally:
        _emit(link, assembler, assembler.flush())


def _record(link: Link, framer: Framer, assembler: Assembler, data: bytes, t_ns: int) -> int:
    n_fixes = 0
    for event in framer.feed(data):
        if isinstance(event, Garbage):
            link.count_garbage(len(event.data))
        else:
            n_fixes += _emit(link, assembler, assembler.feed(event, t_ns))
    return n_fixes


def _emit(link: Link, assembler: Assembler, fixes: Iterator[tuple[int, Fix]]) -> int:
    """Returns their number."""
    emitted = list(fixes)
    for fix_ns, fix in emitted:
        emit_fix(link, fix, fix_ns, time=assembler.time)
    return len(emitted)


def emit_fix(
    link: Link, fix: Fix, t_ns: int, source: str | None = None, time: object = None
) -> None:
    """Record a fix, and count a position that was not measured or is an old one.

    `time` is the receiver's, where it prints no date.
    """
    time = time if fix.utc_ns is None else fix.utc_ns
    latest, since_ns = link.latest_time
    if time is None or time != latest:
        link.latest_time = time, t_ns
    elif fix.valid and t_ns - since_ns > OLD_S * 1e9:
        link.count("position-repeated", 1, _REPEATED)
        fix = Fix(valid=False, utc_ns=fix.utc_ns)
    link.emit(fix, t_ns, source)
    if fix.quality in _UNMEASURED:
        link.count(*_UNMEASURED[fix.quality])


def note_impossible_date(link: Link, day: date | str) -> None:
    """Note that the receiver's date is not used."""
    link.note("warning", IMPOSSIBLE_DATE, f"{day} {_NOT_USED}")


def credible(fix: Fix) -> Fix:
    """Remove an impossible time: a receiver begins in 1980, or 1024 weeks too early."""
    if fix.utc_ns is None or fix.utc_ns >= EARLIEST_UTC_NS:
        return fix
    return replace(fix, utc_ns=None)


class GpsdSource(Source[GpsdSettings]):
    """Gives one fix for each epoch of a gpsd's receiver, or of all if none is named."""

    def open(self, read_timeout_s: float) -> Port:
        return Port(self.port, 0, read_timeout_s)

    def session(self, link: Link, folder: Path) -> None:
        del folder
        device = urlsplit(self.port).path
        link.write(watch(device))
        fault = "gpsd sends no data of a receiver: does gpsmon show any?"
        record_fixes(link, GpsdFramer(), _FixesAndNotes(link, device), PAUSE_S, (fault, fault))


class _FixesAndNotes(GpsdFixes):
    def __init__(self, link: Link, device: str) -> None:
        super().__init__()
        self._link = link
        self._device = device

    def feed(self, report: Report, t_ns: int) -> Iterator[tuple[int, Fix]]:
        if isinstance(report, Version):
            version = f"gpsd {report.release}, protocol {report.proto_major}.{report.proto_minor}"
            self._link.note(
                "info" if report.proto_major == 3 else "warning", "gpsd-version", version
            )
        elif isinstance(report, Error):
            self._link.note("warning", "gpsd-error", report.message)
        elif isinstance(report, Devices):
            self._note_devices(report.devices)
        elif isinstance(report, GpsdDevice):
            self._note_device(report)
        return super().feed(report, t_ns)

    def _note_devices(self, devices: tuple[GpsdDevice, ...]) -> None:
        if not devices:
            self._link.note("warning", "gpsd-devices", "gpsd has no receiver now")
        elif len(devices) > 1 and not self._device:
            names = ", ".join(device.path for device in devices)
            self._link.note(
                "warning",
                "gpsd-devices",
                f"gpsd has {len(devices)} receivers, all are recorded: {names}",
            )

    def _note_device(self, device: GpsdDevice) -> None:
        if device.activated:
            self._link.note(
                "info", "gpsd-device", f"{device.path} {device.driver or 'of unknown kind'}"
            )
        else:
            self._link.note("warning", "gpsd-device", f"gpsd has lost {device.path}")
