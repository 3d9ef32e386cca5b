"""A progress bar on the terminal: the current item, the count and the time left."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from logger.core.printable import printable

_BAR_CELLS = 12
"""Beside the name of a cell it all fits in 80 columns."""

T = TypeVar("T")


def with_progress(
    items: Iterable[T], what: str, total: int, names: Sequence[str] = ()
) -> Iterator[T]:
    """Show a bar with the `names` of the items on stderr, if it is a terminal."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(_BAR_CELLS),
        TextColumn("{task.completed} of {task.total}", markup=False),
        TimeElapsedColumn(),
        TextColumn("left", markup=False),
        TimeRemainingColumn(),
    )
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        task = progress.add_task(_now(what, names, 0), total=total)
        for done, item in enumerate(items, 1):
            yield item
            progress.update(task, completed=done, description=_now(what, names, done))


def _now(what: str, names: Sequence[str], done: int) -> str:
    return f"{what} {printable(names[done])}" if done < len(names) else what
