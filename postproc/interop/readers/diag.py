"""Qualcomm's diagnostic stream in a file: .qmdl of Rayhunter, SCAT and QCSuper, .mi2log.

Only codes that carry levels, identities, timing advance or evidence leave their frame. The times
are the modem's: of 1980 until a network set its clock.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.foreign import open_regular
from logger.core.types import Fix
from logger.drivers.diag.frames import FrameReader, LogRecord
from logger.drivers.diag.levels import ALLOWED_CODES, Decoder, Observation
from logger.drivers.diag.seconds import Second, Seconds
from postproc.interop.contents import Format
from postproc.interop.diag_messages import CODES, NO_PYCRATE, Messages
from postproc.interop.readers.rayhunter import CLOCK_SET_NS
from postproc.interop.sighting import NoCell, Remark, Row, Sighting
from postproc.progress import with_progress
from postproc.suspicion.signalling import CODE, Signal

_CHUNK = 1 << 20


def read(source: Path) -> Iterator[Row]:
    """A row for each second and cell, or signal; then what was not read; raises `RunFileError`."""
    frames, decoder, messages = FrameReader(ALLOWED_CODES | CODES), Decoder(), Messages()
    records = (record for chunk in _chunks(source) for record in frames.feed(chunk))
    yield from rows_of(_read_all(records, decoder, messages))
    frames.end()
    yield from _not_read(frames, decoder, messages)


def _read_all(
    records: Iterable[LogRecord], decoder: Decoder, messages: Messages
) -> Iterator[Observation | Signal]:
    for record in records:
        yield from map(messages.with_first_name, decoder.feed(record))
        yield from messages.feed(record)
    yield from messages.end()


def rows_of(heard: Iterable[Observation | Signal]) -> Iterator[Row]:
    """Readings of each second, without a position, and signals; numbered by the second."""
    seconds = Seconds()
    number = 0
    for one in heard:
        if isinstance(one, Signal):
            yield Remark(number, one.time_ns, one.text, CODE)
            continue
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


def _not_read(frames: FrameReader, decoder: Decoder, messages: Messages) -> Iterator[NoCell]:
    for why, n in sorted(frames.damaged.items()):
        yield NoCell(0, f"damaged frames, {why}", n)
    for (code, version), n in sorted((decoder.unknown + messages.unknown).items()):
        yield NoCell(0, f"0x{code:04X} version {version}", n)
    for code, n in sorted((decoder.refused + messages.refused).items()):
        yield NoCell(0, f"0x{code:04X} with a length or a value that cannot be", n)
    if messages.n_unnamed:
        yield NoCell(0, "reported neighbours on a carrier that is not named", messages.n_unnamed)
    if messages.n_undecoded:
        yield NoCell(0, NO_PYCRATE, messages.n_undecoded)
    if n := frames.skipped.total() + frames.n_other:
        yield NoCell(0, "frames without levels", n)


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
