"""The receivers of a gpsd, `gpsd://host[:port][/device]`: one request, then reading only."""

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

from logger.config import GpsdSettings
from logger.core.types import Fix
from logger.device.link import Link, Source
from logger.device.nmea_source import record_fixes
from logger.device.port import Port
from logger.drivers.protocols.gpsd import (
    Device,
    Devices,
    Error,
    GpsdFixes,
    GpsdFramer,
    Report,
    Version,
    watch,
)

PAUSE_S = 0.1
"""gpsd writes an epoch in one go: after a pause there is no more of it."""


class GpsdSource(Source[GpsdSettings]):
    """Gives one fix for each epoch of one receiver of a gpsd, or of all if no device is named."""

    def open(self, read_timeout_s: float) -> Port:
        return Port(self.port, 0, read_timeout_s)

    def session(self, link: Link, folder: Path) -> None:
        del folder
        device = urlsplit(self.port).path
        link.write(watch(device))
        record_fixes(link, GpsdFramer(), _FixesAndNotes(link, device), PAUSE_S)


class _FixesAndNotes(GpsdFixes):
    """Fixes, and notes of the other reports of gpsd."""

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
        elif isinstance(report, Device):
            self._note_device(report)
        return super().feed(report, t_ns)

    def _note_devices(self, devices: tuple[Device, ...]) -> None:
        if not devices:
            self._link.note("warning", "gpsd-devices", "gpsd has no receiver now")
        elif len(devices) > 1 and not self._device:
            names = ", ".join(device.path for device in devices)
            self._link.note(
                "warning",
                "gpsd-devices",
                f"gpsd has {len(devices)} receivers, all are recorded: {names}",
            )

    def _note_device(self, device: Device) -> None:
        if device.activated:
            self._link.note(
                "info", "gpsd-device", f"{device.path} {device.driver or 'of unknown kind'}"
            )
        else:
            self._link.note("warning", "gpsd-device", f"gpsd has lost {device.path}")
