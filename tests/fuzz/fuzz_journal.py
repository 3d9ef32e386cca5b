"""Journals of any bytes: `python fuzz_journal.py -max_total_time=3600`.

Frames with right checksums and payloads of every kind stand among bytes of any kind. What comes of
it is read, or refused by `RunFileError`; no record comes out of a frame that is not in the file,
and the chain names what is missing."""

import os
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(
    include=["logger.core.runfile", "logger.core.rows", "logger.core.schema"]
):
    from logger.core.errors import RunFileError
    from logger.core.runfile import read_run, read_sound_run, sealing_of
    from logger.core.runfile.frames import HEADER_SIZE, Frame, Kind, encode, scan

import msgspec

from postproc.info import describe, verify
from tests.kit import runs

FOLDER = Path("/dev/shm") if Path("/dev/shm").is_dir() else Path(tempfile.gettempdir())
PATH = FOLDER / f"fuzz-{os.getpid()}.journal"
runs.write_journal(PATH, runs.records(3), sync_every=2)
HONEST = PATH.read_bytes()
FRAMES = [
    HONEST[frame.start - HEADER_SIZE : frame.start + frame.length + 4]
    for frame in scan(HONEST)
    if isinstance(frame, Frame)
]
META = msgspec.json.encode(runs.meta())
TABLES = (b"fixes", b"scans", b"readings", b"broadcasts", b"notes", b"live", b"raw", b"other")


def journal_of(source: atheris.FuzzedDataProvider) -> bytes:
    data = b""
    while source.remaining_bytes() > 2 and len(data) < 1 << 16:
        match source.ConsumeIntInRange(0, 5):
            case 0 | 1:
                data += FRAMES[source.ConsumeIntInRange(0, len(FRAMES) - 1)]
            case 2:
                data += source.ConsumeBytes(source.ConsumeIntInRange(0, 60))
            case 3:
                text = bytearray(META)
                at = source.ConsumeIntInRange(0, len(text) - 1)
                text[at : at + source.ConsumeIntInRange(0, 4)] = source.ConsumeBytes(
                    source.ConsumeIntInRange(0, 6)
                )
                data += encode(
                    1,
                    source.ConsumeIntInRange(0, 9),
                    Kind.META,
                    bytes(text),
                    source.ConsumeIntInRange(0, 4),
                )
            case 4:
                body = source.ConsumeBytes(source.ConsumeIntInRange(0, 700))
                table = TABLES[source.ConsumeIntInRange(0, len(TABLES) - 1)]
                payload = bytes([len(table)]) + table + body
                data += encode(1, source.ConsumeIntInRange(0, 2**32 - 1), Kind.ROWS, payload, 3)
            case 5:
                kind = Kind(source.ConsumeIntInRange(1, 5))
                data += encode(1, source.ConsumeIntInRange(0, 9), kind, source.ConsumeBytes(90), 3)
    return data


def test_one(given: bytes) -> None:
    source = atheris.FuzzedDataProvider(given)
    data = journal_of(source) if source.ConsumeBool() else source.ConsumeBytes(sys.maxsize)
    PATH.write_bytes(data)
    try:
        run = read_run(PATH)
        describe(read_sound_run(PATH))
        checks = verify(PATH)
    except RunFileError:
        return
    assert all(seq >= -(2**63) for seq, _ in run.records())
    if all(one.holds for one in checks):
        assert sealing_of(PATH).holds
        assert not run.damage


if __name__ == "__main__":
    atheris.Setup(sys.argv, test_one)
    atheris.Fuzz()
