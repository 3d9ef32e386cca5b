"""Lines of `fieldlogger check`, and the one about a port."""

import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

NOT_THERE = "is not there now"
_MEMORY_DEVICES = 1
"""Their major number: /dev/zero and /dev/null are no ports (Linux admin-guide/devices.txt)."""
State = Literal["ok", "warn", "fail"]


@dataclass(frozen=True, slots=True)
class Line:
    """One thing checked: `warn` may still come right by itself, `fail` will not."""

    state: State
    what: str
    text: str


def port_line(name: str, url: str) -> Line:
    """Whether a port that may be plugged in later is there now, and may be used."""
    if "://" in url:
        return Line("ok", name, f"{url} is a network port, not looked at")
    path = Path(url)
    try:
        status = path.stat()
        is_device = stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) != _MEMORY_DEVICES
    except FileNotFoundError:
        return Line("warn", name, f"{url} {NOT_THERE}; it is picked up when it is plugged in")
    except OSError as error:
        return Line("fail", name, f"{url}: {error.strerror}")
    if not is_device:
        return Line("fail", name, f"{url} is no serial port")
    if not os.access(path, os.R_OK | os.W_OK):
        return Line("fail", name, f"no permission for {url}; add this user to the group dialout")
    return Line("ok", name, url)
