"""Every method on the measured walks in one table: by campaign, and flight by flight."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isnan

import numpy as np

from .measured import WalkScore
from .run import Scores
from .score import CENTROID, DISC, LEAST_SQUARES, OURS, STRONGEST
from .tables import Table, three_digits
from .traces import SUNLAB, SURVEY_SLACK_M

_ORDER = (STRONGEST, CENTROID, LEAST_SQUARES, DISC, OURS, SUNLAB)
_FLIGHTS = "aerpaw_afar_uav"
_HEADINGS = ("walks", "method", "n", "error m", "coverage (95 %)", "useful", "processor s")
_LEGEND = (
    "Medians of error and processor time, failures counting as infinite errors. Coverage: share of "
    "the walks whose 95 % region holds the truth. Useful: share of those whose 95 % radius is at "
    "most half of the walk's extent and holds the truth. SunLab's estimates after ten minutes are "
    "published; they had the drone's antenna patterns."
)


@dataclass(frozen=True, slots=True)
class _Entry:
    """One method on one walk; `radius_m` is None where it states none."""

    walk: str
    method: str
    error_m: float
    covered: bool | None
    radius_m: float | None
    extent_m: float
    seconds: float

    @property
    def is_useful(self) -> bool:
        if self.radius_m is None:
            return False
        holds = self.error_m <= self.radius_m + SURVEY_SLACK_M
        return holds and self.radius_m <= 0.5 * self.extent_m


def peer_table(measured: Sequence[WalkScore], scores: Mapping[str, Scores]) -> list[Table | str]:
    """The table, where other methods were tried on measured walks."""
    entries = list(_entries(measured, scores))
    names = {one.walk for one in entries}
    if not names:
        return []
    groups = [("all", [*names])]
    for campaign in dict.fromkeys(name.partition("/")[0] for name in sorted(names)):
        own = [name for name in names if name.startswith(f"{campaign}/")]
        groups.append((campaign, own))
        if campaign == _FLIGHTS:
            groups += [(name, [name]) for name in sorted(own)]
    lines = [
        _line(group, method, some)
        for group, walks in groups
        for method in _ORDER
        if (some := [one for one in entries if one.method == method and one.walk in walks])
        and (method != SUNLAB or group != "all")
    ]
    return [Table("measured walks: every method", _HEADINGS, lines), _LEGEND]


def _entries(measured: Sequence[WalkScore], scores: Mapping[str, Scores]) -> Iterator[_Entry]:
    """Of the walks on which other methods were tried, and ours on the same."""
    others = {
        one.world: one for by_method in scores.values() for column in by_method.values()
        for one in column if not isnan(one.extent_m)
    }  # fmt: skip
    for by_method in scores.values():
        for method in _ORDER:
            for one in by_method.get(method, ()):
                if one.world in others:
                    yield _Entry(
                        one.world, method, one.error_m, one.covered, one.r95_m, one.extent_m,
                        one.seconds,
                    )  # fmt: skip
    for walk in measured:
        name = f"{walk.trace.campaign}/{walk.trace.name}"
        if name in others and not walk.variant:
            extent_m = others[name].extent_m
            yield _Entry(
                name, OURS, walk.error_m, walk.is_covered, walk.r95_m, extent_m, walk.seconds
            )


def _line(group: str, method: str, some: Sequence[_Entry]) -> tuple[str, ...]:
    covered = [one.covered for one in some if one.covered is not None]
    has_radius = any(one.radius_m is not None for one in some)
    return (
        group,
        method,
        str(len(some)),
        three_digits(float(np.median([one.error_m for one in some]))),
        f"{np.mean(covered):.2f}" if covered else "-",
        f"{np.mean([one.is_useful for one in some]):.2f}" if has_radius else "-",
        "-" if method == SUNLAB else f"{np.median([one.seconds for one in some]):.3f}",
    )
