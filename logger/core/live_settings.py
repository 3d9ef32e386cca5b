"""How the on-device estimate is made; part of the configuration, recorded with every run."""

from typing import Literal

import msgspec

STRONGEST = "strongest"


class LiveSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the live estimate chooses its cells, its fix and its prior.

    Every cell heard is tracked, up to `most_cells` at once: the one not heard for longest gives way. `target` is
    "strongest" or the name of a cell, for the reference filter and the default view. The target changes when another
    cell is `hysteresis_db` stronger in the same scan, or strongest after the target was not heard for `lost_s`. A fix
    older than `max_fix_age_s` is none. `joseph` chooses the form of the reference filter's covariance update.
    `environment` names the prior: any, open, suburban or urban; `height_m` is the antenna's above the receiver.
    """

    target: str = STRONGEST
    hysteresis_db: float = 6.0
    lost_s: float = 30.0
    max_fix_age_s: float = 3.0
    joseph: bool = False
    most_cells: int = 64
    environment: Literal["any", "open", "suburban", "urban"] = "any"
    height_m: float = 5.0
