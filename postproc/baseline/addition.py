"""Runs added to a baseline, one after the other, while the next ones are read."""

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from logger.core.errors import FieldLoggerError, RunFileError
from logger.core.runfile import Run, read_small_runs, read_sound_run
from postproc.baseline.store import BaselineStore
from postproc.baseline.walk_summary import WalkSummary, summarise_walk

_READ_AHEAD = 2
"""Groups of runs, each read by a process of its own while this one stores the last."""
_SMALL_BYTES = 1 << 20
"""A walk of hours; for a larger file the start of a process does not matter."""
_TOGETHER = 16
"""Small files that one process reads: it starts in the time in which it reads ten of them."""

Outcome = WalkSummary | FieldLoggerError
"""What reading a run gave."""


@dataclass(frozen=True, slots=True)
class Added:
    """What became of a file: added as a walk, in the baseline already, or unusable.

    `walk` is the number of the walk that was added, `problem` why none was.
    """

    path: Path
    walk: int | None = None
    digest: str = ""
    n_readings: int = 0
    n_squares: int = 0
    n_cells: int = 0
    is_known: bool = False
    problem: str = ""


def add_runs(store: BaselineStore, paths: Sequence[Path]) -> Iterator[Added]:
    """Add each run that is not in the baseline, and yield what became of it, in order.

    Each run is durable when it is yielded. A run that cannot be read does not stop the others.
    """
    with ThreadPoolExecutor(_READ_AHEAD) as readers:
        waiting: deque[Future[list[Outcome]]] = deque()
        rest = iter(_groups(paths))
        try:
            for group in _groups(paths):
                while len(waiting) < _READ_AHEAD and (ahead := next(rest, None)) is not None:
                    waiting.append(readers.submit(_read_group, ahead))
                for path, outcome in zip(group, waiting.popleft().result(), strict=True):
                    yield _add(store, path, outcome)
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


def _read_group(paths: Sequence[Path]) -> list[Outcome]:
    if len(paths) > 1:
        with suppress(RunFileError):
            return [_outcome(run) for run in read_small_runs(paths)]
    return [_outcome(path) for path in paths]


def _outcome(run: Run | Path) -> Outcome:
    try:
        return summarise_walk(read_sound_run(run) if isinstance(run, Path) else run)
    except FieldLoggerError as error:
        return error


def _add(store: BaselineStore, path: Path, outcome: Outcome) -> Added:
    try:
        if isinstance(outcome, FieldLoggerError):
            raise outcome
        number = store.add(outcome)
    except FieldLoggerError as error:
        return Added(path, problem=str(error))
    counts = outcome.n_readings, outcome.n_squares, len(outcome.cells)
    return Added(path, number, outcome.digest, *counts, is_known=number is None)
