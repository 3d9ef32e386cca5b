"""Files and texts that no program of ours writes, for every reader of what others wrote."""

import os
import random
import stat
from pathlib import Path

from tests.kit import service

TEXTS: dict[str, bytes] = {
    "nothing": b"",
    "invalid UTF-8": b"\xff",
    "invalid UTF-8 in JSON": b'{"state":"\xff","run":"\xc3\x28"}',
    "UTF-16": '{"state":"a"}'.encode("utf-16"),
    "NULs": b"\0" * 1000,
    "a huge line": b"9" * 5_000_000,
    "400 digits": b"9" * 400,
    "400 digits in JSON": b'{"now_ns":%s}' % (b"9" * 400),
    "5000 digits": b"-" + b"9" * 5000,
    "nested arrays": b"[" * 50_000,
    "nested objects": b'{"a":' * 50_000,
    "half a surrogate": b'{"state":"\\ud800"}',
    "the same key twice": b'{"state":"error","state":1}',
    "another type": b'[1, null, {"state": []}]',
    "infinity": b"1e999",
    "control characters": b"\x1b[2J\x07[none]\x9b\r\n",
}
KINDS = ("pipe", "socket", "folder", "loop", "endless", "huge", "gone")


def make(path: Path, kind: str) -> None:
    """Put something there that is no file, or one without an end."""
    match kind:
        case "pipe":
            os.mkfifo(path)
        case "socket":
            os.mknod(path, stat.S_IFSOCK | 0o600)
        case "folder":
            path.mkdir()
        case "loop":
            path.symlink_to(path)
        case "endless":
            path.symlink_to("/dev/zero")
        case "huge":
            path.touch()
            os.truncate(path, 3 << 30)
        case "gone":
            path.symlink_to(path.with_name("nowhere"))
        case _:
            path.write_bytes(TEXTS[kind])


def attempt(read, *allowed: type[Exception]) -> object:
    """Let something read; it has to end in time, with an answer or one of the allowed errors."""
    outcome: list[object] = []

    def run() -> None:
        try:
            outcome.append(read())
        except allowed as error:
            outcome.append(error)

    service.assert_ends(run, 10.0)
    assert outcome, "ended with another error"
    return outcome[0]


def damage(data: bytes, rng: random.Random) -> bytes:
    """Some bytes otherwise; heads and ends, which hold counts and offsets, as often as the rest."""
    changed = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 5, 20])):
        end = min(len(changed), rng.choice([16, 128, 1024, len(changed)]))
        at = rng.randrange(end) if rng.random() < 0.7 else len(changed) - 1 - rng.randrange(end)
        length = rng.choice([1, 2, 8, 60])
        match rng.randrange(5):
            case 0:
                changed[at] ^= 1 << rng.randrange(8)
            case 1:
                changed[at : at + length] = rng.randbytes(length)
            case 2:
                changed[at : at + length] = bytes([rng.choice([0, 127, 128, 255])]) * length
            case 3:
                changed[at:at] = changed[at : at + length]
            case _:
                del changed[at : at + length]
        changed = changed or bytearray(1)
    return bytes(changed)
