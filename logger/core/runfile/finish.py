"""From journal to HDF5: one function for the stop, for the next boot and for the desk."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.runfile.hdf5 import read_start, write_hdf5
from logger.core.runfile.journal import is_recording, sync_folder
from logger.core.runfile.parts import JournalParts
from logger.core.timebase import fit, utc_text

JOURNAL = ".journal"


def journal_path(folder: Path, boot_id: str) -> Path:
    """Name of a new journal: the boot, and a number where the boot has had a run before; never the wrong date."""
    return _unused(folder, f"run-{boot_id[:8]}", (JOURNAL, ".h5"))


def unfinished(folder: Path) -> list[Path]:
    """Journals in a folder that hold something, have no HDF5 file yet and are not being recorded now."""
    found = sorted(folder.glob(f"*{JOURNAL}"))
    return [p for p in found if p.stat().st_size and not p.with_suffix(".h5").exists() and not is_recording(p)]


def finish_journal(journal: Path) -> Path:
    """Make the HDF5 file of a journal beside it, named by GPS time if known; the journal is kept under the same name.

    Safe to repeat: cut in the middle, it leaves the journal as it was. Raises `RunFileError`.
    """
    target = _convert(journal, journal.with_suffix(".h5.part"), partial(_name, journal))
    if journal.with_suffix(".h5") != target:
        journal.rename(target.with_suffix(JOURNAL))
        sync_folder(journal.parent)
    return target


def convert_journal(journal: Path, target: Path) -> None:
    """Make an HDF5 file of a journal under a given name, complete or not at all."""
    _convert(journal, target.with_name(target.name + ".part"), lambda _: target)


def _convert(journal: Path, part: Path, name: Callable[[Path], Path]) -> Path:
    """Write the HDF5 file as `part`, and give it the name that is found for it then."""
    try:
        write_hdf5(JournalParts(journal), part)
        target = name(part)
        part.replace(target)
        sync_folder(target.parent)
    except OSError as error:
        raise RunFileError(f"cannot write {part.with_suffix('')}: {error}") from error
    finally:
        part.unlink(missing_ok=True)
    return target


def _name(journal: Path, part: Path) -> Path:
    """Where the HDF5 file of a journal belongs: by UTC from GPS, else beside the journal."""
    meta, fixes = read_start(part)
    timebase = fit(fixes["t_ns"], fixes["utc_ns"])
    if timebase is None:
        return journal.with_suffix(".h5")
    stem = f"run-{utc_text(timebase.utc_ns(meta.started_ns), compact=True)}"
    targets = (journal.with_name(f"{name}.h5") for name in _names(stem))
    return next(target for target in targets if not target.exists() or _is_run(target, meta.run_id))


def _is_run(path: Path, run_id: str) -> bool:
    """True when the file is an earlier attempt at the same run."""
    try:
        return read_start(path)[0].run_id == run_id
    except RunFileError:
        return False


def _unused(folder: Path, stem: str, suffixes: tuple[str, ...]) -> Path:
    taken = {p.name for p in folder.iterdir()}
    name = next(name for name in _names(stem) if not any(name + suffix in taken for suffix in suffixes))
    return folder / (name + suffixes[0])


def _names(stem: str) -> Iterator[str]:
    yield stem
    number = 2
    while True:
        yield f"{stem}-{number}"
        number += 1
