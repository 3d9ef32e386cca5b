"""The session with a gpsd, `gpsd://host[:port][/device]`: one request, then reading only."""

from collections.abc import Callable, Iterator
from functools import partial
from urllib.parse import urlsplit

from logger.core.types import Fix
from logger.device.gnss_link import gnss_session, record_fixes
from logger.device.link import Link
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


def receiver_session(url: str) -> Callable[[Link], None]:
    """The session for a receiver's port: gpsd for its own scheme, NMEA for all others."""
    parts = urlsplit(url)
    return partial(gpsd_session, device=parts.path) if parts.scheme == "gpsd" else gnss_session


def gpsd_session(link: Link, device: str) -> None:
    """Record one fix for each epoch of one receiver of a gpsd, or of all if `device` is empty."""
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
