"""The live estimate again, from the recorded fixes and scans alone."""

from collections.abc import Iterator
from dataclasses import astuple, dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from logger.core.live import LiveTracker
from logger.core.live_settings import BEHIND
from logger.core.runfile import Run
from logger.core.types import LiveEstimate


@dataclass(frozen=True, slots=True)
class Replay:
    """Live estimates as recorded and as computed again; equal means equal to the last bit.

    Bits agree on one kind of machine. Between a Pi and a laptop log10 and BLAS may differ in the
    last bit, and `largest_m` tells how far that has carried the position.
    """

    n_recorded: int
    n_replayed: int
    n_equal: int
    first_difference: int | None
    largest_m: float

    @property
    def equal(self) -> bool:
        return self.n_equal == self.n_recorded == self.n_replayed


def estimates(run: Run) -> Iterator[LiveEstimate]:
    """Live estimates computed from the run's fixes and scans, in their recorded order."""
    tracker = LiveTracker(run.meta.live)
    with threadpool_limits(1):  # as on the device: threads of BLAS add up in another order
        for seq, record in run.records("fixes", "scans"):
            for value in tracker.feed(seq, record):
                if isinstance(value, LiveEstimate):
                    yield value


def replay(run: Run) -> Replay:
    """Repeat the live estimate and compare; a pulled plug or a slow device may lack the end."""
    recorded = [
        record.value for _, record in run.records("live") if isinstance(record.value, LiveEstimate)
    ]
    again = list(estimates(run))
    if run.end is None or np.any(run.tables["notes"]["code"] == BEHIND.encode()):
        common = min(len(recorded), len(again))
        recorded, again = recorded[:common], again[:common]
    n_equal, first, largest = 0, None, 0.0
    for a, b in zip(recorded, again, strict=False):
        if _same(a, b):
            n_equal += 1
            continue
        first = a.scan_seq if first is None else first
        largest = max(largest, abs(a.x_m - b.x_m), abs(a.y_m - b.y_m))
    return Replay(len(recorded), len(again), n_equal, first, largest)


def _same(a: LiveEstimate, b: LiveEstimate) -> bool:
    """Equal in every field; NaN equals NaN, since a diverged filter must diverge again."""
    return all(x == y or (x != x and y != y) for x, y in zip(astuple(a), astuple(b), strict=True))  # noqa: PLR0124
