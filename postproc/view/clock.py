"""Times of one run, or of several laid end to end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from logger.core.arrays import IntArray
from logger.core.runfile import Run
from logger.core.schema import UNKNOWN_TIME
from logger.core.timebase import TimeBase, fit_run

PAUSE_NS = 60 * 10**9
"""Between two runs laid end to end, so that the end of one and the begin of the next stay apart."""

_TIMES = ("t_ns", "t_start_ns")


@dataclass(frozen=True, slots=True)
class Clock:
    """Time walked since the start of the first run, and UTC where GPS told it in every run.

    `starts_ns` (k,) are the starts of the runs, ascending, `timebases` what each knows of UTC.
    """

    starts_ns: IntArray
    timebases: tuple[TimeBase | None, ...]

    @property
    def knows_utc(self) -> bool:
        """Whether every time has a UTC."""
        return None not in self.timebases

    def elapsed_ns(self, t_ns: IntArray) -> IntArray:
        """Time since the start of the first run."""
        return t_ns - int(self.starts_ns[0])

    def utc_ns(self, t_ns: IntArray) -> IntArray | None:
        """UTC, None when it is unknown."""
        told = [timebase.utc_ns_array(t_ns) for timebase in self.timebases if timebase is not None]
        if len(told) < len(self.timebases):
            return None
        of_run = np.clip(np.searchsorted(self.starts_ns, t_ns, side="right") - 1, 0, None)
        return np.asarray(np.stack(told)[of_run, np.arange(len(t_ns))], np.int64)


def clock_of(runs: Sequence[Run]) -> Clock:
    """The clock of runs that follow each other."""
    return Clock(
        np.array([run.meta.started_ns for run in runs], np.int64), tuple(map(_timebase, runs))
    )


def end_to_end(runs: Sequence[Run]) -> list[Run]:
    """The runs in the order in which they were walked, as far as that is known, on one clock: each
    after the other.

    Time since boot begins anew with each run; here the first begins at 0 and the next `PAUSE_NS`
    after its last record.
    """
    known = clock_of(runs)
    order = list(range(len(runs)))
    if known.knows_utc:
        started = [
            base.utc_ns(run.meta.started_ns)
            for run, base in zip(runs, known.timebases, strict=True)
            if base
        ]
        order.sort(key=started.__getitem__)
    laid, begin_ns = [], 0
    for i in order:
        run = _shifted(runs[i], begin_ns - runs[i].meta.started_ns)
        laid.append(run)
        begin_ns = _last_ns(run) + PAUSE_NS
    return laid


def _timebase(run: Run) -> TimeBase | None:
    return fit_run(run.meta.origin, run.tables["fixes"])


def _last_ns(run: Run) -> int:
    return max(
        [
            run.meta.started_ns,
            *(int(np.max(rows["t_ns"])) for rows in run.tables.values() if len(rows)),
        ]
    )


def _shifted(run: Run, by_ns: int) -> Run:
    tables = {}
    for name, rows in run.tables.items():
        tables[name] = rows.copy()
        for column in _TIMES:
            if column in (rows.dtype.names or ()):
                tables[name][column] += np.where(rows[column] == UNKNOWN_TIME, 0, by_ns)
    meta = msgspec.structs.replace(run.meta, started_ns=run.meta.started_ns + by_ns)
    return replace(run, meta=meta, tables=tables)
