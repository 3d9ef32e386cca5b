"""The work on one cell, which may fail without ending that of the others.

`attempt` is the one place where an exception becomes the reason in a row. That the readings do not
hold the answer is such a reason. Anything else is an error of this program: it is logged with its
type, stands in the row, and the command ends with `SOMETHING_LOST`. Too little memory counts as
one, since what a cell has taken is free again afterwards. Errors of the command line, of a file and
of the installation end the command, as Ctrl-C does.
"""

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple, Protocol, TypeVar

from msgspec import UnsetType

from logger.core.errors import (
    SOMETHING_LOST,
    ConfigError,
    DeviceError,
    EstimationError,
    GeoError,
    RunFileError,
    error_text,
)
from logger.core.printable import printable
from postproc.progress import Progress

PROCESS_ENDED = "its process ended: too little memory, or a library crashed"

_OF_ALL_CELLS = (ConfigError, DeviceError, RunFileError, ImportError)

_log = logging.getLogger("postproc")

T = TypeVar("T")
Item = TypeVar("Item")


class Failure(NamedTuple):
    """Why a cell has no result; `error` is that of the program, None where the readings lack it."""

    cell: str
    reason: str
    error: str | None


class Row(Protocol):
    """A row about a cell; JSON leaves the error out where there is none."""

    @property
    def error(self) -> str | UnsetType | None: ...


def attempt(cell: str, what: str, work: Callable[[], T]) -> T | Failure:
    """What `work` returns, or why it failed; `what` completes "... failed"."""
    try:
        return work()
    except _OF_ALL_CELLS:
        raise
    except (EstimationError, GeoError) as error:
        return Failure(cell, str(error), None)
    except Exception as error:  # noqa: BLE001 (shown, logged and told by the exit code)
        return failure(cell, what, error_text(error))


def attempt_alone(cell: str, what: str, work: Callable[[], T]) -> T:
    """As `attempt`, for a command about one cell: raises `EstimationError` with the reason."""
    result = attempt(cell, what, work)
    if isinstance(result, Failure):
        raise EstimationError(f"{cell}: {result.reason}")
    return result


class Attempts:
    """Attempts at many cells in several steps: one that failed takes part in no further one."""

    def __init__(self, what: str, progress: Progress | None = None, doing: str = "") -> None:
        self._what, self._progress, self._doing = what, progress, doing
        self.failures: dict[str, Failure] = {}

    def each(
        self, items: Iterable[Item], cell_of: Callable[[Item], str], work: Callable[[Item], T]
    ) -> list[tuple[Item, T]]:
        """Each item of a cell that has not failed, with what `work` returns."""
        done: list[tuple[Item, T]] = []
        if self._progress is not None:
            items = list(items)
            items = self._progress(items, self._doing, len(items), list(map(cell_of, items)))
        for item in items:
            cell = cell_of(item)
            if cell in self.failures:
                continue
            result = attempt(cell, self._what, partial(work, item))
            if isinstance(result, Failure):
                self.failures[cell] = result
            else:
                done.append((item, result))
        return done


def failure(cell: str, what: str, error: str) -> Failure:
    """The failure of a cell by an error of the program, which is logged."""
    reason = f"{what} failed, which is an error of this program: {error}"
    _log.warning("%s: %s", printable(cell), printable(reason))
    return Failure(cell, reason, error)


def exit_code(rows: Iterable[Row]) -> int:
    """Exit code of a command that has printed these rows."""
    return SOMETHING_LOST if any(isinstance(row.error, str) for row in rows) else 0
