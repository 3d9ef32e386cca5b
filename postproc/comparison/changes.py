"""What changed between two walks, cell by cell: levels, patterns, and cells that are new or gone.

At most `FALSE_WORDS` of the pairs of walks between which nothing changed get a single word
(`new`, `gone`, `moved`, `stronger`, `weaker`): each test gets that rate divided by the number of
tests of the pair.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from scipy import stats

from logger.core.arrays import FloatArray, IntArray
from logger.core.cell_names import is_by_channel
from logger.core.errors import EstimationError
from logger.core.model.blocks import squares
from logger.core.places import Places, Utm
from logger.core.readings import Observations, Readings
from logger.core.runfile import Run
from postproc.cell_work import Attempts, Failure
from postproc.comparison.ground import (
    BLOCK_M,
    CELL_DB,
    FREEDOM,
    MISS,
    OTHER_MODEM_DB,
    SAME_MODEM_DB,
    Differences,
    Grid,
    Ground,
    blocks_text,
    differences_of,
    grounds_of,
    margins_db,
    scale_db,
    variance_db2,
)
from postproc.estimators.metrics import SIGMA_PER_MAD
from postproc.multi_run import check_different, in_one_zone, modems_of, of_one_modem
from postproc.progress import Progress
from postproc.walk import observe_run

# The likelihood of a change m of the mean is that of Student's t for each difference, and of its
# tail for each censored one. The test compares the best m with the best under the null hypothesis,
# which allows the offset of the other cells and its uncertainty (likelihood ratio, chi-square with
# one degree of freedom).

_MOST_DB, _STEP_DB = 60.0, 0.1
_CHANGES_DB = np.arange(-_MOST_DB, _MOST_DB + _STEP_DB / 2, _STEP_DB)
"""Changes of the mean that are tried."""
_FEWEST_SCALE = 20
"""Differences from which the scale of the noise of two walks can be estimated."""


class Offset(NamedTuple):
    """Offset of walk B against walk A and its standard deviation in dB."""

    db: float
    sigma_db: float


class Change(NamedTuple):
    """Change of the mean level in dB with its standard deviation, both with the offset in them.

    `log_likelihood` has shape (changes,), over the changes that are tried.
    """

    db: float
    sigma_db: float
    log_likelihood: FloatArray


def change_of(differences: Differences, scale: float) -> Change:
    """The likeliest change of the mean; `scale` is the factor of the variance."""
    log_likelihood = _log_likelihood(differences, scale)
    best = int(np.argmax(log_likelihood))
    # where half a nat is lost on either side
    inside = np.flatnonzero(log_likelihood >= log_likelihood[best] - 0.5)
    half_width_db = 0.5 * _STEP_DB * (inside[-1] - inside[0] + 1)
    sigma_db = float(np.hypot(half_width_db, np.sqrt(scale) * CELL_DB))
    return Change(float(_CHANGES_DB[best]), sigma_db, log_likelihood)


def probability(change: Change, offset: Offset, scale: float) -> float:
    """Probability of a change as large as this one if the cell has only the offset."""
    sigma_db = np.hypot(offset.sigma_db, np.sqrt(scale) * CELL_DB)
    penalty = 0.5 * ((_CHANGES_DB - offset.db) / sigma_db) ** 2
    null = float(np.max(change.log_likelihood - penalty))
    ratio = 2.0 * (float(np.max(change.log_likelihood)) - null)
    return float(stats.chi2.sf(max(ratio, 0.0), 1))


def offset_of(others: list[Change], *, same_modem: bool) -> Offset:
    """Weighted median of the changes of other cells, with the prior.

    A minority of changed cells does not move it, and disagreement widens it.
    """
    prior_db2 = (SAME_MODEM_DB if same_modem else OTHER_MODEM_DB) ** 2
    if not others:
        return Offset(0.0, float(np.sqrt(prior_db2)))
    changes_db = np.array([change.db for change in others])
    weight = np.array([1.0 / change.sigma_db**2 for change in others])
    median_db = weighted_median(changes_db, weight)
    spread = SIGMA_PER_MAD * float(np.median(np.abs(changes_db - median_db) * np.sqrt(weight)))
    # the median of Gaussians has pi/2 times the variance of the mean
    of_median_db2 = 0.5 * np.pi / float(np.sum(weight)) * max(1.0, spread) ** 2
    gain = prior_db2 / (prior_db2 + of_median_db2)
    return Offset(gain * median_db, float(np.sqrt(gain * of_median_db2)))


def weighted_median(values: FloatArray, weight: FloatArray) -> float:
    """The value (n,) below which half of the weight lies."""
    order = np.argsort(values, kind="stable")
    half = int(np.searchsorted(np.cumsum(weight[order]), 0.5 * np.sum(weight)))
    return float(values[order][min(half, len(order) - 1)])


def scale_of(differences: list[Differences]) -> float:
    """Factor of the variance for two walks that differ more than the measured ones; at least 1.

    A few cells that have changed do not matter.
    """
    deviations = [part for one in differences if (part := _deviations(one)) is not None]
    if sum(map(len, deviations)) < _FEWEST_SCALE:
        return 1.0
    return max(1.0, float(SIGMA_PER_MAD * np.median(np.abs(np.concatenate(deviations)))) ** 2)


def _deviations(differences: Differences) -> FloatArray | None:
    """Deviations from the cell's own median by their standard deviation; None for one block."""
    measured = differences.bound == 0
    n = int(np.count_nonzero(measured))
    if n < 2:
        return None
    values = differences.difference_db[measured]
    apart = (values - np.median(values)) / np.sqrt(differences.variance_db2[measured])
    # what the median of n blocks takes with it
    return np.asarray(apart * np.sqrt(n / (n - 1)), float)


def _log_likelihood(differences: Differences, scale: float) -> FloatArray:
    width_db = scale_db(scale * differences.variance_db2)
    away = (differences.difference_db - _CHANGES_DB[:, None]) / width_db
    measured = differences.bound == 0
    log_density = stats.t.logpdf(away[:, measured], FREEDOM)
    side = -differences.bound[~measured]
    log_tail = np.log(MISS + (1.0 - MISS) * stats.t.cdf(side * away[:, ~measured], FREEDOM))
    return np.asarray(np.sum(log_density, axis=1) + np.sum(log_tail, axis=1), float)


FEWEST_BLOCKS_OF_PATTERN = 8
"""Fewer show a change of the mean, but no pattern."""
LEAST_CONTRAST_DB = 10.0
"""A smaller contrast is not worth the word `moved`: halving a distance changes 6 to 12 dB."""
_REACH_M = 150.0
"""Blocks this far apart still change alike when a transmitter moves, and by chance do not."""
_FIRST, _MORE = 499, 49_999
"""Permutations: the second number only where the first leaves open a word that contrast allows."""
_OPEN = 0.02
_ENOUGH = 50  # permutations that are as smooth: they give the share within a seventh
_MOST_SQUARES = 400
"""The time grows with their square; of more blocks, those of one larger square count together."""
_DRAWN_AT_ONCE = 2_000_000
"""Differences: 50 MB with their products."""


def pattern_of(differences: Differences, change_db: float, grid: Grid) -> tuple[float, float]:
    """Largest contrast between two parts of the ground in dB, and the probability of the pattern.

    `change_db` is the change of the mean: a censored difference that allows it counts as that, any
    other as its bound. Too few blocks give (0, 1).
    """
    if len(differences) < FEWEST_BLOCKS_OF_PATTERN:
        return 0.0, 1.0
    allowed = differences.bound * (change_db - differences.difference_db) > 0.0
    values_db = np.where(allowed, change_db, differences.difference_db)
    places = np.stack([*grid.centres_m(differences.block), values_db])
    (x_m, y_m, values_db), weight = _in_squares(places, 1.0 / differences.variance_db2)
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    kernel = np.exp(-0.5 * (apart_m / _REACH_M) ** 2)
    away_db = values_db - np.sum(weight * values_db) / np.sum(weight)
    smooth_db = (kernel * weight) @ away_db / np.sum(kernel * weight, axis=1)
    contrast_db = float(np.max(smooth_db) - np.min(smooth_db))
    residual = away_db * np.sqrt(weight)
    p = _share_as_smooth(kernel, residual, _FIRST)
    if p < _OPEN and contrast_db >= LEAST_CONTRAST_DB:
        p = _share_as_smooth(kernel, residual, _MORE)
    return contrast_db, p


def _in_squares(places: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted means of columns [x, y, ...] (k, n) in at most `_MOST_SQUARES` squares; weights."""
    if len(weight) <= _MOST_SQUARES:
        return places, weight
    square, _ = squares(Places.of(places[0], places[1]), _MOST_SQUARES, finest_m=BLOCK_M)
    total = np.bincount(square, weight)
    means = np.array([np.bincount(square, weight * column) / total for column in places])
    return means, np.asarray(total, float)


def _share_as_smooth(kernel: FloatArray, residual: FloatArray, count: int) -> float:
    """Share of permutations that are at least as smooth as the order of the walk.

    As many are drawn as are needed to know it well (Besag & Clifford, Biometrika 78(2), 1991).
    """
    random = np.random.default_rng(0)  # equal runs give equal answers
    own = residual @ kernel @ residual * (1.0 - 1e-12)
    n_as_smooth = 0
    at_once = max(_DRAWN_AT_ONCE // len(residual), 1)
    for first in range(0, count, at_once):
        n = min(at_once, count - first)
        drawn = random.permuted(np.broadcast_to(residual, (n, len(residual))).copy(), axis=1)
        n_as_smooth += int(np.count_nonzero(np.einsum("ij,ij->i", drawn @ kernel, drawn) >= own))
        if n_as_smooth >= _ENOUGH:
            return (1 + n_as_smooth) / (1 + first + n)
    return (1 + n_as_smooth) / (1 + count)


Word = Literal["new", "gone", "moved", "stronger", "weaker", "same", "not comparable"]

FALSE_WORDS = 0.05
"""Of the pairs of walks; `benchmarks/comparison.py` measures it."""
LEAST_DB = 6.0
"""A smaller change of the mean is not worth a word: a phone held otherwise changes as much."""
# Under the null hypothesis differences can be exchanged between blocks. The test permutes them; its
# statistic is large where neighbouring blocks changed alike.

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
    part of the ground than in another; None if not tested. `p` is the probability of such data if
    nothing changed. `block` and `difference_db`, shape (n,), are for maps. `error` is the error of
    the program that ended the comparison, if any; `is_small_change` is less than any word needs.
    """

    cell: str
    rat: str
    word: Word
    text: str
    n_a: int
    n_b: int
    n_blocks: int
    change_db: float | None = None
    sigma_db: float | None = None
    contrast_db: float | None = None
    p: float | None = None
    block: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    difference_db: FloatArray = field(default_factory=lambda: np.zeros(0))
    error: str | None = None
    is_small_change: bool = False

    @property
    def is_change(self) -> bool:
        """Whether the word says that something changed."""
        return self.word in _CHANGED


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two walks: cells with a change first, then by number of blocks.

    `offset_db` is the offset of B against A by technology. `n_common_blocks` counts blocks of 50 m
    in which both walks named cells of one technology.
    """

    grid: Grid

    cells: tuple[CellChange, ...]
    offset_db: dict[str, float]
    n_common_blocks: int
    n_tests: int


@dataclass(frozen=True, slots=True)
class _Tested:
    differences: Differences
    change: Change
    offset: Offset
    n_others: int
    p_level: float
    contrast_db: float
    p_pattern: float


def compare(
    a: Iterable[Readings],
    b: Iterable[Readings],
    *,
    same_modem: bool,
    progress: Progress | None = None,
) -> Comparison:
    """Compare two walks by their readings, which are in one UTM zone.

    `same_modem`: both were recorded with one modem, so the offset is small.
    """
    tries = Attempts("its comparison", progress, "comparing")
    # a cell by channel and code may have its identity in the other walk: it is not new or gone
    a, b = ((obs for obs in walk if not is_by_channel(obs.cell)) for walk in (a, b))
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
    # that of a cell alone is its own change
    known_db = {one.differences.rat: offsets[one.differences.rat] for one in tested if one.n_others}
    return Comparison(grounds[0].grid, tuple(cells), known_db, _n_common(*grounds), n_tests)


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
            pattern = pattern_of(differences, change.db, grid)
            return _Tested(differences, change, offset, len(others), p_level, *pattern)

        tested += [one for _, one in tries.each(changes, lambda one: one[0].cell, test)]
    return tested


def _without_comparison(why: Failure) -> CellChange:
    return CellChange(why.cell, "", "not comparable", why.reason, 0, 0, 0, error=why.error)


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


# by the number of other cells
_THAN = ("", " than the other cell explains", " than the other cells explain")
_OR = (
    "without another cell, it may as well be the modem or its antenna",
    "compared with one other cell: it may be that one that changed",
    "another power or antenna, works at the site, or it stands elsewhere now",
)


def _change_of_tested(one: _Tested, grounds: tuple[Ground, Ground], limit: float) -> CellChange:
    change_db = one.change.db - one.offset.db
    moved = one.p_pattern <= limit and one.contrast_db >= LEAST_CONTRAST_DB
    changed = one.p_level <= limit and abs(change_db) >= LEAST_DB
    how = f"{abs(change_db):.1f} dB {'stronger' if change_db > 0.0 else 'weaker'}"
    word: Word = "same"
    is_small = one.p_level <= limit and not changed
    why = f"more than noise, and less than the {LEAST_DB:g} dB of a word"
    why = why if is_small else "within the noise of two walks"
    text = f"{how}{_THAN[min(one.n_others, 2)]}, {why}"
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
            f"only walk {walk} heard it in {blocks_text(len(one.differences))}, in which walk "
            f"{other} could have; walk {other} heard it elsewhere"
        )
    elif changed:
        word = "stronger" if change_db > 0.0 else "weaker"
        text = f"{how} on average; {_OR[min(one.n_others, 2)]}"
    heard_a, heard_b = (ground.cells[one.differences.cell] for ground in grounds)
    return CellChange(
        one.differences.cell, one.differences.rat, word, text,
        heard_a.n_readings, heard_b.n_readings, len(one.differences),
        change_db, float(np.hypot(one.change.sigma_db, one.offset.sigma_db)),
        one.contrast_db, min(one.p_level, one.p_pattern),
        one.differences.block, one.differences.difference_db - one.offset.db,
        is_small_change=is_small and word == "same",
    )  # fmt: skip


def _not_counted(cell: str, grounds: tuple[Ground, Ground]) -> str:
    # blocks in which a walk named the cell and no level counts, as the end of a sentence
    heard = [(walk, ground.cells.get(cell)) for walk, ground in zip("AB", grounds, strict=True)]
    left = [(walk, len(one.named) - len(one.block)) for walk, one in heard if one]
    why = "do not count: repeated, or spikes"
    return "".join(f"; levels of walk {walk} in {blocks_text(n)} {why}" for walk, n in left if n)


def _too_little(one: Differences, grounds: tuple[Ground, Ground]) -> CellChange:
    heard_a, heard_b = (ground.cells[one.cell] for ground in grounds)
    text = f"heard by both walks in {blocks_text(len(one))}, {FEWEST_BLOCKS} are needed"
    text += _not_counted(one.cell, grounds)
    return CellChange(
        one.cell, one.rat, "not comparable", text, heard_a.n_readings, heard_b.n_readings,
        len(one), block=one.block, difference_db=one.difference_db,
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
        text = f"only in walk {walk}; walk {absent} could have heard it in {blocks_text(n)}"
        if p is not None and p <= limit:
            word = "gone" if side == 0 else "new"
    text += _not_counted(cell, grounds)
    counts = (heard.n_readings, 0) if side == 0 else (0, heard.n_readings)
    return CellChange(
        cell, heard.rat, word, text, *counts, n, p=p,
        block=heard.block, difference_db=np.full(len(heard.block), np.nan),
    )  # fmt: skip


_MOST_MAPS = 12
"""More are not read."""
_FULL_DB = 15.0
"""Difference from which a colour is full."""
Shade = Literal["more", "less", "single"]
"""Of a block that is stronger in B or weaker, or that one walk alone heard the cell in."""


def cells_on_maps(cells: Iterable[CellChange]) -> list[CellChange]:
    """Cells with a change that are drawn on the ground."""
    return [cell for cell in cells if cell.is_change][:_MOST_MAPS]


def shade_of(difference_db: float) -> tuple[Shade, float]:
    """Colour of a block on a map, and its strength from 0 to 1."""
    if np.isnan(difference_db):
        return "single", 1.0
    return "more" if difference_db > 0.0 else "less", min(abs(difference_db) / _FULL_DB, 1.0)


def _n_common(a: Ground, b: Ground) -> int:
    common = [a.visited[rat] & b.visited[rat] for rat in set(a.visited) & set(b.visited)]
    return len(frozenset().union(*common)) if common else 0


@dataclass(frozen=True, slots=True)
class ComparedRuns:
    """Two runs and their comparison; `utm` is the zone of the blocks."""

    a: Path
    b: Path
    same_modem: bool
    warnings: tuple[str, ...]
    utm: Utm
    comparison: Comparison


def compare_runs(a: Run, b: Run, progress: Progress | None = None) -> ComparedRuns:
    """Compare two runs.

    Raises `ConfigError` for one run twice, `EstimationError` for a run without a position,
    `GeoError` for runs too far apart.
    """
    check_different([a, b])
    observed = in_one_zone([observe_run(a), observe_run(b)])
    walks: list[Observations] = []
    for run in observed:
        if run.observations is None:
            raise EstimationError(f"{run.run.path}: {run.warnings[0]}")
        # a level differs from another modem's by more than a station changes
        walks.append(of_one_modem(run.observations))
    numbers = modems_of([a, b])
    same_modem = numbers[0] == numbers[1]
    compared = compare(walks[0].cells, walks[1].cells, same_modem=same_modem, progress=progress)
    warnings = tuple(f"{run.run.path}: {text}" for run in observed for text in run.warnings)
    return ComparedRuns(a.path, b.path, same_modem, warnings, walks[0].track.utm, compared)
