"""Where the walker is on the device: fixes in the UTM zone of the first one."""

from math import hypot
from typing import NamedTuple

from logger.core.errors import GeoError
from logger.core.geo import Utm
from logger.core.sample_hold import SampleHold
from logger.core.track import TIMING_S, fix_sigma_m, smeared_sigma_m
from logger.core.types import Fix, Note, Scan

_LEAST_S = 1.0
"""Shorter intervals between fixes give no speed: times of arrival vary by as much."""


class Receiver(NamedTuple):
    """The walker at a fix: time, UTM position, sigma per axis and speed."""

    t_ns: int
    x_m: float
    y_m: float
    sigma_m: float
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
        if fix.valid and fix.lat_deg is not None and fix.lon_deg is not None:
            try:
                receiver = self._receiver(t_ns, fix, fix.lat_deg, fix.lon_deg)
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
        smear_m = smeared_sigma_m(hypot(end.x_m - begin.x_m, end.y_m - begin.y_m))
        return middle._replace(sigma_m=hypot(middle.sigma_m, smear_m))

    def _receiver(self, t_ns: int, fix: Fix, lat_deg: float, lon_deg: float) -> Receiver:
        self.utm = self.utm or Utm.at(lat_deg, lon_deg)
        x_m, y_m = self.utm.to_xy(lat_deg, lon_deg)
        sigma_m = fix_sigma_m(fix.acc_m, fix.hdop, fix.quality)
        speed_mps = fix.speed_mps
        if speed_mps is None:
            speed_mps = _speed_mps(self._fixes.last, t_ns, x_m, y_m)
        return Receiver(t_ns, x_m, y_m, sigma_m, speed_mps)

    def _warn_once(self, error: GeoError) -> list[Note]:
        if self._has_warned:
            return []
        self._has_warned = True
        return [Note("warning", "unmapped", f"no live estimate: {error}")]


def _speed_mps(before: Receiver | None, t_ns: int, x_m: float, y_m: float) -> float:
    """Speed since the fix before, 0 without one."""
    if before is None or t_ns <= before.t_ns:
        return 0.0
    elapsed_s = max((t_ns - before.t_ns) / 1e9, _LEAST_S)
    return hypot(x_m - before.x_m, y_m - before.y_m) / elapsed_s
