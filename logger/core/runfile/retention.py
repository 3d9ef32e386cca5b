"""Free space on the card: journals whose HDF5 file provably has the same content are removed.

A run is removed only where the configuration says so.
"""

import shutil
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.runfile.journal import is_recording, sync_folder
from logger.core.runfile.run_names import JOURNAL, by_number, parts_of

FLOOR_BYTES = 200_000_000
"""Some twenty hours of recording."""


def free_bytes(folder: Path) -> int:
    """Bytes that may still be written there; raises OSError."""
    return shutil.disk_usage(folder).free


def make_room(folder: Path, floor_bytes: int) -> Iterator[Path]:
    """Remove the oldest journals until so much is free; each is compared with its HDF5 file before.

    A journal with a gap stays: something more may be found in it one day. Raises OSError.
    """
    for journal in sorted(folder.glob(f"*{JOURNAL}"), key=lambda path: by_number(path.name)):
        if free_bytes(folder) >= floor_bytes:
            return
        if _is_spare(journal):
            for file in reversed(parts_of(journal)):
                file.unlink()
            sync_folder(folder)
            yield journal


def remove_oldest_runs(folder: Path, floor_bytes: int, is_wanted: bool) -> Iterator[str]:
    """Remove whole runs, the oldest first, until so much is free; only if that is wanted.

    The newest run stays, and so does one that is being recorded. Raises OSError.
    """
    runs: dict[str, list[Path]] = defaultdict(list)
    for file in folder.glob("run-[0-9]*.*") if is_wanted else ():
        runs[file.name.partition(".")[0]].append(file)
    for name in sorted(runs, key=by_number)[:-1]:
        if free_bytes(folder) >= floor_bytes:
            return
        files = sorted(runs[name], key=lambda file: file.suffix == ".h5")  # what is whole goes last
        if _may_be_recording(files):
            continue
        for file in files:
            file.unlink()
        sync_folder(folder)
        yield name


def _may_be_recording(files: list[Path]) -> bool:
    try:
        return any(map(is_recording, files))
    except PermissionError:  # of another user: it stays, and keeps no other run from making room
        return True


def _is_spare(journal: Path) -> bool:
    hdf5 = journal.with_suffix(".h5")
    if not hdf5.exists() or _may_be_recording(parts_of(journal)):
        return False
    # needs HDF5, which only a full card makes necessary
    from logger.core.runfile.run import sealing_of  # noqa: PLC0415

    try:
        sealing = sealing_of(journal)
        return not sealing.damage.missing_frames and sealing == sealing_of(hdf5)
    except RunFileError:
        return False
