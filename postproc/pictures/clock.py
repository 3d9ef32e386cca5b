"""Times of one run, or of several laid end to end."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.runfile import Run
from logger.core.timebase import TimeBase, fit_run
from logger.core.utc import utc_text


@dataclass(frozen=True, slots=True)
class Clock:
    """Time since the start of the first run, and UTC where GPS reported it in every run.

    `starts_ns` (k,) are the starts of the runs since boot, ascending; `timebases` map each run's
    time since boot to UTC, None where that is unknown.
    """

    starts_ns: IntArray
    timebases: tuple[TimeBase | None, ...]

    @property
    def has_utc(self) -> bool:
        """Whether UTC is known for every run."""
        return None not in self.timebases

    def elapsed_ns(self, t_ns: IntArray) -> IntArray:
        """Time since the start of the first run, shape as given."""
        return t_ns - int(self.starts_ns[0])

    def minutes(self, t_ns: IntArray) -> FloatArray:
        """Minutes since the start of the first run, shape as given."""
        return np.asarray(self.elapsed_ns(t_ns) / 60e9, float)

    def utc_ns(self, t_ns: IntArray) -> IntArray | None:
        """UTC of times (n,), None where it is unknown for one of the runs."""
        by_run = [base.utc_ns_array(t_ns) for base in self.timebases if base is not None]
        if len(by_run) < len(self.timebases):
            return None
        run = np.clip(np.searchsorted(self.starts_ns, t_ns, side="right") - 1, 0, None)
        return np.asarray(np.stack(by_run)[run, np.arange(len(t_ns))], np.int64)

    def start_text(self, run: int = 0) -> str | None:
        """UTC at the start of a run (ISO 8601), None where it is unknown."""
        timebase = self.timebases[run]
        return utc_text(timebase.utc_ns(int(self.starts_ns[run]))) if timebase else None


def clock_of(runs: Sequence[Run]) -> Clock:
    """The clock of runs that follow each other."""
    return Clock(
        np.array([run.meta.started_ns for run in runs], np.int64),
        tuple(fit_run(run.meta.origin, run.tables["fixes"]) for run in runs),
    )
