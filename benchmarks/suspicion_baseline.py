"""Legitimate logs with a baseline of the walks before them, for `suspicion.py`."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.suspicion_logs import Log, read_log
from logger.baseline_file import BaselineFile
from logger.baseline_store import BaselineStore, WalkSummary, summarise_walk
from logger.core.errors import RunFileError
from logger.core.runfile import read_sound_run
from postproc.interop.importing import import_walk

ROUTES = ("ottawa_lacolyoc", "cork_driving", "cork_static")
"""Logs of the same ground again and again, named by their date."""


def logs_with_baseline(
    folder: Path, n_walks: int, routes: Sequence[str] = ROUTES
) -> Iterator[tuple[Log, BaselineFile]]:
    """Each log with a baseline of the walks of its route nearest to it in time, itself left out.

    A route with a fifth fewer walks than `n_walks` has all of them.
    """
    with TemporaryDirectory() as scratch:
        for route in routes:
            summaries = {
                path: summary
                for path in sorted(folder.glob(f"{route}*.csv.gz"))
                if (summary := _summary(path)) is not None
            }
            if len(summaries) <= 0.8 * n_walks:
                continue
            walks = list(summaries.values())
            for i, path in enumerate(summaries):
                others = sorted(range(len(walks)), key=lambda k: abs(k - i))[1 : n_walks + 1]
                target = Path(scratch) / f"{route}-{i}.db"
                with closing(baseline_of(target, [walks[k] for k in others])) as baseline:
                    yield read_log(path), baseline


def baseline_of(path: Path, walks: Sequence[WalkSummary]) -> BaselineFile:
    """A baseline of some walks in a new file."""
    with BaselineStore(path, create=True) as store:
        for walk in walks:
            store.add(walk)
    return BaselineFile(path)


@cache
def _summary(path: Path) -> WalkSummary | None:
    """A log by square; None for the one whose times are impossible, which is no walk."""
    with TemporaryDirectory() as scratch:
        run = Path(scratch) / path.name.replace(".csv.gz", ".h5")
        try:
            import_walk(path, run)
        except RunFileError:
            return None
        return summarise_walk(read_sound_run(run))
