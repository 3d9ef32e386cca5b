"""Effect of one outlier among the levels on the estimate, live and at the desktop.

python benchmarks/robustness.py [--runs M] [--measured all|N] [--seed S] [--spike DB] [--count N]
                                [--where random|last]

Each walk is estimated four times: with and without the outlier, with and without its rejection.
Simulated walks alternate between white noise of 3 dB and shadowing of 6 dB over 15 m. The measured
walks are beside this repository.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as fieldlogger does

import numpy as np
from scoreboard import traces
from scoreboard.cases import CASES
from scoreboard.live import last_estimate
from scoreboard.world import World, observations

from logger.core.certainty import CHI2_95_2DOF
from logger.core.errors import EstimationError
from logger.core.locator.pipeline import locate
from logger.core.readings import Readings
from logger.core.spikes import SpikeFilter

SIMULATED = (
    "white-L",
    "shadow6-path",
    "white-square",
    "shadow6-path",
    "white-random",
    "shadow6-path",
    "white-spiral",
)
CLASSES = "ABCDE"


class Position(NamedTuple):
    """Error of an answer and area of its 95 % region."""

    error_m: float
    area_m2: float


class Comparison(NamedTuple):
    """Estimates of one walk without and with rejection, without and with the outlier.

    `found` of `asked` outliers were identified.
    """

    kind: str
    name: str
    asked: int
    found: int
    false: int
    clean_old: Position
    clean: Position
    spiked_old: Position
    spiked: Position


class NoGuard(SpikeFilter[Readings]):
    """Takes every level."""

    def take(self, reading: Readings, *_: object) -> list[tuple[Readings, float]]:
        return [(reading, 0.0)]


def offline(world: World, obs: Readings, *, guard: bool) -> Position:
    """The posterior of all readings."""
    found = locate(obs if guard else replace(obs, without_spikes=True))
    return Position(world.error_m((found.x_m, found.y_m)), found.region_area_m2)


def live(world: World, obs: Readings, *, guard: bool) -> Position:
    """The last estimate on the device."""
    last = last_estimate(obs, None if guard else NoGuard())
    area_m2 = np.pi * CHI2_95_2DOF * np.sqrt(last.p_xx * last.p_yy - last.p_xy**2)
    return Position(world.error_m((last.x_m, last.y_m)), float(area_m2))


def with_errors(obs: Readings, at: list[int], spike_db: float) -> Readings:
    """The walk with some levels wrong by so much."""
    level_dbm = obs.level_dbm.copy()
    level_dbm[at] += spike_db
    return replace(obs, level_dbm=level_dbm)


def wrong_at(rng: np.random.Generator, n: int, asked: argparse.Namespace) -> list[int]:
    """Which readings are to be wrong."""
    if asked.where == "first":
        return list(range(asked.count))
    if asked.where == "last":
        return list(range(n - asked.count, n))
    if asked.where == "row":
        first = int(rng.integers(n - asked.count + 1))
        return list(range(first, first + asked.count))
    count = asked.count or max(1, round(0.01 * n))
    return [int(k) for k in rng.choice(n, count, replace=False)]


def worlds(asked: argparse.Namespace) -> Iterator[tuple[str, World]]:
    """Simulated and measured walks with the kind of each."""
    for run in range(asked.runs):
        case = SIMULATED[run % len(SIMULATED)]
        yield (
            ("white" if case.startswith("white") else "shadow"),
            CASES[case].world(asked.seed, run),
        )
    names = [(kind, *name) for kind in CLASSES for name in traces.names(kind)]
    if asked.measured != "all":
        chosen = np.random.default_rng(asked.seed).permutation(len(names))[: int(asked.measured)]
        names = [names[k] for k in sorted(chosen)]
    for kind, dataset, trace in names:
        yield f"measured {kind}", traces.world_of(dataset, trace)


def compare(
    kind: str, world: World, answer: Callable[..., Position], at: list[int], spike_db: float
) -> Comparison:
    """One walk through one of the two estimates."""
    obs = observations(world, world.walk)
    wrong = with_errors(obs, at, spike_db)
    named, false = {spike.k for spike in wrong.spikes}, len(obs.spikes)
    clean = answer(world, obs, guard=True)
    before = (
        answer(world, obs, guard=False) if false else clean
    )  # where nothing is set aside the two are one
    spiked = answer(world, wrong, guard=True)
    unguarded = answer(world, wrong, guard=False) if named else spiked
    return Comparison(
        kind, world.name, len(at), len(named & set(at)), false, before, clean, unguarded, spiked
    )


def table(found: list[Comparison], title: str) -> list[str]:
    """Ratios of one estimate, by kind of walk."""
    lines = [
        (
            f"{title:32}  walks found   error x: now / before    "
            "area x: now / before     clean: area, error x"
        )
    ]
    kinds = dict.fromkeys(one.kind for one in found)
    groups = {
        "all simulated": ("white", "shadow"),
        "all measured": tuple(k for k in kinds if k.startswith("measured")),
    }
    for name, chosen in {**{kind: (kind,) for kind in kinds}, **groups}.items():
        some = [one for one in found if one.kind in chosen]
        if some:
            lines.append(f"{name:32} {_row(some)}")
    return lines


def _row(some: list[Comparison]) -> str:
    share = sum(one.found for one in some) / sum(one.asked for one in some)

    def ratio(name: str, over: str, under: str) -> str:
        values = [getattr(getattr(c, over), name) / getattr(getattr(c, under), name) for c in some]
        return f"{np.median(values):.2f} {np.quantile(values, 0.95):6.2f}"

    cells = [
        ratio(name, over, under)
        for name in ("error_m", "area_m2")
        for over, under in (("spiked", "clean"), ("spiked_old", "clean_old"))
    ]
    clean = f"{ratio('area_m2', 'clean', 'clean_old')}   {_medians(some)}"
    return (
        f"{len(some):6} {share:5.0%}   "
        + " / ".join(cells[:2])
        + "   "
        + " / ".join(cells[2:])
        + f"   {clean}"
    )


def _medians(some: list[Comparison]) -> str:
    before, now = (
        float(np.median([getattr(c, name).error_m for c in some]))
        for name in ("clean_old", "clean")
    )
    return f"{before:.1f} -> {now:.1f} m"


def main() -> int:
    """Compare and print."""
    asked = _parser().parse_args()
    found: dict[str, list[Comparison]] = {"desk": [], "live": []}
    rng = np.random.default_rng(asked.seed)
    for i, (kind, world) in enumerate(worlds(asked)):
        at = wrong_at(rng, len(world.walk), asked)
        for name, answer in (("desk", offline), ("live", live)):
            if asked.only in (None, name):
                try:
                    found[name].append(compare(kind, world, answer, at, asked.spike))
                except EstimationError as error:
                    print(f"{world.name or i}: {name}: {error}", file=sys.stderr)
        if asked.json:
            asked.json.write_text(
                json.dumps({name: [_plain(one) for one in rows] for name, rows in found.items()})
            )
        if asked.verbose:
            print(
                i,
                kind,
                world.name,
                *(f"{name} {rows[-1]}" for name, rows in found.items() if rows),
                flush=True,
            )
    for name, rows in found.items():
        if rows:
            print("\n".join(table(rows, name)), flush=True)
    return 0


def _plain(one: Comparison) -> dict[str, object]:
    return {
        name: value._asdict() if isinstance(value, Position) else value
        for name, value in one._asdict().items()
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200, metavar="M", help="simulated walks")
    parser.add_argument(
        "--measured", default="all", metavar="N", help="measured walks, drawn with the seed; or all"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--spike", type=float, default=30.0, metavar="DB")
    parser.add_argument(
        "--count", type=int, default=1, metavar="N", help="levels that are wrong; 0: 1 %% of them"
    )
    parser.add_argument("--where", choices=("random", "row", "first", "last"), default="random")
    parser.add_argument("--only", choices=("desk", "live"))
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--verbose", action="store_true")
    return parser


if __name__ == "__main__":
    sys.exit(main())
