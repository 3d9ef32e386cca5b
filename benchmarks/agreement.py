"""The answer on the device at the end of a walk against the desktop's for the same readings.

python benchmarks/agreement.py [--walks N] [--on] [--jobs N] [--json FILE] [--markdown FILE]

The walker follows the device's advice through the worlds of `guidance.py` until the transmitter is
located, 3 km at most; with `--on` always 3 km. Then he stands and reads the phone, which hears
nothing more meanwhile. The desktop reads the run file.
Its verdict is that for the device's radius. Two answers between the two show what differs: the
device's posterior searched anew, and the desktop's locator on the device's readings.
"""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import hypot
from multiprocessing import Pool
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

import numpy as np
from guided.loop import Loop
from guided.policies import GUIDED
from guided.world import GROUNDS, NOISES, World
from scoreboard import tree
from scoreboard.output import argument_parser, print_and_write
from scoreboard.tables import Table, three_digits

from logger.core.locator.posterior import Posterior
from logger.core.locator.summary import summarise
from logger.core.locator.verdict import LIVE_M
from logger.core.readings import Readings
from logger.core.runfile import RunMeta, RunWriter, read_run
from logger.core.types import CellReading, Fix, Record, Scan
from postproc.walk import observe_run

WALKS = 40
MOST_APART, MOST_RATIO = 2, 1.5
"""Wanted: of 40 walks so many at most end with radii that differ by more than this factor."""
STANDS_S = 20
"""Longer than the device takes to notice it."""
STEPS = {"located": 0, "ambiguous": 1, "cannot tell": 2}


@dataclass(frozen=True, slots=True)
class Shown:
    """What one of the programs states at the end."""

    verdict: str
    r95_m: float
    error_m: float


@dataclass(frozen=True, slots=True)
class Ending:
    """The end of a walk: on the device, and at the desktop.

    `searched` is the device's posterior after a new search with all its blocks, `same_readings` the
    desktop's locator on the readings that the device took; both without a verdict of their own.
    """

    seed: int
    noise: str
    ground: str
    walked_m: float
    readings: int
    live: Shown
    desk: Shown
    searched: Shown
    same_readings: Shown

    @property
    def ratio(self) -> float:
        """Of the device's radius to the desktop's."""
        return self.live.r95_m / self.desk.r95_m

    @property
    def is_apart(self) -> bool:
        """Whether the radii differ by more than the factor."""
        return not 1.0 / MOST_RATIO <= self.ratio <= MOST_RATIO

    @property
    def steps_apart(self) -> int:
        """Between the verdicts."""
        return abs(STEPS[self.live.verdict] - STEPS[self.desk.verdict])


def walk(number: int, *, goes_on: bool) -> Ending:
    """Walk one world to its end and ask both programs."""
    noise, seed = list(NOISES)[number % len(NOISES)], number // len(NOISES)
    world = World(seed, noise, GROUNDS[seed % len(GROUNDS)])
    policy = GUIDED[0] if world.ground == "open" else GUIDED[1]
    loop = Loop(world, policy)
    outcome = loop.run(stops_when_located=not goes_on)
    loop.stop(STANDS_S)
    best = loop.answer.best
    if best is None:
        raise ValueError("no position at the end of the walk")
    live = Shown(loop.answer.verdict, best.r95_m, loop.error_m())
    desk_obs = _through_run(loop.rows)
    desk = _answer_row(loop, tree.locate(desk_obs), desk_obs)
    locator = loop.filter.locator
    readings = locator.readings.readings()
    locator.search()
    last = locator.last_search()
    if last is None:
        raise ValueError("no search at the end of the walk")
    return Ending(
        seed,
        noise,
        world.ground,
        walked_m=outcome.walked_m,
        readings=len(desk_obs),
        live=live,
        desk=desk,
        searched=_answer_row(loop, summarise(*last), readings),
        same_readings=_answer_row(loop, tree.locate(readings), readings),
    )


def _answer_row(loop: Loop, posterior: Posterior, obs: Readings) -> Shown:
    verdict = tree.decide(posterior, obs, within_m=LIVE_M)[0]
    place_m = loop.from_start_m(posterior.x_m, posterior.y_m)
    error_m = min(hypot(*(place_m - one)) for one in loop.world.emitters_now())
    return Shown(verdict, float(posterior.r95_m), error_m)


def _through_run(rows: Sequence[dict[str, str]]) -> Readings:
    """The readings of the run file that the device writes, at the desktop's positions."""
    records = []
    for row in rows:
        t_ns = round(float(row["t_s"]) * 1e9)
        fix = Fix(True, lat_deg=float(row["lat"]), lon_deg=float(row["lon"]))
        records.append(Record(t_ns, "gnss", fix))
        if level_dbm := row["rssi_dbm"]:
            heard = CellReading("serving", row["rat"], label="a", rssi_dbm=float(level_dbm))
            records.append(Record(t_ns, "modem", Scan(t_ns, (heard,))))
    with TemporaryDirectory() as scratch:
        file = Path(scratch) / "walk.journal"
        meta = RunMeta(
            run_id="0" * 32, boot_id="boot", started_ns=0, origin="simulated", program="-"
        )
        writer = RunWriter(file, meta)
        for record in records:
            writer.append(record)
        writer.close(records[-1].t_ns, "end")
        observed = observe_run(read_run(file)).observations
    if observed is None:
        raise ValueError("the walk has no position")
    return observed.cells[0].usable()


def tables(found: Sequence[Ending]) -> list[Table | str]:
    """Each walk, by how much the answers differ, and what is wanted."""
    by_ratio = sorted(found, key=lambda one: abs(np.log(one.ratio)), reverse=True)
    each = Table(
        "at the end of a walk: verdict, 95 % radius m, error m",
        ("walk", "m", "device", "searched anew", "desktop, same readings", "desktop", "ratio"),
        [_line(one) for one in by_ratio],
    )
    return [each, _target_table(found)]


def _line(one: Ending) -> tuple[str, ...]:
    shown = (one.live, one.searched, one.same_readings, one.desk)
    return (
        f"{one.noise}, {one.ground}, {one.seed}",
        f"{one.walked_m:.0f}",
        *(f"{each.verdict} {each.r95_m:.0f} {each.error_m:.0f}" for each in shown),
        f"{one.ratio:.2f}" + "!" * one.is_apart,
    )


def _target_table(found: Sequence[Ending]) -> Table:
    apart = sum(one.is_apart for one in found)
    steps = sum(one.steps_apart > 1 for one in found)
    most = round(MOST_APART * len(found) / WALKS)
    # an answer is true where its radius holds the transmitter
    true = [sum(one.error_m <= one.r95_m for one in each) for each in _columns(found)]
    lines = [
        (f"radii by more than {MOST_RATIO:g}", str(apart), f"<= {most}", _miss_text(apart > most)),
        ("verdicts two steps apart", str(steps), "0", _miss_text(steps > 0)),
        ("device: within its radius", str(true[0]), f"of {len(found)}", ""),
        ("desktop: within its radius", str(true[1]), f"of {len(found)}", ""),
    ]
    ratio = three_digits(float(np.median([one.ratio for one in found])))
    lines.append(("median ratio of the radii", ratio, "", ""))
    return Table("what is wanted", ("figure", "value", "limit", ""), lines)


def _columns(found: Sequence[Ending]) -> tuple[list[Shown], list[Shown]]:
    return [one.live for one in found], [one.desk for one in found]


def _miss_text(is_missed: bool) -> str:
    return "missed" if is_missed else ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Walk, print the tables, write the files asked for."""
    parser = argument_parser(__doc__)
    parser.add_argument("--walks", type=int, default=WALKS, metavar="N")
    parser.add_argument("--on", action="store_true", help="go on where the cell is located")
    asked = parser.parse_args(arguments)
    with Pool(asked.jobs) as pool:
        numbers = range(asked.walks)
        found = pool.map(partial(walk, goes_on=asked.on), numbers, chunksize=1)
    print_and_write(tables(found), found, asked)
    return 0


if __name__ == "__main__":
    sys.exit(main())
