"""The event for bytes that are no text of a device."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Garbage:
    """Bytes that could not be read: line noise, a damaged or an endless line; their line ends are
    not kept.
    """

    data: bytes
