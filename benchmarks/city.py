"""A synthetic city: cost of adding and locating, against `smooth`, coverage, offsets, liars.

    python benchmarks/city.py                                 # small, some minutes
    python benchmarks/city.py --readings 100000 1000000 10000000 --only cost
    python benchmarks/city.py --only year --stations 2000 --readings 100000000

Processor times are those of this process and its children; walls are not compared, except for one
and two workers.
"""

import argparse
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.synthetic_city.loggers import coverage, lies, offsets
from benchmarks.synthetic_city.run_files import write_run
from benchmarks.synthetic_city.surveys import OPTIONS, SCANS, draw_survey, estimates_of
from benchmarks.synthetic_city.walks import draw_walk, draw_walkers
from benchmarks.synthetic_city.world import draw_city
from benchmarks.synthetic_city.year import year
from logger.core.locator.pipeline import locate
from logger.core.runfile import read_sound_run
from postproc.smoothing import smooth_runs
from postproc.survey.alignment import align
from postproc.survey.cell_location import joined_readings, thin
from postproc.survey.dataset import Survey
from postproc.survey.scheduling import Cluster
from postproc.survey.tasks import RunChoice, Task, locate_cells, tasks_of


def cpu_s() -> float:
    """Processor time of this process and its children that have ended."""
    parts = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(part.ru_utime + part.ru_stime for part in parts)


def adding(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """`postproc survey add` of run files, as a command of its own."""
    city, walkers = draw_city(20, 1), draw_walkers(20, 1)
    runs = folder / "runs"
    runs.mkdir()
    walks = [draw_walk(city, walkers[k % 20], k, SCANS, 1) for k in range(options.files)]
    files = [write_run(walk, runs) for walk in walks]
    n_few = max(len(files) // 4, 1)
    sizes = (sum(map(len, walks[:n_few])), sum(map(len, walks)))
    add_s(files[:1], folder / "warm")
    few_s, all_s = (add_s(files[:n], folder / f"of-{n}") for n in (n_few, len(files)))
    peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    yield f"adding {len(walks)} runs: {sizes[1] / all_s:,.0f} readings/s of a core"
    rate = (sizes[1] - sizes[0]) / (all_s - few_s)
    yield f"  {sizes[1]} readings; without what {n_few} runs take: {rate:,.0f}"
    yield f"  peak {peak_mb:.0f} MB"


def add_s(files: Sequence[Path], survey: Path) -> float:
    """Processor time of adding files to a new survey."""
    command = [sys.executable, "-m", "postproc.cli", "survey", "add", *files, "-o", survey]
    began_s = cpu_s()
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)
    return cpu_s() - began_s


def cost(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Processor time of locating all cells against the number of readings."""
    city, walkers = draw_city(20, 1), draw_walkers(20, 1)
    times = []
    for n in options.readings:
        survey = draw_survey(folder / str(n), city, walkers, n)
        began_s = time.process_time()
        cells = estimates_of(survey)
        times.append(time.process_time() - began_s)
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        total = sum(cell.n_readings for cell in cells)
        yield f"locating {len(cells)} cells, {total} readings: {times[-1]:.1f} s"
        yield f"  peak of this process so far {peak_mb:.0f} MB"
    for (n, a_s), (m, b_s) in zip(
        zip(options.readings, times, strict=True),
        zip(options.readings[1:], times[1:], strict=True),
        strict=False,
    ):
        yield f"  exponent from {n} to {m}: {np.log(b_s / a_s) / np.log(m / n):.2f}"


def against_smooth(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """The same cells of the same run files by `smooth` of all runs, without its start."""
    city, walkers = draw_city(20, 1), draw_walkers(3, 1)
    runs = folder / "runs"
    runs.mkdir()
    survey = Survey.open_or_make(folder / "s")
    walks = [draw_walk(city, walkers[k % 3], k, SCANS // 4, 1) for k in range(options.runs)]
    files = [write_run(walk, runs) for walk in walks]
    command = [sys.executable, "-m", "postproc.cli", "survey", "add", str(runs), "-o"]
    began_s = cpu_s()
    subprocess.run([*command, str(survey.folder)], check=True, stdout=subprocess.DEVNULL)
    survey = Survey.open(survey.folder)
    found = {cell.cell: cell for cell in estimates_of(survey)}
    survey_s = cpu_s() - began_s
    order = {run.name: i for i, run in enumerate(survey.runs.values())}
    files.sort(key=lambda path: order[path.name])
    chosen = [cell for cell in found.values() if cell.x_m is not None][
        :: max(len(found) // options.cells, 1)
    ]
    chosen = chosen[: options.cells]
    began_s, worst_m = time.process_time(), 0.0
    for cell in chosen:
        (one,) = smooth_runs(
            [read_sound_run(path) for path in files], [cell.cell], options=OPTIONS
        ).cells
        assert one.posterior is not None
        off_m = np.hypot(one.posterior.x_m - cell.x_m, one.posterior.y_m - cell.y_m)
        worst_m = max(worst_m, float(off_m))
    smooth_s = (time.process_time() - began_s) / len(chosen) * len(found)
    yield f"{len(files)} runs, {len(found)} cells: add and locate {survey_s:.0f} s of a core"
    yield (
        f"  a loop of smooth --cell: {smooth_s:.0f} s (from {len(chosen)} cells), "
        f"{smooth_s / survey_s:.1f} times as much; positions differ by at most {worst_m:.1e} m"
    )


def thinning_loss(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Estimates of cells with many readings from all of them, and from those that are kept."""
    city, walkers = draw_city(4, 1), draw_walkers(20, 1)
    survey = draw_survey(folder / "s", city, walkers, options.dense)
    for one in survey.cells():
        parts = survey.observations(one.area, [one.cell])[one.cell]
        obs = joined_readings(parts, [survey.runs[digest].modem for digest in parts])
        aligned = align(obs.usable()).obs
        thinned = thin(aligned)
        began_s = time.process_time()
        whole = locate(aligned, OPTIONS.prior)
        whole_s, began_s = time.process_time() - began_s, time.process_time()
        less = locate(thinned, OPTIONS.prior)
        less_s = time.process_time() - began_s
        moved_m = np.hypot(whole.x_m - less.x_m, whole.y_m - less.y_m)
        yield (
            f"{len(aligned)} readings thinned to {len(thinned)}: moved by {moved_m:.1f} m, "
            f"r95 {whole.r95_m:.0f} to {less.r95_m:.0f} m, {whole_s:.1f} to {less_s:.1f} s"
        )


def workers(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Wall time with one and with two worker processes on Dask, and with plain processes.

    Plain processes show what the processors allow: two that share a core are not twice as fast.
    """
    city, walkers = draw_city(20, 1), draw_walkers(20, 1)
    survey = draw_survey(folder / "s", city, walkers, options.readings[0])
    tasks = tasks_of(survey, survey.cells(), RunChoice(), OPTIONS)
    for name, wall_s in (("Dask", _wall_on_dask), ("plain processes", _wall_of_processes)):
        one_s, two_s = wall_s(tasks, 1), wall_s(tasks, 2)
        efficiency = one_s / two_s / 2.0
        yield f"{name}: one {one_s:.0f} s, two {two_s:.0f} s: efficiency {efficiency:.2f}"
    yield f"  load of this machine at the end {os.getloadavg()[0]:.1f}; above 2 it says nothing"


def _wall_on_dask(tasks: list[Task], n: int) -> float:
    with Cluster(workers=n) as cluster:
        list(cluster.results(locate_cells, tasks[:n]))  # started, with all imports
        began_s = time.monotonic()
        list(cluster.results(locate_cells, tasks))
        return time.monotonic() - began_s


def _wall_of_processes(tasks: list[Task], n: int) -> float:
    with ProcessPoolExecutor(n, get_context("spawn"), threadpool_limits, (1,)) as pool:
        list(pool.map(locate_cells, tasks[:n]))
        began_s = time.monotonic()
        list(pool.map(locate_cells, tasks))
        return time.monotonic() - began_s


PARTS: dict[str, Callable[[Path, argparse.Namespace], Iterator[str]]] = {
    "adding": adding,
    "cost": cost,
    "smooth": against_smooth,
    "coverage": coverage,
    "lies": lies,
    "offsets": offsets,
    "thinning": thinning_loss,
    "workers": workers,
    "year": year,
}
_LONG = {"year"}
"""Run when they are named only: hours at full size."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--only", nargs="*", choices=list(PARTS), default=sorted(set(PARTS) - _LONG)
    )
    parser.add_argument("--readings", nargs="*", type=int, default=[30_000, 300_000])
    parser.add_argument("--files", type=int, default=16, help="run files that are added")
    parser.add_argument("--runs", type=int, default=12, help="runs of the comparison with smooth")
    parser.add_argument("--cells", type=int, default=1, help="cells that smooth locates")
    parser.add_argument("--cities", type=int, default=1, help="cities of the parts on loggers")
    parser.add_argument("--stations", type=int, default=200, help="of the part year")
    parser.add_argument("--dense", type=int, default=400_000, help="readings of four cells")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="for what is drawn")
    options = parser.parse_args()
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    for name in options.only:
        with TemporaryDirectory() as scratch:
            for line in PARTS[name](options.keep or Path(scratch), options):
                print(line, flush=True)


if __name__ == "__main__":
    main()
