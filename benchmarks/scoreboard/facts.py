"""Facts of an answer besides its error; each has to be true."""

import numpy as np

from .answer import Answer, Mode, Region
from .world import Place, World

MIRROR_INSIDE = "truth or twin inside the region"
BOTH_LISTED = "truth and twin both listed"
PAIRED = "each listed place with its twin"
NOT_ONE_PLACE = "never told as one place"
REPORTED_NOT_TO_FIT = "says that one position does not explain the levels"
NOT_BETWEEN = "not located more than 50 m off both"

_LISTED_M, _LISTED_SIGMAS = 20.0, 3.0
_OFF_M = 50.0
_FLAT = 1e-6


def facts_of(world: World, found: Answer) -> dict[str, bool]:
    """Those facts that this world and this method can show."""
    facts: dict[str, bool] = {}
    if found.region is None:
        return facts
    if world.mirror is not None:
        facts |= _mirror_facts(world, world.mirror, found, found.region)
    if len(world.sources) > 1 and found.verdict is not None:
        facts[REPORTED_NOT_TO_FIT] = not found.fits
        facts[NOT_BETWEEN] = (
            found.verdict != "located" or world.error_m((found.x_m, found.y_m)) <= _OFF_M
        )
    return facts


def _mirror_facts(world: World, mirror: Place, found: Answer, region: Region) -> dict[str, bool]:
    source = world.sources[0]
    holds_source, holds_mirror = region.holds(source, 0.0), region.holds(mirror, 0.0)
    # closer than a listing is exact they are one place
    same = bool(np.hypot(source[0] - mirror[0], source[1] - mirror[1]) <= 2.0 * _LISTED_M)
    shown_apart = len(found.modes) > 1 or (holds_source and holds_mirror)
    return {
        MIRROR_INSIDE: holds_source or holds_mirror,
        BOTH_LISTED: all(
            any(_lists(mode, place) for mode in found.modes) for place in (source, mirror)
        ),
        PAIRED: all(
            any(_lists(other, _twin_of(mode, world)) for other in found.modes)
            for mode in found.modes
        ),
        NOT_ONE_PLACE: same or (shown_apart and found.verdict != "located"),
    }


def _twin_of(mode: Mode, world: World) -> Place:
    """Mirror image in the line of a straight walk, inverse point of a round one."""
    walk = np.stack([world.whole.x_m, world.whole.y_m])
    middle = np.mean(walk, axis=1)
    (narrow, wide), axes = np.linalg.eigh(np.cov(walk))
    off = np.array([mode.x_m, mode.y_m]) - middle
    if narrow < _FLAT * wide:
        off -= 2.0 * (off @ axes[:, 0]) * axes[:, 0]
    else:
        off *= (narrow + wide) / (off @ off)  # the mean square of the radius
    return float(middle[0] + off[0]), float(middle[1] + off[1])


def _lists(mode: Mode, place: Place) -> bool:
    """Whether a place is within 20 m or 3 sigma (of the longer axis) of a mode."""
    sigma_m = float(np.sqrt(np.max(np.linalg.eigvalsh(mode.covariance))))
    return mode.off_m(place) <= max(_LISTED_M, _LISTED_SIGMAS * sigma_m)
