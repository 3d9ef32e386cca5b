"""A recording that `view --save` has written, opened again."""

from collections.abc import Callable, Sequence
from pathlib import Path
from shutil import copyfile

from logger.core.errors import ConfigError, RunFileError
from logger.core.foreign import open_regular

_MAGIC = b"RRF"
"""Every rerun recording starts with it; its version follows."""


def is_recording(path: Path) -> bool:
    """Whether a file has the name of a recording."""
    return path.suffix.lower() == ".rrd"


def copy_recording(paths: Sequence[Path]) -> Callable[[Path], None]:
    """A function that copies the one recording to where a viewer reads it.

    Raises `ConfigError` or `RunFileError`.
    """
    if len(paths) > 1:
        raise ConfigError("give one recording (.rrd) alone, or runs")
    (source,) = paths
    try:
        with open_regular(source) as file:
            magic = file.read(len(_MAGIC))
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error
    if magic != _MAGIC:
        raise RunFileError(f"{source} is not a rerun recording")
    return lambda target: _copy(source, target)


def _copy(source: Path, target: Path) -> None:
    try:
        copyfile(source, target)
    except OSError as error:
        raise RunFileError(f"{source} cannot be shown: {error.strerror}") from error
