"""The event for bytes that are no text of a device."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Garbage:
    """Bytes that are no text of the device, without line ends: noise or an endless line."""

    data: bytes
