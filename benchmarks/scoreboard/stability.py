"""The same measured walk a little disturbed: how much the answer changes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from math import inf, log
from multiprocessing import Pool
from zlib import crc32

import numpy as np
from threadpoolctl import threadpool_limits

from logger.core.readings import Readings

from . import traces, tree
from .tables import Table, three_digits
from .traces import SURVEY_SLACK_M, Trace

POSITION_M, LEVEL_DB = 1.0, 0.3
"""Standard deviation of what is added: to each coordinate of a position and to each level."""
SEEDS = 10
FACTOR = 2.0
MOST_UNSTABLE = 0.02
"""Wanted: of (walk, seed) so many at most change the area of the 95 % region by that factor."""
WORST = 12
"""Walks listed."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What the locator states; `weights` of groups of the noise and of other hypotheses."""

    area_m2: float
    r95_m: float
    is_covered: bool
    verdict: str
    weights: Mapping[str, tuple[float, ...]]

    @property
    def is_right(self) -> bool:
        """Whether the transmitter is located and the 95 % region holds it."""
        return self.verdict == "located" and self.is_covered


@dataclass(frozen=True, slots=True)
class Disturbed:
    """Answers to a walk as it is and with a seed's errors."""

    trace: Trace
    seed: int
    before: Answer
    after: Answer

    @property
    def log_ratio(self) -> float:
        """Log of the areas' ratio, 0 where nothing changes."""
        return log(self.after.area_m2 / self.before.area_m2)

    @property
    def is_unstable(self) -> bool:
        """Whether the area changes by more than the factor."""
        return abs(self.log_ratio) > log(FACTOR)

    @property
    def becomes_miss(self) -> bool:
        """Whether a right *located* no longer holds the transmitter."""
        return self.before.is_right and not self.after.is_covered

    @property
    def is_wrongly_located(self) -> bool:
        """Whether the disturbed walk is *located* elsewhere though the walk itself is not."""
        is_wrong = self.after.verdict == "located" and not self.after.is_covered
        return is_wrong and (self.before.verdict != "located" or self.before.is_covered)


def disturb(obs: Readings, rng: np.random.Generator) -> Readings:
    """The readings with small errors; levels at a limit of the modem's scale stay there."""
    east_m, north_m = rng.normal(0.0, POSITION_M, (2, len(obs)))
    level_db = np.where(obs.limit == 0, rng.normal(0.0, LEVEL_DB, len(obs)), 0.0)
    return replace(
        obs,
        places=replace(obs.places, x_m=obs.x_m + east_m, y_m=obs.y_m + north_m),
        level_dbm=obs.level_dbm + level_db,
        known_limit=obs.limit,
    )


Answering = Callable[[Readings, tuple[float, float]], Answer]


def answer(obs: Readings, source: tuple[float, float]) -> Answer:
    """What the tree under test says of a walk."""
    posterior = tree.locate(obs)
    region = tree.region(posterior)
    return Answer(
        region.area_m2,
        float(posterior.r95_m),
        region.holds(source, SURVEY_SLACK_M),
        tree.decide(posterior, obs)[0],
        tree.weights(posterior),
    )


def disturb_walk(
    trace: Trace, seeds: int = SEEDS, answering: Answering = answer
) -> list[Disturbed]:
    """One walk with the errors of several seeds; on one core."""
    with threadpool_limits(1):
        obs, source = traces.observe(trace.campaign, trace.name)
        obs = obs.usable()
        before = answering(obs, source)
        key = crc32(f"{trace.campaign}/{trace.name}".encode())
        return [
            Disturbed(
                trace,
                seed,
                before,
                answering(disturb(obs, np.random.default_rng([key, seed])), source),
            )
            for seed in range(seeds)
        ]


def disturb_walks(chosen: Sequence[Trace], processes: int, seeds: int) -> list[Disturbed]:
    """Several walks in their order."""
    with Pool(processes) as pool:
        of_walks = pool.imap(partial(disturb_walk, seeds=seeds), chosen)
        return [one for some in of_walks for one in some]


def tables(found: Sequence[Disturbed]) -> list[Table | str]:
    """How often the answer changes, by campaign, and the walks that change most."""
    return [_shares(found), _target_table(found), _worst(found), _legend(found)]


def _groups(found: Sequence[Disturbed]) -> list[tuple[str, list[Disturbed]]]:
    campaigns = dict.fromkeys(one.trace.campaign for one in found)
    return [
        ("all", list(found)),
        ("located before", [one for one in found if one.before.verdict == "located"]),
        *((name, [one for one in found if one.trace.campaign == name]) for name in campaigns),
    ]


def _shares(found: Sequence[Disturbed]) -> Table:
    headings = (
        "measured walks",
        "walks",
        f"area x {FACTOR:g} or more",
        "median |log ratio|",
        "another verdict",
        "located -> miss",
        "-> located elsewhere",
    )
    lines = [(name, *_row(some)) for name, some in _groups(found) if some]
    return Table("disturbed walks against the same walk as it is", headings, lines)


def _row(some: Sequence[Disturbed]) -> tuple[str, ...]:
    return (
        str(len({one.trace for one in some})),
        f"{unstable_share(some):.3f}",
        f"{np.median([abs(one.log_ratio) for one in some]):.3f}",
        str(sum(one.after.verdict != one.before.verdict for one in some)),
        str(sum(one.becomes_miss for one in some)),
        str(sum(one.is_wrongly_located for one in some)),
    )


def unstable_share(some: Sequence[Disturbed]) -> float:
    """Share of (walk, seed) whose area changes by more than the factor."""
    return float(np.mean([one.is_unstable for one in some]))


def _target_table(found: Sequence[Disturbed]) -> Table:
    share, misses = unstable_share(found), sum(one.becomes_miss for one in found)
    lines = [
        (
            f"share with another area (x {FACTOR:g})",
            f"{share:.3f}",
            f"<= {MOST_UNSTABLE:g}",
            "" if share <= MOST_UNSTABLE else "missed",
        ),
        ("located that become a miss", str(misses), "0", "missed" if misses else ""),
    ]
    return Table("what is wanted", ("figure", "value", "limit", ""), lines)


def _worst(found: Sequence[Disturbed]) -> Table:
    by_walk = [list(some) for _, some in groupby(found, lambda one: one.trace)]
    by_walk.sort(key=_spread, reverse=True)
    headings = ("walk", "seeds", "area km2, before and after", "verdicts", "weights")
    lines = [line for some in by_walk[:WORST] for line in _before_and_after(some)]
    return Table("walks that change most, with the weights of the hypotheses", headings, lines)


def _spread(some: Sequence[Disturbed]) -> tuple[bool, int, float]:
    return (
        any(one.becomes_miss for one in some),
        sum(one.is_unstable for one in some),
        max((abs(one.log_ratio) for one in some), default=-inf),
    )


def _before_and_after(some: Sequence[Disturbed]) -> list[tuple[str, ...]]:
    farthest = max(some, key=lambda one: abs(one.log_ratio))
    unstable = sum(one.is_unstable for one in some)
    trace = farthest.trace
    return [
        (
            f"{trace.campaign}/{trace.name}",
            f"{unstable} of {len(some)}",
            *_in_words(farthest.before),
        ),
        ("", f"seed {farthest.seed}", *_in_words(farthest.after)),
    ]


def _in_words(one: Answer) -> tuple[str, str, str]:
    weights = "; ".join(
        f"{name} {' '.join(f'{share:.2f}' for share in shares)}"
        for name, shares in one.weights.items()
    )
    held = "" if one.is_covered else ", miss"
    return three_digits(one.area_m2 / 1e6), f"{one.verdict}{held}", weights


def _legend(found: Sequence[Disturbed]) -> str:
    seeds = len({one.seed for one in found})
    return (
        f"Errors of {POSITION_M:g} m are added to each coordinate of the smoothed positions and of "
        f"{LEVEL_DB:g} dB to each level within the modem's scale; {seeds} seeds a walk, each "
        "with the CRC-32 of its name. Counts are of (walk, seed)."
    )
