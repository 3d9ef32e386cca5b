"""A recording that `view --save` has written, shown again."""

from collections.abc import Callable, Sequence
from pathlib import Path
from shutil import copyfile

from logger.core.errors import ConfigError, RunFileError

_MAGIC = b"RRF"
"""Every rerun recording begins so; what follows is its version."""


def is_recording(path: Path) -> bool:
    """Whether a file is named as a recording."""
    return path.suffix.lower() == ".rrd"


def opened(paths: Sequence[Path]) -> Callable[[Path], None]:
    """What copies the one recording to where a viewer reads it; raises `ConfigError` or
    `RunFileError`.
    """
    if len(paths) > 1:
        raise ConfigError("a recording is shown alone: give one .rrd, or runs")
    (source,) = paths
    try:
        with source.open("rb") as file:
            head = file.read(len(_MAGIC))
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error
    if head != _MAGIC:
        raise RunFileError(f"{source} is no rerun recording")
    return lambda target: _copy(source, target)


def _copy(source: Path, target: Path) -> None:
    try:
        copyfile(source, target)
    except OSError as error:
        raise RunFileError(f"{source} cannot be shown: {error.strerror}") from error
