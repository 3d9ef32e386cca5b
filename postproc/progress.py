"""A progress bar on the terminal: the current item, the count and the time left.

Elsewhere a line says so now and then.
"""

import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from threading import Event, Thread
from typing import Protocol, TypeVar

from logger.core.printable import printable

_BAR_CELLS = 12
"""Beside the name of a cell it all fits in 80 columns."""
_SILENCE_S = 10.0
"""Between two lines of long work; what is over before needs none."""
_COUNT_EVERY = 100
"""An update takes as long as a row."""

Item = TypeVar("Item")


class Progress(Protocol):
    """Passes `total` items on as they come, and shows the count and the name of the next."""

    def __call__(
        self, items: Iterable[Item], what: str, total: int, names: Sequence[str] = ()
    ) -> Iterable[Item]: ...


def with_progress(
    items: Iterable[Item], what: str, total: int, names: Sequence[str] = ()
) -> Iterator[Item]:
    """Show a bar with the `names` of the items on stderr, or lines if it is no terminal."""
    if sys.stderr.isatty():
        return _with_bar(items, what, total, names)
    return _with_lines(items, what, total) if total else iter(items)


def _with_lines(items: Iterable[Item], what: str, total: int = 0) -> Iterator[Item]:
    n_done, is_over, began_s = 0, Event(), time.monotonic()

    def write_lines() -> None:
        while not is_over.wait(_SILENCE_S):
            passed_s, left = time.monotonic() - began_s, ""
            if n_done and total:
                left = f", about {passed_s / n_done * (total - n_done):.0f} s left"
            count = f"{n_done:,} of {total:,}" if total else f"{n_done:,}"
            sys.stderr.write(f"{what}: {count} after {passed_s:.0f} s{left}\n")

    lines = Thread(target=write_lines, name="progress", daemon=True)
    lines.start()
    try:
        for item in items:
            yield item
            n_done += 1
    finally:
        is_over.set()
        lines.join()


def _with_bar(
    items: Iterable[Item], what: str, total: int | None = None, names: Sequence[str] = ()
) -> Iterator[Item]:
    from rich.console import Console  # noqa: PLC0415 (0.1 s; this and the next for a terminal only)
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    def text(form: str) -> ProgressColumn:
        return TextColumn(form, markup=False)

    columns = [text("{task.description}"), text("{task.completed:,}"), TimeElapsedColumn()]
    every = _COUNT_EVERY
    if total is not None:
        bar, count = BarColumn(_BAR_CELLS), text("{task.completed} of {task.total}")
        columns = [columns[0], bar, count, columns[2], text("left"), TimeRemainingColumn()]
        every = 1
    console = Console(stderr=True)
    with Progress(
        *columns,
        console=console,
        transient=True,
        disable=not console.is_terminal,
        # else rich writes through the filter of control characters
        redirect_stdout=False,
        redirect_stderr=False,
    ) as progress:
        task = progress.add_task(_now(what, names, 0), total=total)
        for done, item in enumerate(items, 1):
            yield item
            if done % every == 0 or done < every:
                progress.update(task, completed=done, description=_now(what, names, done))


def with_count(items: Iterable[Item], what: str) -> Iterator[Item]:
    """Show on stderr the count alone, of items whose total nobody knows."""
    return (_with_bar if sys.stderr.isatty() else _with_lines)(items, printable(what))


def _now(what: str, names: Sequence[str], done: int) -> str:
    return f"{what} {printable(names[done])}" if done < len(names) else what
