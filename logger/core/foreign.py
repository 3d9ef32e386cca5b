"""Foreign files and JSON: read with bounds, and with one kind of error each."""

import errno
import os
import stat
from codecs import BOM_UTF8
from io import BufferedReader
from pathlib import Path
from typing import TypeVar

import msgspec

Kind = TypeVar("Kind")

_OTHERS = (
    (stat.S_ISDIR, "is a folder, not a file"),
    (stat.S_ISFIFO, "is a pipe: save what comes through it in a file"),
    (stat.S_ISSOCK, "is a socket, not a file"),
    (stat.S_ISLNK, "is a link, not a file"),
)


def check_regular(path: Path, *, follow_links: bool = True) -> int:
    """Size of a regular file.

    Raises OSError, whose `strerror` states what is there instead: a pipe would be waited for, a
    device such as /dev/zero never ends, and another user's link may lead anywhere.
    """
    try:
        return _size(path.stat(follow_symlinks=follow_links), path)
    except ValueError as error:  # a NUL
        raise OSError(errno.EINVAL, f"is no path: {error}", repr(path)) from None


def open_regular(path: Path, *, follow_links: bool = True) -> BufferedReader:
    """A regular file to read; raises as `check_regular`, also for what has replaced it meanwhile.

    It never blocks.
    """
    check_regular(path, follow_links=follow_links)  # to open a device may change it
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | (0 if follow_links else os.O_NOFOLLOW)
    file = os.fdopen(os.open(path, flags), "rb")
    try:
        _size(os.fstat(file.fileno()), path)
    except OSError:
        file.close()
        raise
    return file


def _size(status: os.stat_result, path: Path) -> int:
    if not stat.S_ISREG(status.st_mode):
        other = next((what for is_it, what in _OTHERS if is_it(status.st_mode)), "is a device")
        raise OSError(errno.EINVAL, other, str(path))
    return status.st_size


def read_regular(path: Path, most_bytes: int, *, follow_links: bool = True) -> bytes:
    """All of a regular file; raises OSError also for one that is longer."""
    with open_regular(path, follow_links=follow_links) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"is longer than {most_bytes} bytes", str(path))
    return content


def begins_with(path: Path, magic: bytes) -> bool:
    """Whether a readable file begins with these bytes."""
    try:
        with open_regular(path) as file:
            return file.read(len(magic)) == magic
    except OSError:
        return False


def decode_json(text: bytes, kind: type[Kind]) -> Kind:
    """A value in JSON; raises only `msgspec.DecodeError`, also for bad UTF-8 and deep nesting.

    A byte order mark, which editors of Windows write, is skipped.
    """
    try:
        return msgspec.json.decode(text.removeprefix(BOM_UTF8), type=kind)
    except (UnicodeDecodeError, RecursionError) as error:
        raise msgspec.DecodeError(str(error)) from None
