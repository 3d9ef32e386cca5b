"""Several runs laid end to end on one clock."""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from logger.core.column import UNKNOWN_TIME
from logger.core.runfile import Run
from postproc.pictures.clock import clock_of

PAUSE_NS = 60 * 10**9
"""Between two runs, so that the end of one and the start of the next can be distinguished."""

_TIME_COLUMNS = ("t_ns", "t_start_ns")


def end_to_end(runs: Sequence[Run]) -> list[Run]:
    """The runs one after the other on one clock, by UTC where it is known, else in the given order.

    Time since boot restarts with each run. Here the first run starts at 0 and the next one
    `PAUSE_NS` after the last record of the one before.
    """
    sequence, start_ns = [], 0
    for run in _by_utc(runs):
        shifted = _shift(run, start_ns - run.meta.started_ns)
        sequence.append(shifted)
        start_ns = _last_ns(shifted) + PAUSE_NS
    return sequence


def _by_utc(runs: Sequence[Run]) -> list[Run]:
    starts = [clock_of([run]).start_text() for run in runs]
    if None in starts:
        return list(runs)
    # ISO 8601 sorts by time
    return [run for _, run in sorted(zip(starts, runs, strict=True), key=lambda pair: str(pair[0]))]


def _last_ns(run: Run) -> int:
    last_ns = [int(np.max(rows["t_ns"])) for rows in run.tables.values() if len(rows)]
    return max([run.meta.started_ns, *last_ns])


def _shift(run: Run, by_ns: int) -> Run:
    tables = {}
    for name, rows in run.tables.items():
        tables[name] = rows.copy()
        for column in _TIME_COLUMNS:
            if column in (rows.dtype.names or ()):
                tables[name][column] += np.where(rows[column] == UNKNOWN_TIME, 0, by_ns)
    meta = msgspec.structs.replace(run.meta, started_ns=run.meta.started_ns + by_ns)
    return replace(run, meta=meta, tables=tables)
