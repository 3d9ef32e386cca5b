"""Many runs that will be kept, each made into something while the next ones are read.

A run that was altered since it was sealed is an error.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

from logger.core.errors import FieldLoggerError, RunFileError, error_text
from logger.core.runfile import Run, read_unaltered_run

_READ_AHEAD = 2
"""Runs, each read by a process of its own while the caller stores the last."""

Item = TypeVar("Item")


def read_ahead(
    paths: Sequence[Path], make: Callable[[Run], Item]
) -> Iterator[tuple[Path, Item | FieldLoggerError]]:
    """What `make` makes of each run, in order, or why that was impossible."""

    def outcome(path: Path) -> Item | FieldLoggerError:
        return outcome_of(path, lambda: make(read_unaltered_run(path)))

    with ThreadPoolExecutor(_READ_AHEAD) as readers:
        waiting: deque[Future[Item | FieldLoggerError]] = deque()
        rest = iter(paths)
        try:
            for path in paths:
                while len(waiting) < _READ_AHEAD and (ahead := next(rest, None)) is not None:
                    waiting.append(readers.submit(outcome, ahead))
                yield path, waiting.popleft().result()
        finally:
            readers.shutdown(cancel_futures=True)


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
