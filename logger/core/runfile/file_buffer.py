"""A file on a failing card as a buffer.

A memory map of a sector that cannot be read would end the program (SIGBUS).
"""

import mmap
import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from logger.core.runfile.frames import Buffer

SECTOR = 4096
_CHUNK = 1 << 20
_UNREADABLE = b"\xff"
"""Zeros would pass for the reserve at the end of a journal."""


def buffer_of(stack: ExitStack, path: Path) -> Buffer:
    """The bytes of a file, with unreadable ones replaced.

    A file without them is a memory map, which `stack` closes.
    """
    file = stack.enter_context(path.open("rb", buffering=0))
    fd = file.fileno()
    size = os.fstat(fd).st_size
    if not size:
        return b""
    if all(_read(fd, at, _CHUNK) is not None for at in range(0, size, _CHUNK)):
        return stack.enter_context(mmap.mmap(fd, 0, access=mmap.ACCESS_READ))
    return b"".join(_pieces(fd, size))


def _pieces(fd: int, size: int) -> Iterator[bytes]:
    for at in range(0, size, SECTOR):
        length = min(SECTOR, size - at)
        piece = _read(fd, at, length)
        yield _UNREADABLE * length if piece is None else piece


def _read(fd: int, at: int, length: int) -> bytes | None:
    """None where the card does not give them."""
    try:
        return os.pread(fd, length, at)
    except OSError:
        return None
