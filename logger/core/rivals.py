"""What is plausible beside the best: relevant modes, and their shares in words."""

from collections.abc import Sequence
from typing import Protocol, TypeVar

LEAST_PEAK = 0.05
"""A position with this share of the highest density is a mode, however improbable."""
MINOR_MODE = 0.03
"""A mode with this share is relevant, however flat it is."""
LEAST_SHARE = 0.01
"""A mode with less is irrelevant, however sharp: "0 %" would send people the wrong way."""


class Peak(Protocol):
    """What makes a mode relevant: its highest density beside the best, and its probability."""

    @property
    def peak(self) -> float: ...
    @property
    def probability(self) -> float: ...


Mode = TypeVar("Mode", bound=Peak)


def relevant_modes(modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """The best mode, and those with much probability or a peak that fits nearly as well."""
    return (*modes[:1], *filter(_is_rival, modes[1:]))


def _is_rival(mode: Peak) -> bool:
    is_sharp = mode.peak >= LEAST_PEAK and mode.probability >= LEAST_SHARE
    return is_sharp or mode.probability >= MINOR_MODE


def whole_percents(modes: Sequence[Peak]) -> list[int]:
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
