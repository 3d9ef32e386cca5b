"""What is plausible beside the best: relevant modes, alternatives, and their shares in words."""

from collections.abc import Sequence
from itertools import groupby

from logger.core.locator.alternatives import HEIGHT, Alternative
from logger.core.locator.posterior import LEAST_PEAK, Mode

MINOR_MODE = 0.03
"""A mode with this share is relevant, however flat it is."""
LEAST_SHARE = 0.01
"""A mode with less is irrelevant, however sharp: as "0 %" it would send people the wrong way."""
_MOST = 0.5
"""Of the probability: a height with less is unknown, a region with less inside is elsewhere."""


def relevant_modes(modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """The best mode, and those with much probability or with a peak that fits nearly as well."""
    return (*modes[:1], *filter(_is_rival, modes[1:]))


def _is_rival(mode: Mode) -> bool:
    is_sharp = mode.peak >= LEAST_PEAK and mode.probability >= LEAST_SHARE
    return is_sharp or mode.probability >= MINOR_MODE


def whole_percents(modes: Sequence[Mode]) -> list[int]:
    """Probabilities of relevant modes in whole percents with the sum of the probabilities.

    The largest remainders are rounded up. None of several modes has 0 or 100.
    """
    exact = [100.0 * mode.probability for mode in modes]
    percents = [int(value) for value in exact]
    missing = round(sum(exact)) - sum(percents)
    by_remainder = sorted(range(len(exact)), key=lambda i: percents[i] - exact[i])
    for i in by_remainder[:missing]:
        percents[i] += 1
    return percents


def share_text(probability: float) -> str:
    """Share of one mode among several, which is never 0 or 100 %."""
    if probability < LEAST_SHARE:
        return "under 1%"
    return "over 99%" if probability > 1.0 - LEAST_SHARE else f"{probability:.0%}"


def area_text(area_m2: float) -> str:
    """An area with its significant digits."""
    if area_m2 >= 100_000.0:
        return f"{area_m2 / 1e6:.2g} km²"
    return f"{float(f'{area_m2:.2g}'):,.0f} m²".replace(",", "\N{NARROW NO-BREAK SPACE}")


def alternatives_text(alternatives: Sequence[Alternative]) -> str:
    """Which reach, antenna and height the answer took, and the areas that others would give.

    Such as "reach: near 62%, far 38% (alone: 4.1 km²); antenna: omni (fixed); height: unknown".
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
