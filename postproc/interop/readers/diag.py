"""Qualcomm's diagnostic stream in a file: .qmdl of Rayhunter, SCAT and QCSuper, .mi2log.

Only codes that carry levels, identities or timing advance leave their frame. The times are the
modem's: of 1980 until a network set its clock.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.foreign import open_regular
from logger.core.types import Fix
from logger.drivers.diag.frames import FrameReader
from logger.drivers.diag.levels import ALLOWED_CODES, Decoder, Observation
from logger.drivers.diag.seconds import Second, Seconds
from postproc.interop.contents import Format
from postproc.interop.readers.rayhunter import CLOCK_SET_NS
from postproc.interop.sighting import NoCell, Row, Sighting
from postproc.progress import with_progress

_CHUNK = 1 << 20


def read(source: Path) -> Iterator[Row]:
    """A row for each second and cell, then what was not read; raises `RunFileError`."""
    frames, decoder = FrameReader(ALLOWED_CODES), Decoder()
    yield from rows_of(
        one
        for chunk in _chunks(source)
        for record in frames.feed(chunk)
        for one in decoder.feed(record)
    )
    frames.end()
    yield from _not_read(frames, decoder)


def rows_of(observations: Iterable[Observation]) -> Iterator[Row]:
    """Readings of each second, without a position; numbered by the second."""
    seconds = Seconds()
    number = 0
    for one in observations:
        for second in seconds.feed(one):
            number += 1
            yield from _sightings(number, second)
    for second in seconds.end():
        number += 1
        yield from _sightings(number, second)


def _sightings(number: int, second: Second) -> Iterator[Sighting]:
    t_ns = second.time_ns
    fix = Fix(False, utc_ns=t_ns if t_ns >= CLOCK_SET_NS else None)
    for reading in second.readings:
        yield Sighting(number, t_ns, fix, reading, second.radio_id)


def _chunks(source: Path) -> Iterator[bytes]:
    n_chunks = -(-source.stat().st_size // _CHUNK)
    try:
        with open_regular(source) as file:
            chunks = iter(lambda: file.read(_CHUNK), b"")
            yield from with_progress(chunks, f"{source.name}: MB", n_chunks)
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror or error}") from error


def _not_read(frames: FrameReader, decoder: Decoder) -> Iterator[NoCell]:
    for why, n in sorted(frames.damaged.items()):
        yield NoCell(0, f"damaged frames, {why}", n)
    for (code, version), n in sorted(decoder.unknown.items()):
        yield NoCell(0, f"0x{code:04X} version {version}", n)
    for code, n in sorted(decoder.refused.items()):
        yield NoCell(0, f"0x{code:04X} with a length or a value that cannot be", n)


IMPORTS = (
    Format(
        "Qualcomm DIAG",
        read,
        "the modem's clock",
        lambda seen: seen.kind == "diag",
        has_scans=True,
        unrepeated=True,
        capture=True,
    ),
)
