"""Records as a run file."""

import secrets
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from logger.core.errors import RunFileError
from logger.core.runfile import RunMeta, RunWriter, convert_journal, read_sound_run
from logger.core.types import Record

_SYNC_EVERY = 50_000
"""Records; what is not synced is held in memory."""

Append = Callable[[Record], int]


def meta_of(origin: str, **more: object) -> RunMeta:
    """Description of a run that was not recorded but made; it names no machine."""
    named = {
        "run_id": secrets.token_hex(16),
        "boot_id": "",
        "started_ns": 0,
        "program": f"cellwalk {version('cellwalk')}",
    }
    return RunMeta(**named, origin=origin, **more)  # type: ignore[arg-type]


def spare(target: Path, origin: str | tuple[str, ...], what: str) -> None:
    """Only a run of the same origin may be replaced: all else cannot be made again.

    Raises `RunFileError`.
    """
    if target.exists() and not read_sound_run(target).meta.origin.startswith(origin):
        raise RunFileError(f"{target} is a recorded run; choose another name for the {what}")


def write_run(target: Path, meta: RunMeta, fill: Callable[[Append], int], reason: str) -> None:
    """A run as HDF5; `fill` appends its records and returns the time of the end.

    Raises `RunFileError`.
    """
    try:
        with TemporaryDirectory(dir=target.parent) as scratch:
            journal = Path(scratch) / "made.journal"
            writer = RunWriter(journal, meta)

            def append(record: Record) -> int:
                seq = writer.append(record)
                if seq % _SYNC_EVERY == 0:
                    writer.sync()
                return seq

            end_ns = fill(append)
            writer.close(end_ns, reason)
            convert_journal(journal, target)
    except OSError as error:
        raise RunFileError(f"cannot write {target}: {error.strerror}") from error
