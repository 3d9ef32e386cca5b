"""Files and JSON that somebody else wrote: read with bounds, and with one kind of error each."""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO, TypeVar

import msgspec

Kind = TypeVar("Kind")


def open_regular(path: Path, *, follow_links: bool = False) -> BinaryIO:
    """A regular file to read; raises OSError for anything else, and never blocks.

    A pipe would block, a device would never end, and another user's link may lead anywhere.
    """
    flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | (0 if follow_links else os.O_NOFOLLOW)
    try:
        fd = os.open(path, flags)
    except ValueError as error:  # a NUL
        raise OSError(errno.EINVAL, f"is no path: {error}", repr(path)) from None
    if not stat.S_ISREG(os.fstat(fd).st_mode):
        os.close(fd)
        raise OSError(errno.EINVAL, "is no regular file", str(path))
    return os.fdopen(fd, "rb")


def read_regular(path: Path, most_bytes: int, *, follow_links: bool = False) -> bytes:
    """All of a regular file; raises OSError also for one that is longer."""
    with open_regular(path, follow_links=follow_links) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"is longer than {most_bytes} bytes", str(path))
    return content


def decode_json(text: bytes, kind: type[Kind]) -> Kind:
    """A value in JSON; raises `msgspec.DecodeError` whatever is wrong with it.

    msgspec lets two errors of Python through: of a text that is no UTF-8, and of one that is nested
    too deeply.
    """
    try:
        return msgspec.json.decode(text, type=kind)
    except (UnicodeDecodeError, RecursionError) as error:
        raise msgspec.DecodeError(str(error)) from None
