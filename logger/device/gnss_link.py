"""The session with an NMEA receiver: it only listens."""

from logger.device.link import Link
from logger.drivers.garbage import Garbage
from logger.drivers.nmea import FixAssembler, NmeaFramer

SILENT_S = 1.5
"""Longer than the pause between two epochs at 1 Hz: what is pending then is all there will be."""


def gnss_session(link: Link) -> None:
    """Read sentences and record one fix for each epoch, until stopped or the port is lost."""
    framer, assembler = NmeaFramer(), FixAssembler()
    heard_ns = link.clock.now_ns()
    while not link.stop.is_set():
        t_ns, data = link.read()
        if data:
            heard_ns = t_ns
            _hear(link, framer, assembler, data, t_ns)
        elif t_ns - heard_ns > SILENT_S * 1e9:
            _emit_fixes(link, assembler)
    _emit_fixes(link, assembler)


def _hear(link: Link, framer: NmeaFramer, assembler: FixAssembler, data: bytes, t_ns: int) -> None:
    for event in framer.feed(data):
        if isinstance(event, Garbage):
            link.count_garbage(len(event.data))
            continue
        for fix_ns, fix in assembler.feed(event, t_ns):
            link.emit(fix, fix_ns)


def _emit_fixes(link: Link, assembler: FixAssembler) -> None:
    for fix_ns, fix in assembler.flush():
        link.emit(fix, fix_ns)
