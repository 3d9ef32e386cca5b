"""Constants of the model, chosen without the campaign on which they are then assessed.

The walks of a campaign share receivers, terrain and one way of measuring. A constant that only
suits the campaigns it was chosen on shows here: it is chosen by the log score of the others (Good,
JRSS-B 14(1), 1952), the log of the probability that the posterior gives to the surveyed place.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.model.prior import REACHES

from .measured import WalkScore
from .measured_report import share_text
from .strata import coverage, figure_of, groups, log_density
from .tables import Table
from .tree import Prior, with_trust

Variants = Mapping[str, Prior]

_TRUST = (0.3, 0.45, 0.6, 0.8, 1.0)
_SIGMA_DB = (4.0, 5.4, 7.3)
_SIGMA_LOG_SD = (0.3, 0.45, 0.7)
_LENGTHS = (0.5, 0.7, 1.0, 1.4, 2.0)
"""Factors of the lengths of all reaches."""
_FAR_PROBABILITY = (0.25, 0.4, 0.55, 0.7, 0.85)
"""Of the reaches of distant masts together."""
_SECTOR_PROBABILITY = (0.0, 0.1, 0.2, 0.35, 0.5)
GROUP_POWERS = (0.25, 0.35, 0.5, 0.7, 1.0)
"""Values of `mixture.GROUP_POWER`, which is no field of the prior."""
_SHOWN_GROUPS = ("class A", "class C to E")


def constants(prior: Prior) -> dict[str, Variants]:
    """The constants that can be chosen: for each the priors by the text of its value."""
    return {
        "trust": {f"{v:g}": with_trust(prior, v) for v in _TRUST},
        "sigma_db": {f"{v:g}": replace(prior, sigma_db=v) for v in _SIGMA_DB},
        "sigma_log_sd": {f"{v:g}": replace(prior, sigma_log_sd=v) for v in _SIGMA_LOG_SD},
        "reach_lengths": {f"{v:g}": _with_lengths(prior, v) for v in _LENGTHS},
        "far_probability": {f"{v:g}": _with_far(prior, v) for v in _FAR_PROBABILITY},
        "sector_probability": {f"{v:g}": _with_sector(prior, v) for v in _SECTOR_PROBABILITY},
    }


def _with_lengths(prior: Prior, factor: float) -> Prior:
    """The prior with all reaches longer by a factor."""
    reaches = (one._replace(flat_m=factor * one.flat_m) for one in prior.reaches)
    return replace(prior, reaches=tuple(reaches))


def _with_far(prior: Prior, probability: float) -> Prior:
    """The prior where the far reaches have this probability together."""
    is_far = np.array([one in REACHES["far"] for one in prior.reaches])
    each = _with_share(np.array([one.probability for one in prior.reaches]), is_far, probability)
    reaches = zip(prior.reaches, each, strict=True)
    return replace(prior, reaches=tuple(one._replace(probability=p) for one, p in reaches))


def _with_sector(prior: Prior, probability: float) -> Prior:
    """The prior where the stations with a pattern have this probability together."""
    is_sector = np.array([bool(one.antenna_db) for one in prior.stations])
    each = _with_share(
        np.array([one.probability for one in prior.stations]), is_sector, probability
    )
    stations = zip(prior.stations, each, strict=True)
    some = tuple(one._replace(probability=p) for one, p in stations if p > 0.0)
    return replace(prior, stations=some)


def _with_share(odds: FloatArray, chosen: BoolArray, share: float) -> list[float]:
    """Probabilities in proportion to `odds`, of which the chosen ones together have a share."""
    total = np.sum(odds)
    if np.isclose(np.sum(odds[chosen]), share * total):
        return [float(one) for one in odds]
    rest = np.where(chosen, 0.0, odds)
    some = np.where(chosen, odds, 0.0)
    new = total * (share * some / np.sum(some) + (1.0 - share) * rest / np.sum(rest))
    return [float(one) for one in new]


@dataclass(frozen=True, slots=True)
class Choice:
    """The value that the other campaigns choose, and how it does on the one left out.

    `usual_score` is the mean log score of the constant as it is.
    """

    left_out: str
    value: str
    held_out: tuple[WalkScore, ...]
    usual_score: float


def choices(scores: Mapping[str, Sequence[WalkScore]], usual: Sequence[WalkScore]) -> list[Choice]:
    """One choice for each campaign.

    `scores` has the walks by value and `usual` those of the constant as it is, in the same order.
    """
    found = []
    for campaign in dict.fromkeys(one.trace.campaign for one in usual):
        value = max(scores, key=lambda v: log_density(_without(scores[v], campaign)))
        found.append(
            Choice(
                campaign,
                value,
                tuple(_of(scores[value], campaign)),
                log_density(_of(usual, campaign)),
            )
        )
    return found


def _of(scores: Sequence[WalkScore], campaign: str) -> list[WalkScore]:
    return [one for one in scores if one.trace.campaign == campaign]


def _without(scores: Sequence[WalkScore], campaign: str) -> list[WalkScore]:
    return [one for one in scores if one.trace.campaign != campaign]


def tables(
    name: str, scores: Mapping[str, Sequence[WalkScore]], usual: Sequence[WalkScore]
) -> list[Table]:
    """What each value reaches on all walks, and what is chosen without each campaign."""
    return [_by_value(name, scores), _by_campaign(name, choices(scores, usual))]


def _by_value(name: str, scores: Mapping[str, Sequence[WalkScore]]) -> Table:
    headings = (name, "log score", "coverage", "area km2", *_SHOWN_GROUPS)
    return Table(
        f"{name}: each value on all measured walks; log score and coverage by class",
        headings,
        [(value, *_figures(some)) for value, some in scores.items()],
    )


def _figures(scores: Sequence[WalkScore]) -> Iterator[str]:
    yield f"{log_density(scores):.3f}"
    yield _coverage(scores)
    yield f"{1e-6 * float(np.median([one.area_m2[-1] for one in scores])):.2g}"
    by_name = dict(groups(scores))
    for group in _SHOWN_GROUPS:
        some = by_name[group]
        yield f"{log_density(some):.3f}, {coverage(some):.3f}" if some else "-"


def _by_campaign(name: str, found: Sequence[Choice]) -> Table:
    together = [one for choice in found for one in choice.held_out]
    usual = float(
        np.average([c.usual_score for c in found], weights=[len(c.held_out) for c in found])
    )
    lines = [
        (
            choice.left_out,
            str(len(choice.held_out)),
            choice.value,
            _coverage(choice.held_out),
            f"{log_density(choice.held_out):.3f}",
            f"{choice.usual_score:.3f}",
        )
        for choice in found
    ]
    whole = (
        "all",
        str(len(together)),
        "",
        _coverage(together),
        f"{log_density(together):.3f}",
        f"{usual:.3f}",
    )
    headings = ("left out", "walks", name, "coverage", "log score", "log score as it is")
    return Table(f"{name}: chosen without a campaign, assessed on it", headings, [*lines, whole])


def _coverage(scores: Sequence[WalkScore]) -> str:
    return share_text(figure_of(scores, coverage))
