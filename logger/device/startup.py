"""The beginning of a run: its journal is on the card before anything is imported that takes time.

A plug may be pulled, or a process killed, at any moment. Only what a journal needs is imported
here; numpy, the map, HDF5, the drivers and the ports come afterwards (`service`).
"""

import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from logger.config import SiteConfig
from logger.core.errors import ConfigError
from logger.core.runfile import RunMeta, RunWriter, Truth, journal_path, keep_number
from logger.device.clock import Clock, boot_id

LIBRARIES = {name: name for name in ("numpy", "h5py", "pyproj", "pynmea2", "msgspec")} | {
    "pyserial": "serial"
}
"""Distributions, and the modules that they bring."""

# Debian 12 calls its h5py "h5py._debian_h5py_serial-3.7.0.egg-info"
_INSTALLED = re.compile(
    rf"({'|'.join((*LIBRARIES, 'cellwalk'))})(?:\._\w+)?-([^-]+)(?:-py[\d.]+)?\.(?:dist|egg)-info",
    re.ASCII,
)


def begin_run(
    config: SiteConfig,
    config_text: str,
    clock: Clock,
    *,
    origin: str = "walk",
    truth: tuple[Truth, ...] = (),
) -> RunWriter:
    """Begin the next run of the configured folder; its description is durable if the card allows.

    `config_text` is stored in the run; `truth` names the transmitters of a simulated world. Raises
    `ConfigError` for a folder, `RunFileError` for a journal that cannot be made.
    """
    started_ns = clock.now_ns()
    folder = usable_folder(config.run.directory)
    versions = installed_versions()
    meta = RunMeta(
        run_id=os.urandom(16).hex(),
        boot_id=boot_id(),
        started_ns=started_ns,
        origin=origin,
        program=f"cellwalk {versions.get('cellwalk', '')}".strip(),
        versions=versions,
        config_text=config_text,
        live=config.live,
        truth=truth,
    )
    writer = RunWriter(journal_path(folder), meta)
    if origin == "walk":
        keep_number(writer.path)
    return writer


def usable_folder(directory: str) -> Path:
    """Folder of the runs, made if need be; raises `ConfigError`."""
    folder = Path(directory)
    try:
        folder = folder.expanduser()
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = error.strerror
        if isinstance(error, FileExistsError) and not folder.exists():
            why = f"it is a link to {folder.readlink()}, which is missing; is its drive mounted?"
        raise ConfigError(f"[run] directory {directory} cannot be made: {why}") from error
    except (RuntimeError, ValueError) as error:  # no such user; a NUL
        raise ConfigError(f"[run] directory {directory!r} cannot be made: {error}") from error
    return folder


def installed_versions(folders: Sequence[str] | None = None) -> dict[str, str]:
    """Versions of cellwalk, its libraries and Python, by the names of folders: nothing is imported.

    `importlib.metadata` takes ten times as long and would delay the first record.
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
