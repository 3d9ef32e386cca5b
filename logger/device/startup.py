"""The beginning of a run: its journal is on the card before anything is imported that takes time.

A plug may be pulled, or a process killed, at any moment. What is imported here and in the modules
behind it is what a journal needs; numpy, the map, HDF5, the drivers and the ports come afterwards
(`service`).
"""

import os
from dataclasses import dataclass
from pathlib import Path

from logger.config import SiteConfig
from logger.core.errors import ConfigError
from logger.core.runfile import RunMeta, RunWriter, Truth, journal_path
from logger.device.clock import Clock, boot_id
from logger.device.libraries import installed_versions


@dataclass(frozen=True, slots=True)
class BegunRun:
    """A run whose description is durable, unless the card refuses; it waits for records."""

    folder: Path
    writer: RunWriter
    started_ns: int


def begin_run(
    config: SiteConfig,
    config_text: str,
    clock: Clock,
    *,
    origin: str = "walk",
    truth: tuple[Truth, ...] = (),
) -> BegunRun:
    """Begin the next run of the configured folder.

    `config_text` is stored in the run; `truth` names the transmitters of a simulated world. Raises
    `ConfigError` for a folder that cannot be made, `RunFileError` for a journal that cannot.
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
    return BegunRun(folder, RunWriter(journal_path(folder), meta), started_ns)


def usable_folder(directory: str) -> Path:
    """Folder of the runs, made if need be; raises `ConfigError`."""
    try:
        folder = Path(directory).expanduser()
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(
            f"[run] directory {directory} cannot be made: {error.strerror}"
        ) from error
    except (RuntimeError, ValueError) as error:  # no such user; a NUL
        raise ConfigError(f"[run] directory {directory!r} cannot be made: {error}") from error
    return folder
