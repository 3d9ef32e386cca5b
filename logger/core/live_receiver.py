"""Where the walker is on the device: fixes in the UTM zone of the first one."""

from typing import NamedTuple

from logger.core.errors import GeoError
from logger.core.places import TIMING_S, Places, Utm, place_of_fix, smeared_sigma_m
from logger.core.sample_hold import SampleHold
from logger.core.types import Fix, Note, Scan

_LEAST_S = 1.0
"""Shorter intervals between fixes give no speed: times of arrival vary by as much."""


class Receiver(NamedTuple):
    """The walker at a fix: where and when, and the speed."""

    place: Places
    speed_mps: float


class ReceiverTrack:
    """Fixes in their recorded order; `utm` is None before the first position."""

    def __init__(self, max_fix_age_s: float) -> None:
        self.utm: Utm | None = None
        self._fixes = SampleHold[Receiver](max_fix_age_s)
        self._has_warned = False

    @property
    def latest(self) -> Receiver | None:
        """The receiver at the latest fix, None if that had no position."""
        return self._fixes.last

    def add(self, t_ns: int, fix: Fix) -> list[Note]:
        """Take a fix; the first one that cannot be mapped gives a warning."""
        receiver, warnings = None, []
        try:
            receiver = self._receiver(t_ns, fix)
        except GeoError as error:
            warnings = self._warn_once(error)
        self._fixes.add(t_ns, receiver)
        return warnings

    def at_scan(self, t_ns: int, scan: Scan) -> Receiver | None:
        """The receiver at the middle of a scan that ended at `t_ns`, None if unknown.

        The way walked during the scan adds to its sigma.
        """
        end = self._fixes.at(t_ns)
        if end is None or t_ns - scan.t_start_ns <= TIMING_S * 1e9:
            return end
        begin = self._fixes.at(scan.t_start_ns)
        middle = self._fixes.at((scan.t_start_ns + t_ns) // 2)
        if begin is None or middle is None:
            return None
        smear_m = smeared_sigma_m(end.place.away_m(begin.place))
        return middle._replace(place=middle.place.less_sure(float(smear_m)))

    def _receiver(self, t_ns: int, fix: Fix) -> Receiver | None:
        place = place_of_fix(t_ns, fix, self.utm)
        if place is None:
            return None
        self.utm = place.utm
        speed_mps = fix.speed_mps
        if speed_mps is None:
            speed_mps = _speed_mps(self._fixes.last, place)
        return Receiver(place, speed_mps)

    def _warn_once(self, error: GeoError) -> list[Note]:
        if self._has_warned:
            return []
        self._has_warned = True
        return [Note("warning", "unmapped", f"no live estimate: {error}")]


def _speed_mps(before: Receiver | None, place: Places) -> float:
    """Speed since the fix before, 0 without one."""
    if before is None:
        return 0.0
    since_ns = place.t_ns.item() - before.place.t_ns.item()
    if since_ns <= 0:
        return 0.0
    return place.away_m(before.place) / max(since_ns / 1e9, _LEAST_S)
