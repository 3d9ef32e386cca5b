"""What changed between two walks, cell by cell.

At most `FALSE_WORDS` of the pairs of walks between which nothing changed get a single word
(`new`, `gone`, `moved`, `stronger`, `weaker`): each test gets that rate divided by the number of
tests of the pair.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from operator import attrgetter, itemgetter
from typing import Literal

import numpy as np
from scipy import stats

from logger.core.arrays import FloatArray, IntArray
from logger.core.readings import Readings
from postproc.cell_work import Attempts, Failure
from postproc.comparison.differences import Differences, differences_of, margins_db
from postproc.comparison.ground import Grid, Ground, grounds_of
from postproc.comparison.level_change import (
    Change,
    Offset,
    change_of,
    offset_of,
    probability,
    scale_of,
)
from postproc.comparison.noise import FREEDOM, MISS, scale_db, variance_db2
from postproc.comparison.pattern import LEAST_CONTRAST_DB, pattern_of

Word = Literal["new", "gone", "moved", "stronger", "weaker", "same", "not comparable"]

FALSE_WORDS = 0.05
"""Of the pairs of walks; `benchmarks/comparison.py` measures it."""
LEAST_DB = 6.0
"""A smaller change of the mean is not worth a word: a phone held otherwise changes as much."""
FEWEST_BLOCKS = 6
"""Common ground of 300 m. On less, a street driven the other way differs by 10 dB as a whole: one
such street gave 16 of 23 false words between repeated drives."""

_CHANGED: tuple[Word, ...] = ("new", "gone", "moved", "stronger", "weaker")


@dataclass(frozen=True, slots=True)
class CellChange:
    """One cell in two walks.

    `n_a` and `n_b` are its readings, `n_blocks` the blocks of 50 m that decide: those in which both
    walks heard it, or one did and the other could have. `change_db` is by how much it is stronger
    in B than the other cells explain, with `sigma_db`; `contrast_db` how much more it rose in one
    part of the ground than in another; None where it was not tested. `p` is the probability of such
    data if nothing changed. `block` and `difference_db`, shape (n,), are for maps. `error` is that
    of the program which ended the comparison, None where none did.
    """

    cell: str
    rat: str
    word: Word
    text: str
    n_a: int
    n_b: int
    n_blocks: int
    change_db: float | None
    sigma_db: float | None
    contrast_db: float | None
    p: float | None
    block: IntArray
    difference_db: FloatArray
    error: str | None = None

    @property
    def is_change(self) -> bool:
        """Whether the word says that something changed."""
        return self.word in _CHANGED


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two walks: cells with a change first, then by number of blocks.

    `offset_db` is the offset of B against A by technology. `n_common_blocks` counts blocks of 50 m
    in which both walks named cells of one technology. `n_tests` is the number of tests. `grid`
    tells where the blocks are.
    """

    grid: Grid

    cells: tuple[CellChange, ...]
    offset_db: dict[str, float]
    n_common_blocks: int
    n_tests: int


@dataclass(frozen=True, slots=True)
class _Tested:
    """Numbers of one cell before words are chosen."""

    differences: Differences
    change: Change
    offset: Offset
    p_level: float
    contrast_db: float
    p_pattern: float


def compare(a: Iterable[Readings], b: Iterable[Readings], *, same_modem: bool) -> Comparison:
    """Compare two walks by their readings, which are in one UTM zone.

    `same_modem` says that both were recorded with the same modem, whose offset is then small.
    """
    tries = Attempts("its comparison")
    grounds = grounds_of(a, b, tries)
    in_both = sorted(set(grounds[0].cells) & set(grounds[1].cells))
    differences = [
        one for _, one in tries.each(in_both, str, lambda cell: differences_of(cell, *grounds))
    ]
    comparable = [one for one in differences if len(one) >= FEWEST_BLOCKS]
    tested = _test(comparable, grounds[0].grid, tries, same_modem=same_modem)
    offsets = _offsets(tested, same_modem=same_modem)
    only = [
        (cell, side) for side in (0, 1) for cell in sorted(set(grounds[side].cells) - set(in_both))
    ]
    absent = tries.each(only, itemgetter(0), lambda one: _absence(*one, grounds, offsets))
    # one that failed counts as tested, so that the words of the others stay as rare
    n_tests = 2 * (len(tested) + len(tries.failures)) + sum(p is not None for _, (_, p) in absent)
    limit = FALSE_WORDS / max(n_tests, 1)
    too_little = [one for one in differences if len(one) < FEWEST_BLOCKS]
    of_cell = attrgetter("cell")
    rows = [
        *tries.each(tested, attrgetter("differences.cell"),
                    lambda one: _change_of_tested(one, grounds, limit)),
        *tries.each(too_little, of_cell, lambda one: _too_little(one, grounds)),
        *tries.each(absent, lambda one: one[0][0],
                    lambda one: _change_of_absent(*one[0], grounds, *one[1], limit)),
    ]  # fmt: skip
    cells = [*(row for _, row in rows), *map(_without_comparison, tries.failures.values())]
    cells.sort(key=lambda cell: (not cell.is_change, -cell.n_blocks, -cell.n_a - cell.n_b))
    return Comparison(grounds[0].grid, tuple(cells), offsets, _n_common(*grounds), n_tests)


def _test(
    differences: list[Differences], grid: Grid, tries: Attempts, *, same_modem: bool
) -> list[_Tested]:
    tested: list[_Tested] = []
    for rat in sorted({one.rat for one in differences}):
        of_rat = [one for one in differences if one.rat == rat]
        scale = scale_of(of_rat)
        changes = tries.each(of_rat, attrgetter("cell"), partial(change_of, scale=scale))

        def test(one: tuple[Differences, Change]) -> _Tested:
            differences, change = one
            # a cell that changed must not be part of what it is compared with
            others = [other for of, other in changes if of is not differences]  # noqa: B023
            offset = offset_of(others, same_modem=same_modem)
            p_level = probability(change, offset, scale)  # noqa: B023
            return _Tested(
                differences, change, offset, p_level, *pattern_of(differences, change.db, grid)
            )

        tested += [one for _, one in tries.each(changes, lambda one: one[0].cell, test)]
    return tested


def _without_comparison(why: Failure) -> CellChange:
    return CellChange(
        why.cell, "", "not comparable", why.reason, 0, 0, 0, None, None, None, None,
        np.zeros(0, np.int64), np.zeros(0), why.error,
    )  # fmt: skip


def _offsets(tested: list[_Tested], *, same_modem: bool) -> dict[str, float]:
    by_rat: dict[str, list[Change]] = {}
    for one in tested:
        by_rat.setdefault(one.differences.rat, []).append(one.change)
    return {rat: offset_of(some, same_modem=same_modem).db for rat, some in by_rat.items()}


def _absence(
    cell: str, side: int, grounds: tuple[Ground, Ground], offsets: dict[str, float]
) -> tuple[int, float | None]:
    """Blocks in which the other walk could have heard a cell, and the chance to miss it in all."""
    heard, other = grounds[side].cells[cell], grounds[1 - side]
    offset_db = offsets.get(heard.rat, 0.0) * (1.0 if side == 0 else -1.0)
    margin_db = margins_db(heard, other) + offset_db
    could = margin_db > 0.0  # NaN compares false
    n = int(np.count_nonzero(could))
    if n < FEWEST_BLOCKS:
        return n, None
    count = heard.count[could]
    below = stats.t.cdf(-margin_db[could] / scale_db(variance_db2(count, count)), FREEDOM)
    return n, float(np.prod(MISS + (1.0 - MISS) * below))


def _change_of_tested(one: _Tested, grounds: tuple[Ground, Ground], limit: float) -> CellChange:
    change_db = one.change.db - one.offset.db
    moved = one.p_pattern <= limit and one.contrast_db >= LEAST_CONTRAST_DB
    changed = one.p_level <= limit and abs(change_db) >= LEAST_DB
    how = f"{abs(change_db):.1f} dB {'stronger' if change_db > 0.0 else 'weaker'}"
    word: Word = "same"
    text = f"{how} than the other cells explain, within the noise of two walks"
    if moved:
        word = "moved"
        text = (
            f"stronger in one part of the ground and weaker in another, by {one.contrast_db:.0f} "
            "dB; also an antenna that was turned, or a second transmitter with its identity"
        )
    elif changed and not np.any(one.differences.bound == 0):
        word = "new" if change_db > 0.0 else "gone"
        walk, other = ("B", "A") if change_db > 0.0 else ("A", "B")
        text = (
            f"only walk {walk} heard it in {len(one.differences)} blocks of 50 m, in which walk "
            f"{other} could have; walk {other} heard it elsewhere"
        )
    elif changed:
        word = "stronger" if change_db > 0.0 else "weaker"
        text = f"{how} all along; also another power or antenna, or works at the site"
    heard_a, heard_b = (ground.cells[one.differences.cell] for ground in grounds)
    return CellChange(
        one.differences.cell, one.differences.rat, word, text,
        heard_a.n_readings, heard_b.n_readings, len(one.differences),
        change_db, float(np.hypot(one.change.sigma_db, one.offset.sigma_db)),
        one.contrast_db, min(one.p_level, one.p_pattern),
        one.differences.block, one.differences.difference_db - one.offset.db,
    )  # fmt: skip


def _too_little(one: Differences, grounds: tuple[Ground, Ground]) -> CellChange:
    heard_a, heard_b = (ground.cells[one.cell] for ground in grounds)
    text = f"heard by both walks in {len(one)} blocks of 50 m, {FEWEST_BLOCKS} are needed"
    return CellChange(
        one.cell, one.rat, "not comparable", text, heard_a.n_readings, heard_b.n_readings,
        len(one), None, None, None, None, one.block, one.difference_db,
    )  # fmt: skip


def _change_of_absent(
    cell: str,
    side: int,
    grounds: tuple[Ground, Ground],
    n: int,
    p: float | None,
    limit: float,
) -> CellChange:
    heard, other = grounds[side].cells[cell], grounds[1 - side]
    walk, absent = ("A", "B") if side == 0 else ("B", "A")
    word: Word = "not comparable"
    n_ground = len(set(heard.block.tolist()) & other.visited.get(heard.rat, frozenset()))
    if not n_ground:
        text = f"heard only where walk {absent} was not"
    elif not other.floor_dbm.get(heard.rat):
        text = (
            f"only in walk {walk}; walk {absent} names one cell at a time, "
            "so another one may be there unheard"
        )
    else:
        text = f"only in walk {walk}; walk {absent} could have heard it in {n} blocks of 50 m"
        if p is not None and p <= limit:
            word = "gone" if side == 0 else "new"
    counts = (heard.n_readings, 0) if side == 0 else (0, heard.n_readings)
    return CellChange(
        cell, heard.rat, word, text, *counts, n, None, None, None, p,
        heard.block, np.full(len(heard.block), np.nan),
    )  # fmt: skip


def _n_common(a: Ground, b: Ground) -> int:
    common = [a.visited[rat] & b.visited[rat] for rat in set(a.visited) & set(b.visited)]
    return len(frozenset().union(*common)) if common else 0
