"""The libraries that the logger needs, and their versions."""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

LIBRARIES = {name: name for name in ("numpy", "h5py", "pyproj", "pynmea2", "msgspec")} | {"pyserial": "serial"}
"""Distributions, and the modules that they bring."""


def version_of(name: str) -> str:
    """Version of a library; raises ImportError where it cannot be used."""
    module = import_module(LIBRARIES[name])
    try:
        return version(name)
    except PackageNotFoundError:  # Debian 12 calls its h5py "h5py._debian_h5py_serial"
        return str(module.__version__)
