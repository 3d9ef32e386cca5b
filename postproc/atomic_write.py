"""Files that are written completely or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from logger.core.errors import ConfigError, RunFileError, why_not_written


def check_writable(path: Path) -> None:
    """Check, before the work that fills the file, that `whole_file` can write here.

    Raises `RunFileError`.
    """
    with whole_file(path, keep=False) as part:
        part.touch()


def check_folder(folder: Path) -> None:
    """Check that files can be written into a folder; raises `RunFileError`."""
    check_writable(folder / ".cellwalk")


def check_output(path: Path) -> None:
    """As `check_writable`, for what must not replace a run either: that cannot be made again."""
    from logger.core.runfile import read_sound_run  # noqa: PLC0415 (h5py; most files are written without)

    check_writable(path)
    if path.exists():
        try:
            read_sound_run(path)
        except RunFileError:
            return
        raise RunFileError(f"{path} is a run; choose another name")


@contextmanager
def whole_file(path: Path, *, keep: bool = True) -> Iterator[Path]:
    """Yield a name to write to, which replaces the file at the end; a failure leaves nothing.

    Without `keep` nothing is left in any case. Raises `RunFileError` where it cannot be written;
    HDF5 and rerun report that by RuntimeError too.
    """
    # of a path without a name too; another process that writes the same file has its own part
    part = path.parent / f"{path.name}.{os.getpid()}.part"
    try:
        _check_name(path)
        yield part
        if keep:
            part.replace(path)
    except (OSError, RuntimeError) as error:
        raise RunFileError(f"cannot write {path}: {why_not_written(error)}") from error
    finally:
        with suppress(OSError):  # it could not be made
            part.unlink(missing_ok=True)


def output_remarks(*paths: Path | None) -> list[str]:
    """What a command says of its files."""
    return [f"written: {path}" for path in paths if path is not None]


def _check_name(path: Path) -> None:
    if not path.parent.is_dir():
        raise RunFileError(f"{path.parent}: no such folder")
    if path.is_dir():
        raise RunFileError(f"cannot write {path}: it is a folder")
    if path.exists() and not path.is_file():
        raise RunFileError(f"cannot write {path}: it is no plain file")


def kind_of(path: Path) -> str:
    """Format by the suffix, PNG without one; raises `ConfigError`."""
    from matplotlib.backend_bases import FigureCanvasBase  # noqa: PLC0415 (heavy)

    kind, known = path.suffix[1:].lower() or "png", FigureCanvasBase.filetypes
    if kind not in known:
        raise ConfigError(
            f"{path}: a picture ends in {', '.join('.' + name for name in sorted(known))}"
        )
    return kind


def check_picture(path: Path) -> None:
    """Check that a picture can be written; raises `ConfigError` or `RunFileError`."""
    kind_of(path)
    check_output(path)
