"""Evidence of a walk at positions: evaluates squares of the tree in pieces that fit the cache."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.locator.quadtree import Tree, children, log_prior
from logger.core.locator.timing_advance import Timing
from logger.core.locator.tobit import Conditional, conditional_levels, tobit_evidence
from logger.core.model.blocks import Blocks
from logger.core.model.marginal import Evidence, marginal, walk_sums
from logger.core.model.noise import Whitener, matrices_of
from logger.core.model.prior import Prior

_CHUNK = 512
"""Squares evaluated at a time: the matrices of blocks by squares stay in the processor's cache."""


class BlocksEvidence(NamedTuple):
    """A walk in blocks under some hypotheses of the noise, ready to be evaluated at positions.

    `conditionals` describe the censored readings given the levels, one for each of the `whiteners`;
    none where no reading is censored. `matrices` (c, n, n) are those of the whiteners. `shift` (c,)
    is added to the log evidence.
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
        censored = whiteners if len(blocks.censored.x_m) else []
        conditionals = [
            conditional_levels(blocks, noise, prior.hypotheses[noise.number]) for noise in censored
        ]
        shift = np.zeros(len(whiteners)) if shift is None else shift
        return cls(blocks, whiteners, matrices_of(whiteners), conditionals, shift)

    def evaluate(
        self, prior: Prior, nodes: int, position: FloatArray, near: Evidence | None
    ) -> Evidence:
        """Evidence (c, h) at positions (2, h); `near` (c, h) is where to begin to look."""
        x_m, y_m = position
        sums = walk_sums(self.blocks, self.matrices, prior, x_m, y_m)
        log_det = np.array([noise.log_det for noise in self.whiteners])[:, None]
        if self.conditionals:
            found = tobit_evidence(
                sums, log_det, self.blocks, self.conditionals, prior, x_m, y_m, near
            )
        else:
            found = marginal(sums, len(self.blocks), log_det, prior, nodes)
        return found._replace(log_p=found.log_p + self.shift[:, None])


class PositionEvidence(NamedTuple):
    """A walk under some hypotheses of the noise, ready to be evaluated at positions.

    The hypotheses of all `parts` ascend. `blocks` are those that the prior of the position is
    measured from, `log_weight` (c,) that of the parts' hypotheses as in `Tree`.
    """

    blocks: Blocks
    parts: list[BlocksEvidence]
    prior: Prior
    nodes: int
    log_weight: FloatArray | None
    timing: Timing | None

    def leaves(self, squares: FloatArray, near: Evidence | None = None) -> Tree:
        """Leaves at squares (3, h): rows x, y, side.

        `near` (c, h) is the evidence at a point close to each of them, where to begin to look.
        """
        starts = range(0, squares.shape[1], _CHUNK)
        parts = [self._evidence(squares[:2, i : i + _CHUNK], _chunk(near, i)) for i in starts]
        columns = zip(*parts, strict=True)
        numbers = np.array([noise.number for part in self.parts for noise in part.whiteners])
        x_m, y_m, size_m = squares
        return Tree(
            x_m,
            y_m,
            size_m,
            log_prior=log_prior(self.blocks, self.prior, squares),
            evidence=Evidence(*(np.concatenate(values, axis=-1) for values in columns)),
            numbers=numbers,
            log_weight=None if self.log_weight is None else self.log_weight[numbers],
            log_timing=self._log_timing(squares, starts),
        )

    def split(self, tree: Tree, chosen: BoolArray) -> Tree:
        """The tree with its chosen leaves, a mask of shape (h,), split in four."""
        if not np.any(chosen):
            return tree
        parents = None
        if any(part.conditionals for part in self.parts):
            repeated = ([values[..., chosen]] * 4 for values in tree.evidence)
            parents = Evidence(*(np.concatenate(values, axis=-1) for values in repeated))
        quarters = self.leaves(children(tree.squares[:, chosen]), parents)
        return tree.replace_leaves(chosen, quarters)

    def _evidence(self, position: FloatArray, near: Evidence | None) -> Evidence:
        found, first = [], 0
        for part in self.parts:
            rows = slice(first, first + len(part.whiteners))
            begin = None if near is None else Evidence(*(v[..., rows, :] for v in near))
            found.append(part.evaluate(self.prior, self.nodes, position, begin))
            first = rows.stop
        if len(found) == 1:
            return found[0]
        return Evidence(*(np.concatenate(v, axis=-2) for v in zip(*found, strict=True)))

    def _log_timing(self, squares: FloatArray, starts: range) -> FloatArray | None:
        if self.timing is None:
            return None
        parts = [self.timing.log_p(*squares[:2, i : i + _CHUNK]) for i in starts]
        return np.concatenate(parts)


def _chunk(near: Evidence | None, first: int) -> Evidence | None:
    if near is None:
        return None
    return Evidence(*(values[..., first : first + _CHUNK] for values in near))
