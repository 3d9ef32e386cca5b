"""The session with an NMEA receiver: it only listens."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Protocol

from logger.core.types import BY_HAND, DEAD_RECKONING, SIMULATED, Fix
from logger.core.utc import EARLIEST_UTC_NS
from logger.device.link import Link
from logger.drivers.protocols.garbage import Garbage
from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer

SILENT_S = 1.5
"""Longer than the pause between two epochs at 1 Hz: what is pending then is all there will be."""


_UNMEASURED = {
    DEAD_RECKONING: (
        "dead-reckoning",
        1,
        "positions by dead reckoning, without satellites; they count little",
    ),
    BY_HAND: ("position-by-hand", 1, "positions that were typed in by hand; none was taken"),
    SIMULATED: ("position-simulated", 1, "positions that the receiver simulates; none was taken"),
}
"""By quality: the code of the Note, how many to count, and what."""


class Framer(Protocol):
    """Bytes to events, some of which may be Garbage."""

    def feed(self, data: bytes) -> Iterator[Any]: ...


class Assembler(Protocol):
    """Events to fixes and when they were."""

    def feed(self, event: Any, t_ns: int, /) -> Iterator[tuple[int, Fix]]: ...
    def flush(self) -> Iterator[tuple[int, Fix]]: ...


def gnss_session(link: Link) -> None:
    """Read sentences and record one fix for each epoch, until stopped or the port is lost."""
    listen(link, NmeaFramer(), FixAssembler(), SILENT_S)


def listen(link: Link, framer: Framer, assembler: Assembler, silent_s: float) -> None:
    """Record the fixes of a receiver; what is pending after a silence, or at the end, is all there
    will be of it.
    """
    heard_ns = link.clock.now_ns()
    try:
        while not link.stop.is_set():
            t_ns, data = link.read()
            if data:
                heard_ns = t_ns
                _hear(link, framer, assembler, data, t_ns)
            elif t_ns - heard_ns > silent_s * 1e9:
                _emit(link, assembler.flush())
    finally:
        _emit(link, assembler.flush())


def _hear(link: Link, framer: Framer, assembler: Assembler, data: bytes, t_ns: int) -> None:
    for event in framer.feed(data):
        if isinstance(event, Garbage):
            link.count_garbage(len(event.data))
        else:
            _emit(link, assembler.feed(event, t_ns))


def _emit(link: Link, fixes: Iterator[tuple[int, Fix]]) -> None:
    for fix_ns, fix in fixes:
        link.emit(fix, fix_ns)
        count_unmeasured(link, fix)


def count_unmeasured(link: Link, fix: Fix) -> None:
    """Count a position that the receiver has, but has not measured."""
    if fix.quality in _UNMEASURED:
        link.count(*_UNMEASURED[fix.quality])


def credible(fix: Fix) -> Fix:
    """The fix without a time that no run can have: a receiver's clock begins in 1980, or 1024 weeks
    too early.
    """
    return (
        replace(fix, utc_ns=None)
        if fix.utc_ns is not None and fix.utc_ns < EARLIEST_UTC_NS
        else fix
    )
