"""Names of runs: numbered, not dated, as a Pi may not know the time.

run-000017.journal       what was recorded
run-000017.journal.2     where it went on after the card had failed; read as one with the first
run-000017.h5            made from them
"""

import re
from contextlib import suppress
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.foreign import begins_with, read_regular

JOURNAL = ".journal"
RESULTS = ".post.h5"  # what `postproc smooth` writes beside a run
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"

# a service that is started again every few seconds reaches the millionth
NUMBERED = r"run-\d{6,}"
_NUMBERED = re.compile(r"run-(\d{6,})\.", re.ASCII)
_LATER_PART = re.compile(r"(.*\.journal)\.\d+")
# a later run with the name of one that was fetched and removed would replace the copy
_LAST = ".last-run"
_NUMBER = re.compile(rb"\d+")


def journal_path(folder: Path) -> Path:
    """Name of a new journal: its number is above all former ones."""
    numbers = [int(match[1]) for path in folder.iterdir() if (match := _NUMBERED.match(path.name))]
    with suppress(OSError):
        if last := _NUMBER.match(read_regular(folder / _LAST, 100)):
            numbers.append(int(last[0]))
    return folder / f"{run_name(max(numbers, default=0) + 1)}{JOURNAL}"


def run_name(number: int) -> str:
    """Without an ending."""
    return f"run-{number:06d}"


def keep_number(journal: Path) -> None:
    """Its number is not given again."""
    with suppress(OSError):  # the number is that of the file as well
        journal.with_name(_LAST).write_text(journal.stem.removeprefix("run-"))


def by_number(name: str) -> tuple[int, str]:
    # run-999999, run-1000000
    return len(name.partition(".")[0]), name


def part_path(journal: Path, part: int) -> Path:
    """Name of the nth file of a journal, from 1."""
    return journal if part == 1 else journal.with_name(f"{journal.name}.{part}")


def first_part(path: Path) -> Path:
    """The name of the journal to which a file belongs."""
    later = _LATER_PART.fullmatch(path.name)
    return path.with_name(later[1]) if later else path


def parts_of(journal: Path) -> list[Path]:
    """All files of a journal in the order of their making.

    Only the first was named by the user, and may be a link: in an untrusted folder the others
    may lead anywhere. Raises `RunFileError` if one is no file, OSError if the folder is
    unreadable.
    """
    later = {
        int(suffix): path
        for path in journal.parent.iterdir()
        if path.name.startswith(f"{journal.name}.")
        and (suffix := path.name[len(journal.name) + 1 :]).isdecimal()
    }
    for path in later.values():
        if path.is_symlink() or not path.is_file():
            raise RunFileError(
                f"{path} is a link or no file; a journal goes on in files of its own"
            )
    if journal.exists() and not journal.is_file():
        raise RunFileError(f"{journal} cannot be read: it is no file")
    return [*([journal] if journal.exists() else []), *(later[number] for number in sorted(later))]


def is_hdf5(path: Path) -> bool:
    """True for a file that begins as HDF5."""
    return begins_with(path, _HDF5_SIGNATURE)
