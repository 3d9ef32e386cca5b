"""Where a folder is stored: on a card, or in memory, whose content a power cut erases."""

import re
from pathlib import Path
from typing import NamedTuple

MOUNTINFO = Path("/proc/self/mountinfo")


class _Mount(NamedTuple):
    kind: str
    point: str
    options: str


def kept_in_memory(folder: Path, mountinfo: str) -> str:
    """Kind and mount point of the file system in memory that holds a folder; empty for a card.

    `mountinfo` is the text of /proc/self/mountinfo (proc(5)), the folder's path is without links.
    An overlay stores what is written in its upper folder; if that folder is invisible, an initramfs
    mounted it, which has only memory.
    """
    mounts = {
        mount.point: mount for mount in map(_mount, mountinfo.splitlines())
    }  # the last one on a point counts
    mount = _under(folder, mounts)
    upper = re.search("upperdir=([^,]+)", mount.options)
    if mount.kind == "overlay" and upper:
        hidden = _under(Path(upper[1]), mounts) == mount
        return f"overlay at {mount.point}" if hidden else kept_in_memory(Path(upper[1]), mountinfo)
    return f"{mount.kind} at {mount.point}" if mount.kind in {"tmpfs", "ramfs"} else ""


def _mount(line: str) -> _Mount:
    """Parse `36 35 98:0 /root /point rw,noatime master:1 - ext4 /dev/source rw,option=value`.

    Blanks in names are octal escapes.
    """
    here, there = (part.split() for part in line.split(" - ", 1))
    return _Mount(
        there[0], re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), here[4]), there[-1]
    )


def _under(path: Path, mounts: dict[str, _Mount]) -> _Mount:
    """The mount that a path lies on; in a chroot its root may be none, and of no known kind."""
    holding = (mounts[str(one)] for one in (path, *path.parents) if str(one) in mounts)
    return next(holding, _Mount("", "/", ""))
