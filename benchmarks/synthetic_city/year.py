"""A year of a hundred loggers: thousands of cells located on two workers, and the questions after.

    python benchmarks/city.py --only year --stations 200 --readings 10000000

The readings are drawn straight into the files of a survey: run files of so many walks would take
longer to draw than to add.
"""

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.synthetic_city.loggers import wilson95
from benchmarks.synthetic_city.surveys import OPTIONS, draw_survey, error_m, holds
from benchmarks.synthetic_city.walks import draw_walkers
from benchmarks.synthetic_city.world import City, draw_city
from postproc.survey.cell_location import LocatedCell
from postproc.survey.location import locate_survey
from postproc.survey.scheduling import Cluster

_WORKERS = 2
_LOGGERS = 100
_QUESTIONS = (
    ("baseline", "-b", "{folder}/city.db"),
    ("diff", "--before", "{middle}", "--after", "{middle}"),
    ("map",),
    ("next", "--walkers", "3"),
)


def year(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Walls and peaks: locating all cells, then each of the other commands."""
    city, walkers = draw_city(options.stations, 1), draw_walkers(_LOGGERS, 1)
    began_s = time.monotonic()
    survey = draw_survey(folder / "year", city, walkers, options.readings[-1])
    n_readings = sum(run.n_readings for run in survey.runs.values())
    yield f"{len(survey.runs)} runs, {n_readings} readings: drawn in {_since(began_s)}"
    began_s = time.monotonic()
    with Cluster(workers=_WORKERS) as cluster:
        location = locate_survey(survey, OPTIONS, cluster=cluster)
    yield f"locating {len(location.cells)} cells on {_WORKERS} workers: {_since(began_s)}"
    yield f"  {_peaks()}"
    accused = [one.logger for one in location.loggers if one.contradiction]
    yield f"  loggers left out: {len(accused)} of {len(location.loggers)}, all of them honest"
    yield f"  {_accuracy(city, location.cells)}"
    times_ns = sorted(run.began_utc_ns or 0 for run in survey.runs.values())
    middle = np.datetime64(times_ns[len(times_ns) // 2], "ns").astype("datetime64[D]")
    for command, *arguments in _QUESTIONS:
        texts = [text.format(folder=folder, middle=middle) for text in arguments]
        began_s = time.monotonic()
        subprocess.run(
            [sys.executable, "-m", "postproc.cli", "survey", command, survey.folder, *texts],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        yield f"survey {command}: {_since(began_s)}; {_peaks()}"


def _accuracy(city: City, cells: tuple[LocatedCell, ...]) -> str:
    placed = [cell for cell in cells if cell.x_m is not None]
    n_held = sum(holds(city, cell) for cell in placed)
    low, high = wilson95(n_held, len(placed))
    errors_m = [error_m(city, cell) for cell in placed]
    return (
        f"{len(placed)} cells with a position: coverage {n_held / len(placed):.3f} "
        f"({low:.3f} to {high:.3f}), median error {np.median(errors_m):.0f} m"
    )


def _since(began_s: float) -> str:
    return f"{(time.monotonic() - began_s) / 60.0:.1f} min"


def _peaks() -> str:
    """The largest process so far, of those that have ended, and this one."""
    child, own = (
        resource.getrusage(who).ru_maxrss / 1024.0
        for who in (resource.RUSAGE_CHILDREN, resource.RUSAGE_SELF)
    )
    return f"peak of a child {child:.0f} MB, of this process {own:.0f} MB"
