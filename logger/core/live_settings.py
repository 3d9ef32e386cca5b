"""How the on-device estimate is made; part of the configuration, recorded with every run."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal

import msgspec

STRONGEST, SUSPICIOUS = "strongest", "suspicious"

LIMITS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "hysteresis_db": (0.0, math.inf),  # infinite: the target never changes for a stronger cell
        "lost_s": (0.0, 1e9),  # thirty years, which fit into 64 bits as nanoseconds
        "give_up_s": (0.0, 1e9),
        "max_fix_age_s": (0.0, 1e9),
        "most_cells": (
            1,
            10_000,
        ),  # each has an estimate of its own; a Pi keeps up with some hundred
        "height_m": (0.0, 10_000.0),  # mountains end below
        "within_walk_m": (1.0, 30_000.0),  # nothing farther is searched
    }
)
"""Smallest and largest value of each setting; runs of earlier versions may have others."""
LONGEST_TARGET_BYTES = 64
"""The run file stores no longer name of a cell."""

LOCATOR, EKF, REFERENCE = "locator", "ekf", "reference-ekf"
"""Stages of the estimates: those of every cell, and those of the reference filter."""
OWN, OFF = "own", "off"
"""Values of `LiveSettings.baseline` that are no name of a file."""
ONE_MODE = 0.98
"""A mode with this probability counts as the only one."""

BEHIND = "estimate-behind"
"""Code of the Note of a device that fell behind: the last scans have no live estimate."""

FAILED, RESTARTED = "estimate-failed", "estimate-restarted"
"""Codes of the Notes around a gap of the live estimate: none is made of the record that the first
names, nor of those up to the one that the second names, with which a new one begins."""


FOLLOW, MARK, WITHIN = "follow", "mark", "within"
"""Codes of the Notes that the walker makes: a cell to follow, a place to remember, and how far from
the walk the transmitter can be.

The text of the first is a value of `LiveSettings.target`, that of the last a `within_walk_m`, empty
for none.
"""


def within_of(text: str) -> float | None:
    """Metres of a Note `WITHIN`; raises ValueError unless the text is empty or metres."""
    if not text:
        return None
    metres, (least, most) = float(text), LIMITS["within_walk_m"]
    if not least <= metres <= most:
        raise ValueError(f"a transmitter is within {least:g} to {most:g} m of the walk")
    return metres


class LiveSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the live estimate chooses its cells, its fix and its prior.

    Every cell named by two scans is tracked, up to `most_cells` at once: the one not received for
    longest gives way, none to another of its scan. `target` is "suspicious", "strongest" or the
    name of a cell, for the reference filter and the way to go; two scans must have named it.
    "suspicious" is a cell with that word, else the strongest when one is chosen; it stays until it
    is located or given up: not received for `give_up_s` (0: never given up, and any word counts),
    or three legs without a smaller region. "strongest" changes when another cell is `hysteresis_db`
    stronger in the same scan, or strongest after the target was not received for `lost_s`. A fix
    older than `max_fix_age_s` is not used. `joseph` chooses the form of the reference filter's
    covariance update. `environment` names the prior: any, open, suburban or urban. `antenna` is
    omni or sector, `reach` (the distance from the walk) near or far, `height_m` the antenna's
    height above the receiver; any, or None, lets the levels weigh them. Cells are looked for only
    within `within_walk_m` of the hull of the walk so far; None: anywhere. `baseline` is the file of
    earlier walks, "own" for that of the device, empty or "off" for none. `by_channel`: neighbours
    without an identity are tracked too, by their channel and code (`cell_names`).
    """

    target: str = SUSPICIOUS
    hysteresis_db: float = 6.0
    lost_s: float = 30.0
    give_up_s: float = 600.0
    max_fix_age_s: float = 3.0
    joseph: bool = False
    most_cells: int = 64
    environment: Literal["any", "open", "suburban", "urban"] = "any"
    antenna: Literal["any", "omni", "sector"] = "any"
    reach: Literal["any", "near", "far"] = "any"
    height_m: float | None = None
    within_walk_m: float | None = None
    baseline: str = ""
    streets: str = ""
    by_channel: bool = True


def restore_settings(recorded: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as a run stores them, with each null as the value that it stands for.

    JSON has neither infinity nor NaN: an infinite hysteresis is null, in earlier versions times
    were too. A height of null is any. What a run does not have is as it was before.
    """
    known = dict.fromkeys(LIMITS, math.inf) | {"height_m": None, "within_walk_m": None}
    before = {"target": STRONGEST, "give_up_s": 0.0, "by_channel": False}
    return before | {
        name: known.get(name) if value is None else value for name, value in recorded.items()
    }
