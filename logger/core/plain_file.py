"""Plain files to read: whatever else stands at a path is refused at once."""

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path

_OTHERS = (
    (stat.S_ISDIR, "is a folder, not a file"),
    (stat.S_ISFIFO, "is a pipe: save what comes through it in a file"),
    (stat.S_ISSOCK, "is a socket, not a file"),
)


def check_plain(path: Path) -> int:
    """Size of a plain file.

    Raises OSError, whose `strerror` states what is there instead: a pipe would be waited for, and
    a device such as /dev/zero never ends.
    """
    return _size(path.stat(), path)


def open_plain(path: Path) -> BufferedReader:
    """A plain file to read; raises as `check_plain`, also for what has replaced it meanwhile."""
    check_plain(path)  # to open a device may change it
    file = os.fdopen(os.open(path, _FLAGS), "rb")
    try:
        _size(os.fstat(file.fileno()), path)
    except OSError:
        file.close()
        raise
    return file


_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)


def _size(status: os.stat_result, path: Path) -> int:
    if not stat.S_ISREG(status.st_mode):
        other = next((what for is_it, what in _OTHERS if is_it(status.st_mode)), "is a device")
        raise OSError(errno.EINVAL, other, str(path))
    return status.st_size
