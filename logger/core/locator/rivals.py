"""Which places of a posterior count beside its best one, and their shares in whole whole_percents that
add up.
"""

from collections.abc import Sequence

from logger.core.locator.posterior import LEAST_PEAK, Mode

MINOR_PLACE = 0.03
"""A place with this share counts, however flat it is."""
LEAST_SHARE = 0.01
"""A place with less counts for nothing, however sharp: printed as 0 % it would send people to
nowhere.
"""


def relevant_modes(modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """The best place, and those that cannot be dismissed: for their mass, or since they fit as well
    though small.
    """
    return (*modes[:1], *(mode for mode in modes[1:] if _is_rival(mode)))


def _is_rival(mode: Mode) -> bool:
    return mode.probability >= MINOR_PLACE or (
        mode.peak >= LEAST_PEAK and mode.probability >= LEAST_SHARE
    )


def whole_percents(modes: Sequence[Mode]) -> list[int]:
    """Probabilities of `counting` places in whole whole_percents, rounded so that their sum is that of
    the probabilities.

    None of several is 0 or 100.
    """
    exact = [100.0 * mode.probability for mode in modes]
    whole = [int(value) for value in exact]
    missing = round(sum(exact)) - sum(whole)
    by_rest = sorted(range(len(whole)), key=lambda i: exact[i] - whole[i], reverse=True)
    for i in by_rest[:missing]:
        whole[i] += 1
    return whole


def share_text(probability: float) -> str:
    """Share of one place among several, which is never nothing and never all."""
    if probability < LEAST_SHARE:
        return "under 1%"
    return "over 99%" if probability > 1.0 - LEAST_SHARE else f"{probability:.0%}"
