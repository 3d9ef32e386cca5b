"""Legitimate logs with a baseline of the walks before them, for `suspicion.py`."""

from collections.abc import Iterator, Sequence
from contextlib import closing
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
    """Each log that has so many earlier ones of its route, with a baseline of the last of these."""
    with TemporaryDirectory() as scratch:
        for route in routes:
            walks: list[WalkSummary] = []
            for path in sorted(folder.glob(f"{route}*.csv.gz")):
                summary = _summary(path, Path(scratch))
                if summary is None:
                    continue
                if len(walks) >= n_walks:
                    target = Path(scratch) / f"{route}-{len(walks)}.db"
                    with closing(baseline_of(target, walks[-n_walks:])) as baseline:
                        yield read_log(path), baseline
                walks.append(summary)


def baseline_of(path: Path, walks: Sequence[WalkSummary]) -> BaselineFile:
    """A baseline of some walks in a new file."""
    with BaselineStore(path, create=True) as store:
        for walk in walks:
            store.add(walk)
    return BaselineFile(path)


def _summary(path: Path, scratch: Path) -> WalkSummary | None:
    """A log by square; None for the one whose times are impossible, which is no walk."""
    run = scratch / path.name.replace(".csv.gz", ".h5")
    try:
        import_walk(path, run)
    except RunFileError:
        return None
    return summarise_walk(read_sound_run(run))
