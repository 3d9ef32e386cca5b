"""Many runs that will be kept, each made into something while the next ones are read.

A run that was altered since it was sealed is an error.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import TypeVar

from logger.core.errors import FieldLoggerError, RunFileError, error_text
from logger.core.runfile import Run, read_small_runs, read_unaltered_run

_READ_AHEAD = 2
"""Groups of runs, each read by a process of its own while the caller stores the last."""
_SMALL_BYTES = 1 << 20
"""A walk of hours; for a larger file the start of a process does not matter."""
_TOGETHER = 16
"""Small files that one process reads: it starts in the time in which it reads ten of them."""

Item = TypeVar("Item")


def read_ahead(
    paths: Sequence[Path], make: Callable[[Run], Item]
) -> Iterator[tuple[Path, Item | FieldLoggerError]]:
    """What `make` makes of each run, in order, or why that was impossible."""
    with ThreadPoolExecutor(_READ_AHEAD) as readers:
        waiting: deque[Future[list[Item | FieldLoggerError]]] = deque()
        rest = iter(_groups(paths))
        try:
            for group in _groups(paths):
                while len(waiting) < _READ_AHEAD and (ahead := next(rest, None)) is not None:
                    waiting.append(readers.submit(_read_group, ahead, make))
                yield from zip(group, waiting.popleft().result(), strict=True)
        finally:
            readers.shutdown(cancel_futures=True)


def _groups(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Paths in their order, small HDF5 files together."""
    for are_small, some in groupby(paths, _is_small):
        together = list(some)
        size = _TOGETHER if are_small else 1
        yield from (together[i : i + size] for i in range(0, len(together), size))


def _is_small(path: Path) -> bool:
    try:
        return path.suffix == ".h5" and path.stat().st_size <= _SMALL_BYTES
    except (OSError, ValueError):  # reading it will state why
        return False


def _read_group(
    paths: Sequence[Path], make: Callable[[Run], Item]
) -> list[Item | FieldLoggerError]:
    if len(paths) > 1:
        with suppress(RunFileError):
            return [_outcome(run, make) for run in read_small_runs(paths)]
    return [_outcome(path, make) for path in paths]


def _outcome(run: Run | Path, make: Callable[[Run], Item]) -> Item | FieldLoggerError:
    path = run if isinstance(run, Path) else run.path
    return outcome_of(path, lambda: make(read_unaltered_run(run) if isinstance(run, Path) else run))


def outcome_of(path: Path, work: Callable[[], Item]) -> Item | FieldLoggerError:
    """What work on a file returns, or why it failed: one bad file does not stop the others."""
    try:
        return work()
    except FieldLoggerError as error:
        return error
    except Exception as error:  # noqa: BLE001 (it is that of the file)
        return RunFileError(
            f"{path} cannot be used, by an error of this program: {error_text(error)}"
        )
