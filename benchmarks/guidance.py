"""Closed loops: who is guided, and who is not, through the engine of `postproc guide`.

python benchmarks/guidance.py [--worlds N] [--noise NAME ...] [--policy NAME ...] [--trap NAME]
                              [--near] [--on] [--first SEED] [--json FILE] [--read FILE ...]
                              [--measured STARTS] [--searches N]

Every policy walks the same worlds (`guided.world`): open ground, streets and irregular streets in
turn, 3 km at most. Under white noise, and with a trap, a walk ends where the cell is located,
unless `--on`. `--near` puts the transmitter within 300 m. `--read` prints the tables of outcomes
that were written before. With `--measured` the worlds are legs of measured walks
(`guided.measured_legs`), 2 km from so many starts past each receiver. `--searches` instead follows
the phone's arrow through N simulated cities with a rogue and N without (`guided.searches`).
"""

import argparse
import json
import os
import sys
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as fieldlogger does

import numpy as np
from guided.loop import Loop, Outcome, Surroundings
from guided.measured_legs import measured_worlds
from guided.policies import GUIDED, POLICIES
from guided.searches import print_searches
from guided.world import GROUNDS, NOISES, TRAPS, World
from scoreboard.traces import FOLDER

NEAR_M = 300.0
WHITE = "white"
PEER = "fox2"
_DRAWS = 2000


def main() -> None:
    options = _options()
    if options.searches:
        print_searches(options.first, options.searches, options.json)
        return
    outcomes = [_outcome(line) for path in options.read for line in path.open()]
    if not options.read:
        outcomes = _walks(options)
    for noise in dict.fromkeys(one.noise for one in outcomes):
        _print_table(noise, [one for one in outcomes if one.noise == noise])


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--noise", nargs="+", choices=NOISES, default=list(NOISES))
    every = [*POLICIES, *GUIDED]
    parser.add_argument("--policy", nargs="+", choices=every, default=every)
    parser.add_argument("--trap", choices=TRAPS, default="")
    parser.add_argument("--near", action="store_true")
    parser.add_argument("--on", action="store_true", help="go on where the cell is located")
    parser.add_argument("--speed", type=float, default=0.5, help="of the trap `moving`, m/s")
    parser.add_argument("--measured", type=int, metavar="STARTS", default=0)
    parser.add_argument("--set", default="", help="of measured walks: Leuven or Powder")
    parser.add_argument("--searches", type=int, metavar="N", default=0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--read", type=Path, nargs="+", default=[])
    return parser.parse_args()


def _walks(options: argparse.Namespace) -> list[Outcome]:
    outcomes = []
    makers = _legs_of(options) if options.measured else _worlds_of(options)
    if not makers:
        sys.exit("the measured walks are not beside this repository, or --set names none of them")
    for k, make in enumerate(makers):
        for policy in options.policy:
            world = make()
            stops = (world.noise == WHITE or bool(options.trap)) and not options.on
            outcomes.append(Loop(world, policy).run(stops_when_located=stops))
            if options.json:
                with options.json.open("a") as file:
                    print(json.dumps(outcomes[-1]._asdict()), file=file)
        print(f"{k + 1} of {len(makers)} worlds", end="\r", file=sys.stderr)
    return outcomes


def _worlds_of(options: argparse.Namespace) -> list[Callable[[], Surroundings]]:
    """Worlds to be made anew for each policy."""
    return [
        partial(
            World,
            seed,
            noise,
            GROUNDS[seed % len(GROUNDS)],
            options.trap,
            farthest_m=NEAR_M if options.near else World.farthest_m,
            trap_speed_mps=options.speed,
        )
        for seed in range(options.first, options.first + options.worlds)
        for noise in options.noise
    ]


def _legs_of(options: argparse.Namespace) -> list[Callable[[], Surroundings]]:
    return list(measured_worlds(FOLDER, options.measured, options.set))


def _outcome(line: str) -> Outcome:
    return Outcome(**json.loads(line))


def _print_table(noise: str, outcomes: list[Outcome]) -> None:
    by_policy: dict[str, dict[int, Outcome]] = defaultdict(dict)
    for one in outcomes:
        by_policy[one.policy][one.seed] = one
    print(
        f"\n{noise}\n{'policy':<20} worlds  error m: median, 90 %   by {PEER}'s       "
        "pass   cover  located  within 2 km  metres  wrong"
    )
    peer = by_policy.get(PEER, {})
    for policy, each in by_policy.items():
        print(f"{policy:<20} {_row(list(each.values()))}".replace("RATIO", _ratio(each, peer)))


def _row(each: list[Outcome]) -> str:
    error_m = np.array([one.error_m for one in each])
    located = [one for one in each if one.located_m is not None]
    soon = sum(one.located_m <= 2000.0 for one in located if one.located_m is not None)
    metres = [one.located_m or np.inf for one in each]
    wrong = sum(bool(one.is_wrong) for one in located)
    return (
        f"{len(each):6}  {np.median(error_m):8.0f} {np.percentile(error_m, 90):8.0f}   RATIO  "
        f"{np.mean([one.passed_m is not None for one in each]):5.2f}   "
        f"{np.mean([one.is_inside for one in each]):.2f}     {len(located) / len(each):.2f}  "
        f"{soon / len(each):11.2f}  {np.median(metres):6.0f}  {wrong:5}"
    )


def _ratio(each: dict[int, Outcome], peer: dict[int, Outcome]) -> str:
    """Median error by that of the peer in the same worlds, and its 95 % bootstrap interval."""
    seeds = sorted(set(each) & set(peer))
    if not seeds:
        return f"{'-':<17}"
    own = np.array([each[seed].error_m for seed in seeds])
    other = np.array([peer[seed].error_m for seed in seeds])
    drawn = np.random.default_rng(0).integers(len(seeds), size=(_DRAWS, len(seeds)))
    ratios = np.median(own[drawn], axis=1) / np.median(other[drawn], axis=1)
    low, high = np.percentile(ratios, [2.5, 97.5])
    return f"{np.median(own) / np.median(other):.2f} ({low:.2f}-{high:.2f})".ljust(17)


if __name__ == "__main__":
    main()
