"""Rule B3 in simulated cities that were walked before, for `suspicion.py`.

A city is walked seven times, each time with another gain of the antenna; then once more as it is,
and once more without each fourth of its cells.
"""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from benchmarks.suspicion_baseline import baseline_of
from benchmarks.suspicion_city import SimulatedCity, reading_of
from logger.baseline_store import WalkSummary, summarise_walk
from logger.core.baseline import Baseline
from logger.core.runfile import read_sound_run
from logger.core.suspicion.earlier_walks import FEWEST_WALKS
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.types import Record
from tests.kit.runs import write_journal

_GAIN_SIGMA_DB = 3.0
_EVERY = 4


class GoneWalk(NamedTuple):
    """One walk with a baseline; `best_dbm` of the cell that is off the air, None if all are on.

    `n_wrong` cells are said to be gone and are not, of `n_cells` that earlier walks heard. The cell
    that is switched on during each walk is not among them: before, it is gone.
    """

    best_dbm: float | None
    is_named: bool
    n_wrong: int
    n_cells: int


def gone_walks(n_cities: int) -> Iterator[GoneWalk]:
    """Walks through each of the first cities."""
    for seed in range(n_cities):
        drawn, gains = SimulatedCity(seed), np.random.default_rng([seed, 78])
        with TemporaryDirectory() as scratch:
            earlier = [
                summary_of(drawn.walk(gains.normal(0.0, _GAIN_SIGMA_DB)), Path(scratch) / f"{k}")
                for k in range(FEWEST_WALKS)
            ]
            with closing(baseline_of(Path(scratch) / "baseline.db", earlier)) as baseline:
                names = [reading_of(cell, 0.0, "serving").cell for cell in drawn.cells]
                known = {name: cell for name in names if name and (cell := baseline.cell(name))}
                strongest = sorted(known, key=lambda name: -known[name].best_dbm)
                for name in (None, *strongest[::_EVERY]):
                    off_air = None if name is None else names.index(name)
                    records = drawn.walk(gains.normal(0.0, _GAIN_SIGMA_DB), off_air)
                    named = _missed_cells(records, baseline)
                    best_dbm = None if name is None else known[name].best_dbm
                    wrong = named - {name, names[drawn.new]}
                    yield GoneWalk(best_dbm, name in named, len(wrong), len(known))


def summary_of(records: list[Record], path: Path) -> WalkSummary:
    """A walk as a baseline stores it."""
    write_journal(path, records, run_id=path.name.encode().hex().ljust(32, "0"))
    return summarise_walk(read_sound_run(path))


def _missed_cells(records: list[Record], baseline: Baseline) -> set[str | None]:
    tracker = SuspicionTracker(baseline=baseline)
    found = [finding for record in records for finding in tracker.feed(record)]
    return {finding.cell for finding in found if finding.rule.id == "B3"}


def print_gone(walks: list[GoneWalk], strong_dbm: float = -60.0) -> None:
    """Shares of missing cells that were named, and of others."""
    for text, low_dbm, high_dbm in (
        ("strong", strong_dbm, 0.0),
        ("weaker", -200.0, strong_dbm),
    ):
        missing = [w for w in walks if w.best_dbm is not None and low_dbm < w.best_dbm <= high_dbm]
        print(f"{text}: {sum(walk.is_named for walk in missing)} of {len(missing)} missing cells")
    n_wrong, n_cells = sum(w.n_wrong for w in walks), sum(w.n_cells for w in walks)
    print(f"said to be gone, but on the air: {n_wrong} of {n_cells} in {len(walks)} walks")
