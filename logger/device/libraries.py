"""The libraries that the logger needs, and their versions."""

import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path

LIBRARIES = {name: name for name in ("numpy", "h5py", "pyproj", "pynmea2", "msgspec")} | {
    "pyserial": "serial"
}
"""Distributions, and the modules that they bring."""

# Debian 12 calls its h5py "h5py._debian_h5py_serial-3.7.0.egg-info"
_INSTALLED = re.compile(
    rf"({'|'.join((*LIBRARIES, 'cellwalk'))})(?:\._\w+)?-([^-]+)(?:-py[\d.]+)?\.(?:dist|egg)-info",
    re.ASCII,
)


def installed_versions(folders: Sequence[str] | None = None) -> dict[str, str]:
    """Versions of cellwalk, its libraries and Python, by the names of folders: nothing is imported.

    `importlib.metadata` reports the same in ten times the time, which would delay the first record.
    """
    found: dict[str, str] = {}
    for folder in sys.path if folders is None else folders:
        with suppress(OSError):
            for path in Path(folder).iterdir():
                if match := _INSTALLED.fullmatch(path.name):
                    found.setdefault(*match.groups())
    return found | {"python": sys.version.split()[0]}


def version_of(name: str) -> str:
    """Version of a library; raises ImportError where it cannot be used."""
    module = import_module(LIBRARIES[name])
    return installed_versions().get(name) or str(module.__version__)
