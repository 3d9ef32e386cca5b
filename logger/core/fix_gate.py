"""Which fixes may be true; without numpy, which the service of the page has no memory for."""

from math import cos, hypot, radians

from logger.core.types import Fix

METRES_PER_DEG = 111_320.0
"""Of longitude at the equator; a degree of latitude is up to 0.7 % shorter."""


class FixGate:
    """Which fixes may be true: none that the receiver cannot have reached since the one before.

    One cold start, reflection or jammer gives fixes that are kilometres off. The others decide:
    where those of `_RETURN_NS` are near each other, the one before was wrong. As an error of less
    than `_ERROR_M` has its share in the sigma of a place, it passes. Where `_MOST_LEAPS` in as many
    seconds or more are near none before, the times are none, as in a table that counts its rows:
    all pass until there is no leap for `_QUIET_NS`.
    """

    _ERROR_M = 150.0
    _SHORT_M = 50.0  # out of reach by more is a leap, though the fix may be true
    _FASTEST_MPS = 100.0
    """360 km/h: a train."""
    _RETURN_NS = 5 * 10**9
    _MOST_LEAPS = 10
    _QUIET_NS = 60 * 10**9

    def __init__(self) -> None:
        self._known: tuple[int, Fix] | None = None
        self._doubtful: tuple[int, Fix] | None = None
        self._doubtful_ns = 0
        self.leapt_ns: int | None = None  # when the last fix out of reach passed
        self._leaps = 0
        self._leaps_since_ns = self._leap_ns = 0

    def passes(self, t_ns: int, fix: Fix) -> bool:
        """Take the next fix; one without a position passes, and changes nothing."""
        if not fix.valid or fix.lat_deg is None or fix.lon_deg is None:
            return True
        new = t_ns, fix
        if self._known is not None and not self._is_within_reach(self._known, new):
            if self._doubtful is None or not self._is_within_reach(self._doubtful, new):
                self._doubtful_ns = t_ns
                self._count_leap(t_ns)
            self._doubtful = new
            if t_ns - self._doubtful_ns < self._RETURN_NS and not self._has_no_times(t_ns):
                return False
        elif not self._has_no_times(t_ns):
            self._leaps = 0
        if not self._is_within_reach(self._known or new, new, self._SHORT_M):
            self.leapt_ns = None if self._has_no_times(t_ns) else t_ns
        self._known, self._doubtful = new, None
        return True

    def _count_leap(self, t_ns: int) -> None:
        if not self._leaps:
            self._leaps_since_ns = t_ns
        self._leaps += 1
        self._leap_ns = t_ns

    def _has_no_times(self, t_ns: int) -> bool:
        lasted_ns = self._leap_ns - self._leaps_since_ns
        is_many = self._leaps >= self._MOST_LEAPS and lasted_ns >= (self._MOST_LEAPS - 1) * 10**9
        return is_many and t_ns - self._leap_ns < self._QUIET_NS

    def _is_within_reach(
        self, before: tuple[int, Fix], after: tuple[int, Fix], error_m: float = _ERROR_M
    ) -> bool:
        seconds = max(after[0] - before[0], 0) / 1e9
        return _apart_m(before[1], after[1]) <= error_m + self._FASTEST_MPS * seconds


def _apart_m(one: Fix, other: Fix) -> float:
    """About the distance of two fixes on a globe, exact enough to tell a leap from a walk."""
    lat_deg, lon_deg, other_lat_deg, other_lon_deg = (
        angle_deg or 0.0 for fix in (one, other) for angle_deg in (fix.lat_deg, fix.lon_deg)
    )
    turn_deg = (other_lon_deg - lon_deg + 180.0) % 360.0 - 180.0
    north_deg = other_lat_deg - lat_deg
    return METRES_PER_DEG * hypot(turn_deg * cos(radians(lat_deg)), north_deg)
