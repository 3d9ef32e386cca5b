"""What the rules cost on the walk, against the locator, for `suspicion.py`.

A modem without a card names every cell of a simulated city that it decodes.
"""

import gc
import time
import tracemalloc
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.suspicion_baseline import baseline_of
from benchmarks.suspicion_city import DECODED_DBM, SimulatedCity, reading_of
from benchmarks.suspicion_gone import summary_of
from logger.core.baseline import NO_BASELINE, Baseline
from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.suspicion.earlier_walks import FEWEST_WALKS
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.types import Record, Scan

_SEED = 0
"""An even one: without a card."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor time of a walk with the rules and without them, and memory of the rules."""

    name: str
    rules_s: float
    locator_s: float
    memory_mb: float


def print_live_cost() -> None:
    """Cost of one walk without a baseline, and with one of seven walks."""
    city = SimulatedCity(_SEED)
    with TemporaryDirectory() as scratch:
        earlier = [summary_of(city.walk(), Path(scratch) / f"{k}") for k in range(FEWEST_WALKS)]
        records = city.walk()
        scans = [record.value for record in records if isinstance(record.value, Scan)]
        mean = sum(len(scan.readings) for scan in scans) / len(scans)
        print(f"{len(city.cells)} cells, {len(scans)} scans of {mean:.0f} cells")
        with closing(baseline_of(Path(scratch) / "baseline.db", earlier)) as baseline:
            for cost in (
                _cost("no baseline", records, NO_BASELINE),
                _cost("seven walks", records, baseline),
            ):
                share = 100.0 * cost.rules_s / cost.locator_s
                print(
                    f"{cost.name}: rules {cost.rules_s:.2f} s, locator {cost.locator_s:.2f} s "
                    f"({share:.1f} %), memory {cost.memory_mb:.2f} MB"
                )
            full = [_with_all(record, city) for record in records]
            for name, known in (("no baseline", NO_BASELINE), ("seven walks", baseline)):
                of_scan_ms = 1e3 * _undisturbed_s(full, known) / len(scans)
                print(f"{name}: rules {of_scan_ms:.2f} ms for a scan of {len(city.cells)} cells")


def _with_all(record: Record, city: SimulatedCity) -> Record:
    """A scan of all cells."""
    scan = record.value
    if not isinstance(scan, Scan):
        return record
    heard = {reading.cell for reading in scan.readings}
    weak = [reading_of(cell, DECODED_DBM, "neighbour") for cell in city.cells]
    readings = (*scan.readings, *(one for one in weak if one.cell not in heard))
    return replace(record, value=replace(scan, readings=readings))


def _cost(name: str, records: Sequence[Record], baseline: Baseline) -> Cost:
    rules_s = min(_rules_s(records, baseline) for _ in range(3))
    live = LiveTracker(LiveSettings(), baseline)
    start_s = time.process_time()
    for seq, record in enumerate(records):
        live.feed(seq, record)
    locator_s = time.process_time() - start_s - rules_s
    return Cost(name, rules_s, locator_s, _memory_mb(records, baseline))


def _rules_s(records: Sequence[Record], baseline: Baseline) -> float:
    tracker = SuspicionTracker(baseline=baseline)
    start_s = time.process_time()
    for record in records:
        tracker.feed(record)
    return time.process_time() - start_s


def _undisturbed_s(records: Sequence[Record], baseline: Baseline, n_walks: int = 5) -> float:
    """Time of a walk: of each record the least."""
    least_s = [inf] * len(records)
    for _ in range(n_walks):
        tracker = SuspicionTracker(baseline=baseline)
        for i, record in enumerate(records):
            start_s = time.process_time()
            tracker.feed(record)
            least_s[i] = min(least_s[i], time.process_time() - start_s)
    return sum(least_s)


def _memory_mb(records: Sequence[Record], baseline: Baseline) -> float:
    """What the rules keep after the walk."""
    gc.collect()
    tracemalloc.start()
    tracker = SuspicionTracker(baseline=baseline)
    for record in records:
        tracker.feed(record)
    gc.collect()
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del tracker
    return kept / 1e6
