"""One transmitter or two for a cell of a run, or of two runs: the signature of a cloned cell.

For one run the locator's own test is used (`logger.core.locator.two_source_test`): the walk is
divided in two and each part located alone. Of two runs each is located alone, and both together;
with p the evidence of a run over positions h of prior mass m,

    log factor = log sum_h m p1(h) + log sum_h m p2(h) - log sum_h m p1(h) p2(h)

Both have the same calibration: walks past one transmitter are simulated from the estimate with the
noise of the walk, and p is the share of them whose factor is as large. The simulation ends early
when several are (Besag & Clifford, Biometrika 78(2), 1991).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from msgspec import UNSET

from logger.core.arrays import FloatArray, IntArray
from logger.core.cell_names import FEWEST_SCANS
from logger.core.errors import ConfigError
from logger.core.locator.mixture import log_sum, rows_of_groups
from logger.core.locator.pipeline import locate
from logger.core.locator.posterior import Posterior
from logger.core.locator.quadtree import PositionPrior, children, first_squares
from logger.core.locator.two_source_test import divide
from logger.core.model.blocks import Blocks, blocks
from logger.core.model.columns import distances_db, receiver_variance, varying_columns
from logger.core.model.elimination import eliminate, packed_index, pivots, reduce_columns, side
from logger.core.model.marginal import fit, prior_sums, products, row_weights, sums, whiten
from logger.core.model.noise import (
    Whitener,
    covariances,
    independent_variance,
    shadowing,
    whiteners_of,
)
from logger.core.model.path_loss import level_dbm, log_distance_db
from logger.core.model.prior import Prior
from logger.core.places import Places, Utm
from logger.core.readings import CELL_REACH_M, Readings
from logger.core.runfile import Run
from postproc.cell_work import Failure, attempt
from postproc.ground import apart_m
from postproc.multi_run import merge, modems_of
from postproc.scan_counts import observed_cells, scans_of, too_rarely
from postproc.smoothing import too_few
from postproc.verification.claims import SiteVerdict
from postproc.walk import observe_run

# The model is `logger.core.model`, with another prior of power and scale, so that thousands of
# simulated walks cost a few matrix products: P0 is flat, the other coefficients are normal in
# units of a reference sigma, sigma^2 is inverse gamma with a0 and b0. With whitened columns X, z =
# W levels and weights of rows w (see `marginal`), Lambda the precision in units of sigma_ref^-2
# and m the mean of the coefficients:
#
#     A = X'wX + Lambda,    g = X'wz + Lambda m,    S = z'wz + m'Lambda m - g'A^-1 g
#     log p = -1/2 log|K| + 1/2 sum log w - 1/2 log|A| - (a0 + (n - 1) / 2) log(b0 + S / 2) + const

Squares = FloatArray
"""Rows x, y, side: shape (3, h).

A position without extent has side 0 and no probability of its own.
"""

_STRIP = 32  # walks at once: these matrices stay in the cache
_SIGMA_SHAPE = 1.7
"""Of the inverse gamma law of sigma^2: about as wide as the locator's log-normal one (0.45)."""
_LEAST_WEIGHT = 0.003  # of a hypothesis that is not ruled out
_MOST_HYPOTHESES = 6
_LEAST_SIDE_M = 1.0  # of a square that is split: far below what a walk can resolve
_COARSE = 550  # squares: of the walk's posterior to be refined
_FINE = 1600  # where the noise is estimated
_LIKELY = 1e-4
_TAIL = 16
_LEAST = 1e-300


@dataclass(frozen=True)
class LikelihoodGrid:
    """A walk of `blocks` at `squares` (3, h) under the hypotheses of some whiteners.

    `columns` are those of the model that vary with the position, `extra` the variance of the
    receiver's error: they do not depend on levels.
    """

    blocks: Blocks
    prior: Prior
    squares: Squares
    whiteners: list[Whitener]
    columns: list[FloatArray]
    extra: FloatArray | None

    @property
    def numbers(self) -> IntArray:
        """Hypotheses of the noise by their number in the prior, shape (c,)."""
        return np.array([w.number for w in self.whiteners])

    @cached_property
    def log_mass(self) -> FloatArray:
        """Log prior probability of each square (h,), up to a constant; -inf without extent."""
        with np.errstate(divide="ignore"):
            position_prior = PositionPrior(self.blocks, self.prior, self.squares)
            log_density = position_prior.log_density(self.squares)
            return np.asarray(log_density + 2.0 * np.log(self.squares[2]), float)

    def with_squares(self, squares: Squares) -> "LikelihoodGrid":
        """The same walk and hypotheses on another grid."""
        return likelihood_grid(self.blocks, self.prior, squares, self.whiteners)

    def with_walk(self, blocks: Blocks, whiteners: list[Whitener]) -> "LikelihoodGrid":
        """The same squares for another walk."""
        return likelihood_grid(blocks, self.prior, self.squares, whiteners)

    def evaluate(self, level_dbm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Log evidence and mean of sigma^2 for levels (n, b), shape (c, h, b) each."""
        log_p = np.empty((len(self.whiteners), self.squares.shape[1], level_dbm.shape[1]))
        variance = np.empty_like(log_p)
        for i, whitener in enumerate(self.whiteners):
            self._evaluate(whitener, level_dbm, log_p[i], variance[i])
        return log_p, variance

    def _evaluate(
        self, whitener: Whitener, level_dbm: FloatArray, log_p: FloatArray, variance: FloatArray
    ) -> None:
        mean, precision = self._coefficients
        least = _SIGMA_SHAPE * self.prior.sigma_db**2
        scale = least + 0.5 * float(np.sum(precision * mean**2))
        shape = _SIGMA_SHAPE + 0.5 * (len(self.blocks) - 1)
        n = len(self.blocks)
        one = np.sum(whitener.matrix, axis=1)
        varying = [whiten(whitener.matrix, column) for column in self.columns]
        extra = None if self.extra is None else row_weights(whitener.matrix, self.extra)
        # for each of the q columns of the model, g'A^-1 g = sum (rows'z + shift)^2
        system = products(np.stack([np.zeros(n), one]), varying, extra)[:-1]
        system += prior_sums(*self._normal)[:, None]
        eliminate(system)
        size = np.sqrt(pivots(system))
        shifts = size * system[[packed_index(k, 0) for k in range(1, side(system))]]
        weight = np.ones((n, 1)) if extra is None else extra
        reduced = zip(reduce_columns(system, [one[:, None], *varying]), size, strict=True)
        of_columns = [weight * column / each for column, each in reduced]
        log_det = 2.0 * np.sum(np.log(size), axis=0)
        log_weight = np.sum(np.log(weight), axis=0)
        constant = 0.5 * (log_weight - whitener.log_det - log_det)[:, None]
        z = whitener.matrix @ level_dbm
        squares = z * z
        for k in range(0, level_dbm.shape[1], _STRIP):
            some = slice(k, k + _STRIP)
            left = weight.T @ squares[:, some]
            for rows, shift in zip(of_columns, shifts, strict=True):
                left = left - (rows.T @ z[:, some] + shift[:, None]) ** 2
            total = np.maximum(scale + 0.5 * left, least)
            np.subtract(constant, shape * np.log(total), out=log_p[:, some])
            np.divide(total, shape - 1.0, out=variance[:, some])

    def exponents(self, level_dbm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean of eta, and its variance by that of the noise, for one walk (n,): (c, h) each."""
        fixed = np.stack([level_dbm, np.ones(len(level_dbm))])
        of_prior = prior_sums(*self._normal)[:, None]
        mean, variance = [], []
        for whitener in self.whiteners:
            total = sums(whitener.matrix, fixed, self.columns, self.extra)
            posterior = fit(total, of_prior, np.zeros(total.shape[1]))
            mean.append(posterior.theta[1])
            variance.append(posterior.covariance(2)[1, 1])
        return np.stack(mean), np.stack(variance)

    @property
    def _coefficients(self) -> tuple[FloatArray, FloatArray]:
        """Mean and precision by the reference sigma, shape (q,) each; P0 is flat."""
        mean, precision = self.prior.coefficients
        precision = precision * self.prior.sigma_db**2
        precision[0] = 0.0
        return mean, precision

    @property
    def _normal(self) -> tuple[FloatArray, FloatArray]:
        mean, precision = self._coefficients
        return mean, np.diag(precision)

    def weights(self, log_p: FloatArray) -> FloatArray:
        """Probability of each hypothesis, over all positions, shape (c, b)."""
        total = self.overall(log_p) + self.prior.noise_table.log_odds[self.numbers][:, None]
        return np.asarray(np.exp(total - log_sum(total.T)), float)

    def overall(self, log_p: FloatArray) -> FloatArray:
        """Log evidence of each hypothesis over all squares, shape (c, b)."""
        log_mass = self.log_mass - log_sum(self.log_mass)
        return log_sum(np.swapaxes(log_p + log_mass[:, None], 1, 2))

    def posterior_ratio(self, log_p: FloatArray, *, tempered: bool) -> FloatArray:
        """Log of posterior by prior density of walks at each square, shape (h, b).

        As in `mixture`: hypotheses (c, h, b) are mixed within their group, whose likelihood is then
        `tempered` by its trust, or not.
        """
        log_mass = (self.log_mass - log_sum(self.log_mass))[:, None]
        joint = log_p + self.prior.noise_table.log_odds[self.numbers][:, None, None]
        densities, evidence = [], []
        for rows, trust in rows_of_groups(self.numbers, self.prior):
            log_group = log_sum(np.moveaxis(joint[rows], 0, 2))
            evidence.append(log_sum((log_group + log_mass).T))
            density = trust * log_group if tempered else log_group
            densities.append(density - log_sum((density + log_mass).T) + evidence[-1])
        total = log_sum(np.stack(evidence, axis=-1))
        return log_sum(np.stack(densities, axis=-1)) - total

    def plausible(self, level_dbm: FloatArray) -> "LikelihoodGrid":
        """Without the hypotheses that one walk (n,) rules out, with six at most."""
        p = self.weights(self.evaluate(level_dbm[:, None])[0])[:, 0]
        keep = [i for i in np.argsort(-p)[:_MOST_HYPOTHESES].tolist() if p[i] > _LEAST_WEIGHT]
        whiteners = [self.whiteners[i] for i in sorted(keep)]
        return likelihood_grid(self.blocks, self.prior, self.squares, whiteners)


def likelihood_grid(
    blocks: Blocks, prior: Prior, squares: Squares, whiteners: list[Whitener]
) -> LikelihoodGrid:
    """The grid of a walk at squares (3, h)."""
    columns = varying_columns(blocks, prior, Places.of(squares[0], squares[1]))
    extra = receiver_variance(blocks, prior, -columns[0])
    return LikelihoodGrid(blocks, prior, squares, whiteners, columns, extra)


def refine(
    grid: LikelihoodGrid, level_dbm: FloatArray, most: int, share: float = 0.01
) -> LikelihoodGrid:
    """Split squares until none holds over `share` of any walk (n, b) under any hypothesis.

    No more than `most` squares are made.
    """
    while grid.squares.shape[1] < most:
        log_p, _ = grid.evaluate(level_dbm)
        # flattened, so that a peak inside a large square is not missed
        log_mass = 0.5 * log_p + grid.log_mass[:, None]
        p = np.max(np.exp(log_mass - log_sum(np.swapaxes(log_mass, 1, 2))[:, None]), axis=(0, 2))
        heavy = p > share
        order = np.argsort(-np.where(heavy, p, 0.0))[: max((most - len(p)) // 3, 0)]
        split = np.zeros(len(p), np.bool_)
        split[order] = heavy[order] & (grid.squares[2, order] > _LEAST_SIDE_M)
        if not np.any(split):
            break
        quarters = children(grid.squares[:, split])
        grid = grid.with_squares(np.concatenate([grid.squares[:, ~split], quarters], axis=1))
    return grid


@dataclass(frozen=True)
class PreparedWalk:
    """A walk ready for tests: levels about zero, a `field` of few places to be refined, its noise.

    `root` (n, n) is that of the noise's covariance by the likeliest hypothesis. For places (m,) it
    has their probability, sigma, and mean and variance of eta.
    """

    field: LikelihoodGrid
    level_dbm: FloatArray
    root: FloatArray
    probability: FloatArray
    sigma_db: FloatArray
    eta: FloatArray
    eta_variance: FloatArray

    @property
    def blocks(self) -> Blocks:
        """Of its field."""
        return self.field.blocks

    def walks(self, positions: Places, rng: np.random.Generator) -> FloatArray:
        """Levels of one walk for each place (b,) of the transmitter, shape (n, b)."""
        prior = self.field.prior
        m = rng.choice(len(self.probability), len(positions), p=self.probability)
        eta = self.eta[m] + np.sqrt(self.eta_variance[m]) * rng.normal(size=len(m))
        sigma_db = self.sigma_db[m]
        at_db = distances_db(self.blocks, prior.height_m, positions)
        noise = self.root @ rng.normal(size=at_db.shape)
        extra = receiver_variance(self.blocks, prior, at_db)
        if extra is not None:
            noise += np.sqrt(extra) * rng.normal(size=extra.shape)
        levels_dbm = sigma_db * noise - eta * at_db
        if prior.antenna_db:
            size = sigma_db / prior.sigma_db
            levels_dbm += antenna_patterns(self.blocks, prior, positions, size, rng)
        return np.asarray(levels_dbm, float)


def antenna_patterns(
    blocks: Blocks,
    prior: Prior,
    positions: Places,
    size: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Random antenna patterns in dB at positions (b,), `size` (b,) times the prior's: (n, b)."""
    _, *harmonics = varying_columns(blocks, prior, positions)
    sigma_db = np.repeat(prior.antenna_db, 2)[:, None] * size
    walks = sigma_db * rng.normal(size=(len(harmonics), len(size)))
    return np.asarray(np.einsum("knb,kb->nb", np.stack(harmonics), walks), float)


def prepare_walk(blocks: Blocks, prior: Prior) -> PreparedWalk:
    """Learn from a walk what does not depend on the claim."""
    level_dbm = blocks.level_dbm - float(np.mean(blocks.level_dbm))
    k, coarse = covariances(blocks, prior), first_squares(blocks, prior, 1.2)
    every = whiteners_of(k)
    # each hypothesis has its own peak: places too coarse for the sharpest would rule that one out
    searched = refine(likelihood_grid(blocks, prior, coarse, every[::6]), level_dbm[:, None], _FINE)
    fine = likelihood_grid(blocks, prior, searched.squares, every).plausible(level_dbm)
    field = refine(
        likelihood_grid(blocks, prior, coarse, fine.whiteners), level_dbm[:, None], _COARSE
    )
    log_p, variance = fine.evaluate(level_dbm[:, None])
    best = int(np.argmax(fine.weights(log_p)[:, 0]))
    eta, inverse = fine.exponents(level_dbm)
    joint = log_p[best, :, 0] + fine.log_mass
    p = np.exp(joint - np.max(joint))
    likely = p > _LIKELY
    of_noise = variance[best, likely, 0]
    return PreparedWalk(
        field,
        level_dbm,
        np.asarray(np.linalg.cholesky(k[fine.numbers[best]]), float),
        p[likely] / np.sum(p[likely]),
        np.sqrt(of_noise),
        eta[best, likely],
        of_noise * inverse[best, likely],
    )


def calibrate(calm: FloatArray, statistics: FloatArray) -> FloatArray:
    """Share of the sorted `calm` (d,) at or below each of `statistics`.

    In the tail, where few are, it follows a power law through the least of them.
    """
    calm, statistics = np.maximum(calm, _LEAST), np.maximum(statistics, _LEAST)
    count = np.searchsorted(calm, statistics, side="right")
    edge = calm[_TAIL]
    steep = float(
        np.clip((_TAIL - 1.0) / max(float(np.sum(np.log(edge / calm[:_TAIL]))), 1e-9), 0.2, 5.0)
    )
    beyond = (_TAIL + 0.5) / (len(calm) + 1.0) * (np.minimum(statistics, edge) / edge) ** steep
    return np.asarray(np.where(statistics < edge, beyond, (count + 0.5) / (len(calm) + 1.0)), float)


# --- one transmitter or two ---

DRAWS = 39
"""Walks simulated past one transmitter for one run: p can then be as small as 0.025."""

_FEWEST_BLOCKS = 16
"""Fewer blocks leave too few residuals to estimate the noise beside the claim's displacement."""

_MOST_BLOCKS = 80
"""The tests draw thousands of walks over the blocks: more cost time and gain no power."""
_SEED = 20_143_774
"""Of the random numbers: the same run and claims give the same verdicts."""
_ENOUGH = 4
"""So many walks with a factor as large decide that it is not significant."""
_PAIRS = 240
"""Pairs of walks simulated for two runs; each takes far less time than a division."""
_MOST_READINGS = 800
"""Of a simulated walk: its covariance grows with their square."""
_MOST_SQUARES = 1400
"""Of the common grid of two runs."""


@dataclass(frozen=True, slots=True)
class Sites:
    """Log Bayes factor of two positions against one, and the chance of one as large by noise.

    `draws` walks past one transmitter were simulated for `p`.
    """

    log_factor: float
    p: float
    draws: int
    one: Places
    other: Places


def within_one(
    obs: Readings, posterior: Posterior, rng: np.random.Generator, draws: int = DRAWS
) -> Sites | None:
    """Test of one run.

    None if one position leaves nothing to explain, or the walk has no two strong points.
    """
    division = divide(obs, posterior)
    if division is None:
        return None
    p, done = 1.0, 0
    if division.log_factor > 0.0:
        usable = obs.usable()
        simulate = _past_one_source(_thin(usable.part(usable.limit == 0)), posterior)
        p, done = _chance(simulate, posterior, division.log_factor, rng, draws)
    return Sites(division.log_factor, p, done, division.one, division.other)


def _past_one_source(
    obs: Readings, posterior: Posterior
) -> Callable[[np.random.Generator], Readings]:
    """Draws levels past the one transmitter of a posterior."""
    x_m, y_m, p0_dbm, eta = posterior.modes[0].state.tolist()
    dx_m, dy_m, height_m = obs.x_m - x_m, obs.y_m - y_m, posterior.prior.height_m
    distance_db = log_distance_db(dx_m, dy_m, height_m, obs.position_sigma_m)
    expected_dbm = level_dbm(p0_dbm, eta, distance_db)
    apart_m = np.hypot(obs.x_m[:, None] - obs.x_m, obs.y_m[:, None] - obs.y_m)
    sigma_db = posterior.sigma_db
    weighed = zip(posterior.noise_probability, posterior.prior.hypotheses, strict=True)
    k = sum(p * shadowing(apart_m, one) for p, one in weighed if p > 0.0)
    k += np.eye(len(k)) * independent_variance(1.0, posterior.white_share, sigma_db)
    root = np.asarray(sigma_db * np.linalg.cholesky(k), float)
    no_limit = np.zeros(len(obs), np.int64)

    def simulate(rng: np.random.Generator) -> Readings:
        noise_db = root @ rng.normal(size=len(obs))
        return replace(obs, level_dbm=expected_dbm + noise_db, known_limit=no_limit)

    return simulate


def _chance(
    simulate: Callable[[np.random.Generator], Readings],
    posterior: Posterior,
    log_factor: float,
    rng: np.random.Generator,
    draws: int,
) -> tuple[float, int]:
    """Share of simulated walks with a factor as large, and their number."""
    n_as_large = done = 0
    while done < draws and n_as_large < _ENOUGH:
        division = divide(simulate(rng), posterior)
        n_as_large += division is not None and division.log_factor >= log_factor
        done += 1
    if n_as_large >= _ENOUGH:
        return n_as_large / done, done
    return (n_as_large + 1.0) / (done + 1.0), done


def _thin(obs: Readings) -> Readings:
    """Every second or third reading of a long walk: a covariance of thousands takes minutes."""
    step = -(-len(obs) // _MOST_READINGS)
    return obs.part(slice(None, None, step)) if step > 1 else obs


def between_two(
    one: PreparedWalk, other: PreparedWalk, utm: Utm, rng: np.random.Generator
) -> Sites:
    """Test of two runs in the same zone."""
    walks = one, other
    field = one.field.with_walk(other.blocks, other.field.whiteners)
    fine = refine(field, other.level_dbm[:, None], _MOST_SQUARES)
    fields = one.field.with_squares(fine.squares), fine
    log_mass = fine.log_mass - log_sum(fine.log_mass)
    log_p = [
        field.posterior_ratio(field.evaluate(walk.level_dbm[:, None])[0], tempered=True)
        for field, walk in zip(fields, walks, strict=True)
    ]
    joint = log_mass + log_p[0][:, 0] + log_p[1][:, 0]
    p = np.exp(joint - log_sum(joint))
    at = Places.of(*fine.squares[:2, rng.choice(len(p), _PAIRS, p=p / np.sum(p))])
    simulated = [
        field.posterior_ratio(field.evaluate(walk.walks(at, rng))[0], tempered=False)
        for field, walk in zip(fields, walks, strict=True)
    ]
    log_factor = float(_log_factor(log_p[0], log_p[1], log_mass)[0])
    by_noise = np.sort(np.exp(-_log_factor(simulated[0], simulated[1], log_mass)))
    chance = float(calibrate(by_noise, np.exp(-np.array([log_factor])))[0])
    best = [int(np.argmax(log[:, 0] + log_mass)) for log in log_p]
    first, second = (Places.of(*fine.squares[:2, k], utm=utm) for k in best)
    return Sites(log_factor, chance, _PAIRS, first, second)


def _log_factor(one: FloatArray, other: FloatArray, log_mass: FloatArray) -> FloatArray:
    """Log factor for walks (h, b), shape (b,)."""
    mass = log_mass[:, None]
    apart = log_sum((mass + one).T) + log_sum((mass + other).T)
    return np.asarray(apart - log_sum((mass + one + other).T), float)


_FAR_M = 10_000.0
"""Between two runs: beyond it places around the first, which the test of two runs considers, need
not hold those of the second. Then both are one walk, which is divided."""


def site_verdict(run: Run, cell: str, other: Run | None, prior: Prior, p_fa: float) -> SiteVerdict:
    """The two-site test of a cell.

    Raises `ConfigError` for a cell that a run did not observe, and for runs too far apart.
    """
    tested = attempt(cell, "the test for two places", lambda: _sites_of(run, cell, other, prior))
    if isinstance(tested, Failure):
        return SiteVerdict(
            cell=cell,
            verdict="no sign of two places",
            why_not=tested.reason,
            error=tested.error or UNSET,
        )
    sites, why_not = tested
    if sites is None:
        return SiteVerdict(cell=cell, verdict="no sign of two places", why_not=why_not)
    is_double = sites.p <= p_fa and sites.log_factor > 0.0
    return SiteVerdict(
        cell=cell,
        verdict="two places" if is_double else "no sign of two places",
        log_factor=sites.log_factor,
        p=sites.p,
        draws=sites.draws,
        places=[(at.lat, at.lon) for at in (sites.one.on_map, sites.other.on_map)],
    )


def _sites_of(
    run: Run, cell: str, other: Run | None, prior: Prior
) -> tuple[Sites | None, str | None]:
    """None and the reason where the test cannot be made."""
    runs = [run] if other is None else [run, other]
    observed_cells(runs[:1], [cell])
    observed_cells(runs[-1:], [cell])
    for each in runs:
        if why := too_rarely(scans_of([each]).get(cell, FEWEST_SCANS)):
            return None, why
    walks = _readings(runs, cell)
    if len(walks) < len(runs):
        return None, "the cell was not received where the position of the walker is known"
    rng = np.random.default_rng(_SEED)
    if other is None:
        return _within_one_walk(walks[0], prior, rng)
    far_m = apart_m([obs.places.on_map for obs in walks])
    if far_m > 2.0 * CELL_REACH_M:
        raise ConfigError(
            f"{cell} is heard {far_m / 1000.0:.0f} km apart, farther than any cell reaches: "
            "these are two transmitters, and no test is needed"
        )
    utm = walks[0].utm
    walks = [replace(obs, places=obs.places.in_zone(utm)) for obs in walks]
    if far_m > _FAR_M:
        return _within_one_walk(_as_one(walks, modems_of(runs), prior), prior, rng)
    first, second = (_blocks_of(obs) for obs in walks)
    if min(len(first), len(second)) < _FEWEST_BLOCKS:
        return None, f"fewer than {_FEWEST_BLOCKS} locations with a level"
    return between_two(prepare_walk(first, prior), prepare_walk(second, prior), utm, rng), None


def _readings(runs: list[Run], cell: str) -> list[Readings]:
    observed = [observe_run(run).observations for run in runs]
    return [obs for each in observed if each for obs in each.cells if obs.cell == cell]


def _as_one(walks: Sequence[Readings], modems: Sequence[int], prior: Prior) -> Readings:
    usable = merge(dict(enumerate(walks)), modems).usable()
    offsets = locate(usable, prior).offsets
    if offsets is None:
        return usable
    return replace(usable.on_one_scale(offsets.mean_db), modem=None)


def _within_one_walk(
    obs: Readings, prior: Prior, rng: np.random.Generator
) -> tuple[Sites | None, str | None]:
    if why := too_few(obs, obs.usable()):
        return None, why
    sites = within_one(obs, locate(obs, prior), rng)
    return sites, None if sites else "one place leaves no more unexplained than shadowing does"


def _blocks_of(obs: Readings) -> Blocks:
    """Blocks of readings, without those censored or near a censored one.

    There only the high levels are left, which bias the tests.
    """
    gathered = blocks(obs.usable(), _MOST_BLOCKS)
    return gathered.clear_of_censored() if len(gathered.censored.places) else gathered
