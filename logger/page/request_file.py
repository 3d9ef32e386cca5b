"""The file in which the page asks the recorder for something."""

import os
from pathlib import Path

import msgspec

from logger.device.page_requests import FILE, PageRequest

_MOST_BYTES = 1 << 18


class RequestFile:
    """Appends requests; the recorder reads them a moment later."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE

    def add(self, request: PageRequest) -> None:
        """Append a line in one write; raises OSError.

        A file that has become long is replaced: the recorder has read it.
        """
        line = msgspec.json.encode(request) + b"\n"
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC
        path = self._path
        is_long = path.exists() and path.stat().st_size > _MOST_BYTES
        if is_long:
            path = path.with_suffix(".new")
        fd = os.open(path, flags, 0o640)
        try:
            os.write(fd, line)
        finally:
            os.close(fd)
        if is_long:
            path.replace(self._path)
