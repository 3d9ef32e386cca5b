"""What near and far, omni and sector, and each height would say if one alone were true."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.certainty import area_text, share_text
from logger.core.locator.region import Squares, area_m2, highest_density
from logger.core.model.prior import REACHES, Prior

REACH, ANTENNA, HEIGHT = "reach", "antenna", "height"
"""Kinds of hypotheses that the levels weigh."""

_NEAR_M = max(one.flat_m for one in REACHES["near"])
"""A hypothesis of the reach is near where its density falls beyond no more than this."""
_MOST = 0.5
"""Of the probability: a height with less is unknown, a region with less inside is elsewhere."""
_LEAST_PROBABILITY = 1e-9
"""The leaves, made for others, show no region of a less likely hypothesis."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """One hypothesis of a kind, its probability after the walk, and the region it alone would give.

    `area_m2` is that of the 95 % region. `outside` is the share of the hypothesis's probability
    that lies outside the answer's 95 % region. Both are None where it is ruled out.
    """

    kind: str
    name: str
    probability: float
    area_m2: float | None
    outside: float | None


def alternatives(
    prior: Prior, squares: Squares, reach: FloatArray, station: FloatArray
) -> tuple[Alternative, ...]:
    """The hypotheses that a prior has, grouped by their names.

    `reach` (g, r, h) and `station` (g, s, h) are the joint probabilities of the group of the noise,
    the prior's reach or station, and the square; `squares` are blurred besides. Weighed heights are
    those of stations with the pattern of the first: a sector antenna has only one.
    """
    by_reach = ["near" if one.flat_m <= _NEAR_M else "far" for one in prior.reaches]
    by_antenna = ["sector" if one.antenna_db else "omni" for one in prior.stations]
    heights = [f"{height_m:g} m" for height_m in sorted({one.height_m for one in prior.stations})]
    by_height = [
        f"{one.height_m:g} m" if one.antenna_db == prior.antenna_db or len(heights) == 1 else ""
        for one in prior.stations
    ]
    return (
        *_of_kind(REACH, ("near", "far"), by_reach, squares, reach),
        *_of_kind(ANTENNA, ("omni", "sector"), by_antenna, squares, station),
        *_of_kind(HEIGHT, heights, by_height, squares, station),
    )


def _of_kind(
    kind: str, order: Sequence[str], names: Sequence[str], squares: Squares, joint: FloatArray
) -> Iterator[Alternative]:
    """One for each name in `names` (k,) of the hypotheses of `joint` (g, k, h); none for "".

    The evidence of a group hardly depends on the hypothesis, so each group keeps the weight of the
    answer. By the joint probability a tempered group would have more of what is improbable, and far
    would seem twice as wide as it is.
    """
    answer = highest_density(squares)
    of_groups = np.sum(joint, axis=(1, 2))
    every = np.maximum(np.sum(joint, axis=(0, 1)), np.finfo(float).tiny)
    of_kind = np.sum(joint[:, [bool(one) for one in names]], axis=(0, 1))
    total = float(squares.probability @ (of_kind / every))
    for name in (one for one in order if one in names):
        own = np.sum(joint[:, [one == name for one in names]], axis=1)
        probability = float(squares.probability @ (np.sum(own, axis=0) / every)) / total
        if probability < _LEAST_PROBABILITY:
            yield Alternative(kind, name, probability, None, None)
            continue
        own_of_groups = np.sum(own, axis=1)
        has_any = own_of_groups > _LEAST_PROBABILITY * of_groups
        weight = (of_groups[has_any] / own_of_groups[has_any]) @ own[has_any]
        alone_p = squares.probability * (weight / every)
        if not np.any(alone_p > 0.0):
            yield Alternative(kind, name, probability, None, None)
            continue
        alone = replace(squares, probability=alone_p / np.sum(alone_p))
        outside = 1.0 - float(np.sum(alone.probability[answer]))
        yield Alternative(kind, name, probability, area_m2(alone), outside)


def alternatives_text(alternatives: Sequence[Alternative]) -> str:
    """Which reach, antenna and height the answer took, and the areas that others would give.

    Such as "reach: near 62 %, far 38 % (alone: 4.1 km²); antenna: omni (fixed); height: unknown".
    """
    return "; ".join(
        f"{kind}: {_kind_text(kind, list(some))}"
        for kind, some in groupby(alternatives, lambda one: one.kind)
    )


def _kind_text(kind: str, some: Sequence[Alternative]) -> str:
    best = max(some, key=lambda one: one.probability)
    if len(some) == 1:
        return f"{best.name} (fixed)"
    if kind == HEIGHT:
        share = share_text(best.probability)
        return "unknown" if best.probability < _MOST else f"{best.name} {share}"
    return ", ".join(_alternative_text(one, alone=one is not best) for one in some)


def _alternative_text(one: Alternative, *, alone: bool) -> str:
    text = f"{one.name} {share_text(one.probability)}"
    if not alone or one.area_m2 is None or one.outside is None:
        return text
    where = ", elsewhere" if one.outside > _MOST else ""
    return f"{text} (alone: {area_text(one.area_m2)}{where})"
