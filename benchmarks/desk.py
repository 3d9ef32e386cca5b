"""Processor time of `postproc`: commands on a usual run, and `smooth` by the number of readings.

python benchmarks/desk.py [--against TREE] [READINGS ...]

TREE is another version, such as `git worktree add TREE fc7563c`: both are measured in turns, and
the ratio is printed, which a busy machine changes less than the times.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

HERE = Path(__file__).resolve().parents[1]
COMMANDS = ("info", "smooth", "report")
"""In this order: the page is made from what `smooth` has stored."""
USUAL_CELLS, USUAL_READINGS = 6, 870
"""Of each cell: a quarter of an hour with a scan a second."""
CELLS = 20
COUNTS = (10_000, 100_000, 1_000_000)
FEW, MANY = 1_000, 100_000
"""Readings of one cell: the estimate is to take hardly longer for many."""
ROUNDS = 2
LAT_DEG, LON_DEG = 52.5, 13.4
STEP_M = 1.4
_WRITER = """
import sys
sys.path.insert(0, sys.argv[1])
sys.path.insert(1, sys.argv[2])
from pathlib import Path
from desk import write_run
write_run(Path(sys.argv[3]), int(sys.argv[4]), int(sys.argv[5]))
"""


class Spent(NamedTuple):
    """Seconds of a command: of the processors, with its child processes, and of the clock."""

    processor_s: float
    elapsed_s: float


def write_run(folder: Path, cells: int, scans: int) -> Path:
    """A walk through streets, with a fix and a scan of all cells a second; returns the HDF5."""
    # the recorder of either tree
    try:
        from logger.core.places import Utm  # noqa: PLC0415
    except ImportError:  # before places had a type
        from logger.core.geo import Utm  # noqa: PLC0415
    from logger.core.runfile import RunMeta, RunWriter, finish_journal  # noqa: PLC0415
    from logger.core.types import CellReading, Fix, Record, Scan  # noqa: PLC0415

    rng = np.random.default_rng(1)
    heading = np.repeat(rng.integers(0, 4, scans // 100 + 1), 100)[:scans] * np.pi / 2
    x, y = (
        np.cumsum(STEP_M * np.cos(heading)) % 2000.0,
        np.cumsum(STEP_M * np.sin(heading)) % 2000.0,
    )
    source = rng.uniform(0.0, 2000.0, (cells, 2))
    utm = Utm.at(LAT_DEG, LON_DEG)
    x0, y0 = utm.to_xy(LAT_DEG, LON_DEG)
    lat, lon = utm.to_latlon_arrays(x0 + x, y0 + y)
    level = [
        -20.0 - 30.0 * np.log10(np.hypot(x - a, y - b) + 5.0) + rng.normal(0.0, 5.0, scans)
        for a, b in source
    ]
    level_dbm = np.clip(np.round(level), -109.0, -48.0).T.tolist()
    writer = RunWriter(
        folder / "run.journal",
        RunMeta(
            run_id="benchmark", boot_id="0", started_ns=0, origin="simulated", program="benchmark"
        ),
    )
    for k in range(scans):
        t_ns = k * 10**9
        writer.append(Record(t_ns, "gnss", Fix(True, None, float(lat[k]), float(lon[k]), hdop=0.9)))
        heard = tuple(
            CellReading("scan", "GSM", "262", "01", 1, 1 + i, rssi_dbm=v)
            for i, v in enumerate(level_dbm[k])
        )
        writer.append(Record(t_ns + 1, "modem", Scan(t_ns, heard)))
    writer.close(scans * 10**9, "done")
    return finish_journal(folder / "run.journal")


def run_of(tree: Path, folder: Path, cells: int, scans: int) -> Path:
    """A run as the recorder of a tree writes it: an older program reads no newer run."""
    command = [sys.executable, "-c", _WRITER, tree, HERE / "benchmarks", folder]
    subprocess.run([*map(str, command), str(cells), str(scans)], check=True)
    return folder / "run.h5"


def spent_on(tree: Path, command: str, run: Path) -> Spent:
    """Time of one command of a tree."""
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed program has its bytecode
    before, begun_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        [sys.executable, "-P", "-m", "postproc.cli", command, str(run)],
        check=True,
        capture_output=True,
        env=environment,
    )
    elapsed_s = time.perf_counter() - begun_s
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(processor_s, elapsed_s)


def compare(title: str, command: str, run: Path, trees: list[Path], rounds: int = ROUNDS) -> Spent:
    """Print the least times of a command in each tree; return those of this one."""
    # this tree last, so that what it has stored is there for its next command
    measured = [[spent_on(tree, command, run) for tree in trees[::-1]] for _ in range(rounds)]
    least = [min(one[i] for one in measured) for i in range(len(trees))][::-1]
    ours = least[0]
    ratio = ""
    if len(least) > 1:
        share = ours.processor_s / least[1].processor_s
        ratio = f"; other tree {least[1].processor_s:6.2f} s, ratio {share:.2f}"
    print(f"{title:40} {ours.processor_s:6.2f} s of processors, {ours.elapsed_s:6.1f} s{ratio}")
    sys.stdout.flush()
    return ours


def main() -> None:
    """Print one line for each command and size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, metavar="TREE")
    parser.add_argument("readings", type=int, nargs="*", metavar="READINGS")
    given = parser.parse_args()
    trees = [HERE, given.against.resolve()] if given.against else [HERE]
    with tempfile.TemporaryDirectory() as folder:
        run = run_of(trees[-1], Path(folder), USUAL_CELLS, USUAL_READINGS)
        for command in COMMANDS:
            title = f"{command}, {USUAL_CELLS} cells of {USUAL_READINGS} readings"
            compare(title, command, run, trees)
        print(f"the page has {run.with_suffix('.html').stat().st_size / 1e6:.2f} MB")
    spent = []
    for count in (FEW, MANY):
        with tempfile.TemporaryDirectory() as folder:
            run = run_of(trees[-1], Path(folder), 1, count)
            spent.append(compare(f"smooth, one cell of {count} readings", "smooth", run, trees))
    print(f"{MANY} readings take {spent[1].processor_s / spent[0].processor_s:.2f} times as long")
    for count in given.readings or COUNTS:
        with tempfile.TemporaryDirectory() as folder:
            run = run_of(trees[-1], Path(folder), CELLS, count // CELLS)
            title = f"smooth, {count} readings of {CELLS} cells"
            compare(title, "smooth", run, trees, rounds=1)


if __name__ == "__main__":
    main()
