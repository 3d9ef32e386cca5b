"""Runs added to a baseline, one after the other, while the next ones are read."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from logger.core.errors import FieldLoggerError
from logger.core.runfile import sealing_of
from postproc.baseline.store import BaselineStore
from postproc.baseline.walk_summary import WalkSummary, summarise_walk
from postproc.read_ahead import read_ahead

CONTRADICTION = (
    "{} says that it is the same run and differs: one of them was changed and sealed anew. Both "
    "count; the digest that was noted at the stop shows which is genuine"
)


@dataclass(frozen=True, slots=True)
class Added:
    """What became of a file: added as a walk, in the baseline already, or unusable.

    `walk` is the number of the walk that was added, `problem` why none was; `remark` says of one
    that was added what contradicts it.
    """

    path: Path
    walk: int | None = None
    digest: str = ""
    n_readings: int = 0
    n_squares: int = 0
    n_cells: int = 0
    is_known: bool = False
    problem: str = ""
    remark: str = ""


def add_runs(store: BaselineStore, paths: Sequence[Path]) -> Iterator[Added]:
    """Add each run that is not in the baseline, and yield what became of it, in order.

    Each run is durable when it is yielded. A run that cannot be read does not stop the others.
    """
    for path, outcome in read_ahead(paths, summarise_walk):
        yield _add(store, path, outcome)


def _add(store: BaselineStore, path: Path, outcome: WalkSummary | FieldLoggerError) -> Added:
    try:
        if isinstance(outcome, FieldLoggerError):
            raise outcome
        number = store.add(outcome, lambda earlier: sealing_of(path, earlier).continues)
        others = [] if number is None else store.contradictions(number)
    except FieldLoggerError as error:
        return Added(path, problem=str(error))
    counts = outcome.n_readings, outcome.n_squares, len(outcome.cells)
    remark = CONTRADICTION.format(f"walk {others[0]}") if others else ""
    return Added(path, number, outcome.digest, *counts, is_known=number is None, remark=remark)
