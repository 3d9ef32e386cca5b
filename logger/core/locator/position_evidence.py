"""Evidence of a walk at positions, in pieces that fit the cache."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.locator.orthant import tilted_moments
from logger.core.locator.quadtree import PositionPrior, Tree, children, nearest_m
from logger.core.locator.timing_advance import Timing
from logger.core.locator.tobit import Conditional, conditional_levels, tobit_evidence
from logger.core.model.blocks import Blocks
from logger.core.model.columns import varying_columns
from logger.core.model.evidence import (
    Evidence,
    join_hypotheses,
    join_positions,
    mix_stations,
)
from logger.core.model.marginal import SharedSums, marginal, walk_sums
from logger.core.model.noise import Whitener, matrices_of
from logger.core.model.prior import Prior
from logger.core.places import Places

_CHUNK = 512
"""Squares at a time: the matrices of blocks by squares stay in the processor's cache."""
_NEAR_HEIGHTS = 4.0
"""Farther from the walk than so many times its height a station's height moves no level by more
than .13 dB times the exponent."""
_LEAST_ETA_SIGMA = 0.1


class BlocksEvidence(NamedTuple):
    """A walk in blocks under some hypotheses of the noise, ready to be evaluated at positions.

    `conditionals` describe the censored readings given the levels, one for each of the `whiteners`;
    none where no reading is censored. `matrices` (c, n, n) are the whiteners', `shift` (c,) is
    added to the log evidence.
    """

    blocks: Blocks
    whiteners: list[Whitener]
    matrices: FloatArray
    conditionals: list[Conditional]
    shift: FloatArray

    @classmethod
    def of(
        cls,
        blocks: Blocks,
        prior: Prior,
        whiteners: list[Whitener],
        shift: FloatArray | None = None,
    ) -> "BlocksEvidence":
        """The evidence of blocks; `whiteners` belong to these blocks."""
        censored = whiteners if len(blocks.censored.places) else []
        conditionals = [
            conditional_levels(blocks, noise, prior.hypotheses[noise.number]) for noise in censored
        ]
        shift = np.zeros(len(whiteners)) if shift is None else shift
        return cls(blocks, whiteners, matrices_of(whiteners), conditionals, shift)

    @property
    def numbers(self) -> IntArray:
        """Numbers of the hypotheses, ascending, shape (c,)."""
        return np.array([noise.number for noise in self.whiteners])

    def evaluate(
        self, prior: Prior, nodes: int, position: FloatArray, near: Evidence | None
    ) -> Evidence:
        """Evidence (c, h) at positions (2, h); the search begins at `near` (c, h)."""
        starts = range(0, position.shape[1], _CHUNK)
        some = [slice(first, first + _CHUNK) for first in starts]
        return join_positions(
            [
                self._evaluate_some(prior, nodes, position[:, k], near and near.at_positions(k))
                for k in some
            ]
        )

    def shift_evidence(self, unshifted: Evidence) -> Evidence:
        """The evidence (c, h) of an earlier search with the same blocks and hypotheses."""
        return unshifted._replace(log_p=unshifted.log_p + self.shift[:, None])

    def _evaluate_some(
        self, prior: Prior, nodes: int, position: FloatArray, near: Evidence | None
    ) -> Evidence:
        """A station that a hypothesis of the noise excludes has the evidence of the first one.

        So have, far from the walk, stations with the pattern of the first: there the height does
        not matter.
        """
        positions, every_row = Places.of(*position), np.arange(len(self.whiteners))
        first, log_odds = prior.stations[0], prior.station_log_odds[:, self.numbers]
        shared = SharedSums.of(prior, np.isfinite(log_odds))
        alone = [prior.of_station(one) for one in prior.stations]
        patterned = alone[shared.patterned if len(shared.rows) else 0]
        columns = varying_columns(self.blocks, patterned, positions)
        own = columns[: 1 + 2 * len(first.antenna_db)]
        total = walk_sums(self.blocks, self.matrices[shared.rest], alone[0], positions, own)
        of_patterned = total
        if len(shared.rows):
            matrices = self.matrices[shared.rows]
            of_patterned = walk_sums(self.blocks, matrices, patterned, positions, columns)
            total = shared.join(total, of_patterned)
        of_first = self._of_sums(total, alone[0], own, nodes, positions, near, every_row)
        if len(alone) == 1:
            return self.shift_evidence(of_first)
        away_m = nearest_m(self.blocks, positions)
        parts = [of_first]
        for k, station in enumerate(prior.stations[1:], 1):
            rows, chosen = np.flatnonzero(np.isfinite(log_odds[k])), np.arange(len(positions))
            if station.antenna_db == first.antenna_db:
                tall_m = max(station.height_m, first.height_m)
                chosen = np.flatnonzero(away_m < _NEAR_HEIGHTS * tall_m)
            parts.append(of_first)
            if len(rows) and len(chosen):
                at, varying, total = positions.part(chosen), columns, of_patterned
                if k != shared.patterned:
                    varying = varying_columns(self.blocks, alone[k], at)
                    total = walk_sums(self.blocks, self.matrices[rows], alone[k], at, varying)
                begin = near and near.at_positions(chosen)
                found = self._of_sums(total, alone[k], varying, nodes, at, begin, rows)
                parts[-1] = of_first.replace(rows, chosen, found)
        return self.shift_evidence(mix_stations(parts, log_odds))

    def _of_sums(
        self,
        total: FloatArray,
        prior: Prior,
        varying: list[FloatArray],
        nodes: int,
        positions: Places,
        near: Evidence | None,
        rows: IntArray,
    ) -> Evidence:
        """Evidence of the only station of a prior; `rows` are its hypotheses."""
        log_det = np.array([noise.log_det for noise in self.whiteners])[rows, None]
        if self.conditionals:
            conditionals = [self.conditionals[row] for row in rows]
            begin = near and near.of_hypotheses(rows)
            found = tobit_evidence(
                total, log_det, self.blocks, conditionals, prior, positions, begin, varying
            )
        else:
            found = marginal(total, len(self.blocks), log_det, prior, nodes)
        return with_possible_exponent(found, prior.least_eta)


def with_possible_exponent(found: Evidence, least_eta: float) -> Evidence:
    """The evidence where the prior of the exponent is cut by Phi((eta - `least_eta`) / .1)."""
    of_p0, of_both, of_eta = found.theta_cov
    log_phi, above, narrowed = tilted_moments(
        found.theta[1] - least_eta, of_eta, _LEAST_ETA_SIGMA**2
    )
    theta, per_eta = found.theta.copy(), of_both / of_eta
    theta[0] += per_eta * (above + least_eta - theta[1])
    theta[1] = above + least_eta
    less = narrowed - of_eta
    spread = [of_p0 + per_eta**2 * less, of_both + per_eta * less, narrowed]
    return found._replace(log_p=found.log_p + log_phi, theta=theta, theta_cov=np.stack(spread))


class PositionEvidence(NamedTuple):
    """A walk under some hypotheses of the noise, ready to be evaluated at positions.

    The hypotheses of all `parts` ascend. `log_weight` (c,) is theirs, as in `Tree`.
    """

    position_prior: PositionPrior
    parts: list[BlocksEvidence]
    prior: Prior
    nodes: int
    log_weight: FloatArray | None
    timing: Timing | None

    def leaves(self, squares: FloatArray, near: Evidence | None = None) -> Tree:
        """Leaves at squares (3, h): rows x, y, side.

        `near` (c, h) is the evidence at a point close to each of them, where to begin to look.
        """
        found, first = [], 0
        for part in self.parts:
            rows = slice(first, first + len(part.whiteners))
            begin = near and near.of_hypotheses(rows)
            found.append(part.evaluate(self.prior, self.nodes, squares[:2], begin))
            first = rows.stop
        return self._tree(squares, found)

    def refine(self, tree: Tree, blocks: Blocks) -> Tree:
        """Leaves at the squares of a tree that was searched with some `blocks`.

        Parts with the same blocks keep its evidence; others begin to look there.
        """
        found = []
        for part in self.parts:
            known = tree.evidence.of_hypotheses(np.searchsorted(tree.numbers, part.numbers))
            found.append(
                part.shift_evidence(known)
                if part.blocks is blocks
                else part.evaluate(self.prior, self.nodes, tree.squares[:2], known)
            )
        return self._tree(tree.squares, found)

    def split(self, tree: Tree, chosen: BoolArray) -> Tree:
        """The tree with its chosen leaves, a mask of shape (h,), split in four."""
        if not np.any(chosen):
            return tree
        parents = None
        if any(part.conditionals for part in self.parts):
            of_chosen = tree.evidence.at_positions(np.flatnonzero(chosen))
            parents = join_positions([of_chosen] * 4)
        quarters = self.leaves(children(tree.squares[:, chosen]), parents)
        return tree.replace_leaves(chosen, quarters)

    def _tree(self, squares: FloatArray, of_parts: list[Evidence]) -> Tree:
        numbers = np.concatenate([part.numbers for part in self.parts])
        x_m, y_m, size_m = squares
        return Tree(
            x_m,
            y_m,
            size_m,
            log_prior=self.position_prior.log_density(squares),
            evidence=join_hypotheses(of_parts),
            numbers=numbers,
            log_weight=None if self.log_weight is None else self.log_weight[numbers],
            log_timing=self._log_timing(squares),
        )

    def _log_timing(self, squares: FloatArray) -> FloatArray | None:
        if self.timing is None:
            return None
        starts = range(0, squares.shape[1], _CHUNK)
        parts = [self.timing.log_p(Places.of(*squares[:2, i : i + _CHUNK])) for i in starts]
        return np.concatenate(parts)
