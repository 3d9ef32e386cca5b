"""Files that are written whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from logger.core.errors import RunFileError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a name to write to; what stands there gets its own name at the end, and nothing is left after a failure.

    Raises `RunFileError` where it cannot be written; HDF5 and rerun tell of that by RuntimeError too.
    """
    if not path.parent.is_dir():
        raise RunFileError(f"{path}: no such folder")
    part = path.with_name(path.name + ".part")
    try:
        yield part
        part.replace(path)
    except (OSError, RuntimeError) as error:
        raise RunFileError(f"cannot write {path}: {getattr(error, 'strerror', None) or error}") from error
    finally:
        part.unlink(missing_ok=True)
