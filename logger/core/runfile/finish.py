"""From journal to HDF5, at the stop, the next boot and the desk; reports what was lost."""

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from logger.core.errors import RunFileError, why_not_written
from logger.core.isolation import run_isolated
from logger.core.runfile.hdf5 import write_hdf5
from logger.core.runfile.journal import is_recording, sync_folder
from logger.core.runfile.journal_reader import JournalParts
from logger.core.runfile.meta import Damage
from logger.core.runfile.retention import free_bytes
from logger.core.runfile.run import HDF5_READER
from logger.core.runfile.run_names import JOURNAL, first_part, is_hdf5, parts_of

_MARGIN_BYTES = 1 << 20
_MOST_TRIES = 100
_NONE = Damage()


def unfinished_journals(folder: Path) -> list[Path]:
    """Journals with content and without an HDF5 file that no logger is writing."""
    found = sorted({p for p in map(first_part, folder.iterdir()) if p.suffix == JOURNAL})
    return [p for p in found if not p.with_suffix(".h5").exists() and _waits(p)]


def _waits(journal: Path) -> bool:
    try:
        return bool(_n_bytes(journal)) and not _is_recording(journal)
    except (RunFileError, OSError):
        return True


def finish_journal(journal: Path) -> Path:
    """Make the HDF5 file of a journal beside it, under the same name; the journal stays as it is.

    Safe to repeat, and to cut in the middle. Raises `RunFileError`, also where the HDF5 file is of
    another run.
    """
    return _finish(journal)[0]


def _finish(journal: Path) -> tuple[Path, JournalParts]:
    """As `finish_journal`; also what was read of the journal."""
    journal = first_part(journal)
    target = journal.with_suffix(".h5")
    try:
        if _is_recording(journal):
            raise RunFileError(f"{journal} is being recorded")
    except OSError as error:
        raise RunFileError(f"{error.filename or journal}: {error.strerror}") from error
    return target, _convert(journal, target, _check_same_run, "; the journal is safe")


def convert_journal(journal: Path, target: Path) -> Damage:
    """Make an HDF5 file of a journal under a given name, complete or not at all.

    Returns what the journal has lost. Replaces a file of that name. Raises `RunFileError`.
    """
    return _convert(journal, target, lambda *_: None, "").damage


def _convert(
    journal: Path, target: Path, may_replace: Callable[[Path, str], None], what_stays: str
) -> JournalParts:
    parts = JournalParts(journal)
    part = target.with_name(target.name + ".part")
    try:
        with _alone(part):
            _check_room(parts, target, what_stays)
            write_hdf5(parts, part)
            may_replace(target, parts.meta.run_id)
            part.replace(target)
        sync_folder(target.parent)
    except (OSError, RuntimeError) as error:  # HDF5 reports a full card by RuntimeError too
        raise RunFileError(f"cannot write {target}: {why_not_written(error)}") from error
    return parts


@contextmanager
def _alone(part: Path) -> Iterator[None]:
    # The service at its stop, the unit at the boot or a user: the others wait, where it is about
    # the same run. The part has the lock until it is the run, which HDF5 locks as well to read it.
    number = _claim(part)
    try:
        yield
    finally:
        if _is_named(part, number):
            with suppress(OSError):
                part.unlink()
        _let_go(number)


def _claim(part: Path) -> int:
    for _ in range(_MOST_TRIES):
        number = _lock(part)
        if _is_named(part, number):
            if os.access(part, os.W_OK, effective_ids=True):
                return number
            part.unlink()  # left by another user
        _let_go(number)  # it is the run now, or gone
    return _lock(part)  # of a file system that numbers a file anew at each look


def _lock(part: Path) -> int:
    flags = os.O_CREAT | os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        number = os.open(part, flags, 0o666)
    except PermissionError:
        if not os.path.lexists(part):
            raise
        part.unlink()  # left by a user who hides files from others
        number = os.open(part, flags, 0o666)
    with suppress(OSError):  # a file system without locks
        fcntl.flock(number, fcntl.LOCK_EX)
    return number


def _is_named(part: Path, number: int) -> bool:
    try:
        return os.path.samestat(os.fstat(number), part.lstat())
    except OSError:
        return False


def _let_go(number: int) -> None:
    with suppress(OSError):  # also that of a process which was forked meanwhile
        fcntl.flock(number, fcntl.LOCK_UN)
    os.close(number)


def _check_room(parts: JournalParts, target: Path, what_stays: str) -> None:
    """Raises `RunFileError` if the card is too full: HDF5 may crash on a full card."""
    needed = _n_bytes(parts.path) + _MARGIN_BYTES
    if free_bytes(target.parent) < needed:
        raise RunFileError(f"no room for {target}: {needed / 1e6:.0f} MB must be free{what_stays}")


def _check_same_run(target: Path, run_id: str) -> None:
    if not target.exists():
        return
    try:
        found, _ = run_isolated(f"{HDF5_READER}:read_run_id", target)
    except RunFileError:
        return  # a damaged one
    if found != run_id:
        raise RunFileError(f"{target} is of another run; move it away first")


def _n_bytes(journal: Path) -> int:
    return sum(path.stat().st_size for path in parts_of(journal))


def _is_recording(journal: Path) -> bool:
    return any(map(is_recording, parts_of(journal)))


@dataclass(frozen=True, slots=True)
class Recovered:
    """What became of one journal: its HDF5 file and what it lacks, or why there is none."""

    journal: Path
    run: Path | None = None
    damage: Damage = _NONE
    digest: str = ""
    error: str = ""

    @property
    def loss(self) -> str:
        """One line on what was lost, empty where nothing was."""
        if self.error:
            return self.error
        return f"{self.journal}: {self.damage}" if self.damage else ""

    def as_dict(self) -> dict[str, str | None]:
        """For machines: paths, digest and loss."""
        run = str(self.run) if self.run else None
        return {"journal": str(self.journal), "run": run, "digest": self.digest, "loss": self.loss}

    def __str__(self) -> str:
        return f"{self.run}  digest {self.digest}" if self.run else f"{self.journal}: not recovered"


def recover(path: Path) -> Iterator[Recovered]:
    """Recover one journal, or all in a folder that have no HDF5 file yet.

    In a folder, an unreadable one does not keep the others. Raises `RunFileError` for a single one.
    """
    if not path.is_dir():
        if path.is_file() and is_hdf5(path):
            raise RunFileError(f"{path} is a finished run, no journal")
        yield _recover_one(path)
        return
    for journal in unfinished_journals(path):
        try:
            yield _recover_one(journal)
        except RunFileError as error:
            yield Recovered(journal, error=str(error))


def _recover_one(journal: Path) -> Recovered:
    run, parts = _finish(journal)
    return Recovered(journal, run, parts.damage, parts.digest)
