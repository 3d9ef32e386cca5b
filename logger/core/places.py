"""Places: where the walker was or a transmitter may be, in one UTM zone; and that zone.

A walk that crosses the border of a zone or the equator stays continuous in the zone of its first
fix. Transverse Mercator by PROJ (Karney 2011) is accurate to nanometres far outside the zone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import floor, hypot, isfinite
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt
from pyproj import Proj

from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.certainty import OnMap
from logger.core.errors import ConfigError, EstimationError, GeoError
from logger.core.model.path_loss import log_distances_db
from logger.core.rows import Rows
from logger.core.types import DEAD_RECKONING, Fix

MAX_LATITUDE_DEG = 84.0
"""UTM ends here (NGA.STND.0037); the last degrees belong to polar projections."""
MAX_GAP_S = 10.0
"""Positions between two fixes farther apart in time than this are not interpolated."""
MAX_BEYOND_S = 2.0
"""A reading may be this much older than the first fix or younger than the last one."""
UERE_M = 4.0
"""User equivalent range error of a single-frequency receiver, per axis: sigma = HDOP x this."""
SIGMA_OF_RADIUS68 = 1.0 / 1.5096
"""Sigma per axis of a round Gaussian from the radius that holds 68 % of it."""
UNKNOWN_SIGMA_M = 7.0
"""Sigma per axis of a fix without an accuracy: a receiver among houses."""
DEAD_RECKONING_SIGMA_M = 28.0
"""Additional sigma per axis of dead reckoning: it misses a turn for 20 s of 1.4 m/s."""
TIMING_S = 2.0
"""What is walked in this time is unsure: a level is an average over seconds, reported late.

3GPP TS 45.008, 6.6.1: 5 s or more if idle.
"""
_SIDE_M = 20.0
"""Side of a square of ground: about the median decorrelation distance."""
_VISIT_M = 60.0
"""A visit ends after this way: three squares farther the walker has left."""
_MOST_READINGS = 30
"""Of a visit: a walker needs 14 s for a square, and then stands still."""


def zone_of(lat_deg: float, lon_deg: float) -> int:
    """UTM zone 1..60 of a position, negative on the southern hemisphere.

    Without the wider zones of Norway and Svalbard: any nearby serves a walk. Raises `GeoError`
    beyond 84 deg of latitude or for no position.
    """
    check_position(lat_deg, lon_deg)
    zone = int((lon_deg + 180.0) // 6.0) % 60 + 1
    return zone if lat_deg >= 0.0 else -zone


def check_position(lat_deg: float, lon_deg: float) -> None:
    """Raise `GeoError` unless the position can be mapped."""
    could_be_swapped = abs(lat_deg) <= 180.0 and abs(lon_deg) <= MAX_LATITUDE_DEG
    swapped = "; latitude and longitude swapped?" if could_be_swapped else ""
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        raise GeoError(
            f"no position on Earth: latitude {lat_deg}, longitude {lon_deg} deg{swapped}"
        )
    if abs(lat_deg) > MAX_LATITUDE_DEG:
        raise GeoError(
            f"latitude {lat_deg:.4f} deg is beyond 84 deg, where UTM ends; "
            f"cellwalk cannot map this walk{swapped}"
        )


def position_of(text: str, third: str = "") -> tuple[OnMap, float | None]:
    """LAT,LON or LAT LON, as our tables have it, and the `third` number, if that has a name.

    Raises `ConfigError`, or as `check_position`.
    """
    parts = text.replace(",", " ").split()
    try:
        values = [float(part) for part in parts]
    except ValueError:
        values = []
    is_complete = len(values) == 2 or (len(values) == 3 and third != "")
    if not is_complete or not all(map(isfinite, values)):
        longer = f" or LAT,LON,{third}" if third else ""
        alone = "; each position has an option of its own" if len(values) > 3 else ""
        raise ConfigError(
            f"{text[:40]!r} is no position: LAT,LON{longer} is wanted, like 52.52,13.405{alone}"
        )
    lat_deg, lon_deg, *more = values
    check_position(lat_deg, lon_deg)
    return OnMap(lat=lat_deg, lon=lon_deg), more[0] if more else None


@dataclass(frozen=True, slots=True)
class Utm:
    """One UTM zone; `zone` as of `zone_of`."""

    zone: int

    @classmethod
    def at(cls, lat_deg: float, lon_deg: float) -> "Utm":
        """Zone of a run by its first fix."""
        return cls(zone_of(lat_deg, lon_deg))

    def to_xy(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """East and north of one position in metres."""
        check_position(lat_deg, lon_deg)
        x_m, y_m = _proj(self.zone)(lon_deg, lat_deg)
        return float(x_m), float(y_m)

    def to_xy_arrays(
        self, lat_deg: FloatArray, lon_deg: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """East and north in metres, shape as the arguments."""
        if lat_deg.size:
            for values in (lat_deg, lon_deg):
                worst = np.argmax(np.abs(values))
                check_position(float(lat_deg.flat[worst]), float(lon_deg.flat[worst]))
        x_m, y_m = _proj(self.zone)(lon_deg, lat_deg)
        return np.asarray(x_m, float), np.asarray(y_m, float)

    def to_latlon(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Latitude and longitude in degrees of one position."""
        lon_deg, lat_deg = _proj(self.zone)(x_m, y_m, inverse=True)
        return float(lat_deg), float(lon_deg)

    def to_latlon_arrays(self, x_m: FloatArray, y_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Latitude and longitude in degrees, shape as the arguments."""
        lon_deg, lat_deg = _proj(self.zone)(x_m, y_m, inverse=True)
        return np.asarray(lat_deg, float), np.asarray(lon_deg, float)


_PROJ: dict[int, Proj] = {}


def _proj(zone: int) -> Proj:
    if zone not in _PROJ:
        _PROJ[zone] = Proj(proj="utm", zone=abs(zone), south=zone < 0, ellps="WGS84")
    return _PROJ[zone]


PLANE = Utm(31)
"""Frame of places given without one: any zone is a plane."""
NO_MAP = Utm(0)
"""Frame of arrays in a plane of the user's own: nothing is converted to degrees."""


@dataclass(frozen=True, slots=True)
class Places:  # noqa: PLW1641 (arrays have no hash)
    """Places in time order, arrays of shape (n,); one place is n = 1.

    `x_m, y_m` are east and north in the zone `utm`, `sigma_m` the standard deviation per axis.
    `z_m` is the walker's height above sea level by the fix, NaN where unknown. `t_ns` is the time
    since boot, 0 where there is none.
    """

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    sigma_m: FloatArray
    t_ns: IntArray
    utm: Utm = PLANE

    _columns: ClassVar[tuple[str, ...]] = ("x_m", "y_m", "z_m", "sigma_m", "t_ns")

    @classmethod
    def of(
        cls,
        x_m: npt.ArrayLike,
        y_m: npt.ArrayLike,
        *,
        utm: Utm = PLANE,
        sigma_m: FloatArray | None = None,
        t_ns: IntArray | None = None,
    ) -> "Places":
        """Places from coordinates: certain, without height and time if not given."""
        x, y = np.atleast_1d(np.asarray(x_m, float)), np.atleast_1d(np.asarray(y_m, float))
        sigma_m = np.zeros(len(x)) if sigma_m is None else sigma_m
        t_ns = np.zeros(len(x), np.int64) if t_ns is None else t_ns
        return Places(x, y, np.full(len(x), np.nan), sigma_m, t_ns, utm)

    @classmethod
    def of_degrees(
        cls, lat_deg: npt.ArrayLike, lon_deg: npt.ArrayLike, *, utm: Utm | None = None
    ) -> "Places":
        """Places from WGS 84 degrees, by default in the zone of the first; raises `GeoError`."""
        lat, lon = (np.atleast_1d(np.asarray(deg, float)) for deg in (lat_deg, lon_deg))
        utm = utm or Utm.at(float(lat[0]), float(lon[0]))
        return cls.of(*utm.to_xy_arrays(lat, lon), utm=utm)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)}, UTM zone {self.utm.zone})"

    def __len__(self) -> int:
        return len(self.x_m)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Places):
            return NotImplemented
        of_both = ((getattr(self, name), getattr(other, name)) for name in self._columns)
        return self.utm == other.utm and all(
            np.array_equal(one, another, equal_nan=True) for one, another in of_both
        )

    def __getitem__(self, k: int) -> "Places":
        k = range(len(self))[k]
        return self.part(slice(k, k + 1))

    def part(self, chosen: "slice | BoolArray | IntArray") -> Self:
        """Some of the places."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in self._columns})

    @property
    def lat_lon_deg(self) -> FloatArray:
        """WGS 84 latitude and longitude in degrees, rows of one array (2, n)."""
        return np.stack(self.utm.to_latlon_arrays(self.x_m, self.y_m))

    @property
    def xy_m(self) -> FloatArray:
        """East and north, rows of one array (2, n)."""
        return np.stack([self.x_m, self.y_m])

    @property
    def on_map(self) -> OnMap:
        """The first place in degrees."""
        lat, lon = self.utm.to_latlon(self.x_m[0], self.y_m[0])
        return OnMap(lat=lat, lon=lon)

    @property
    def steps_m(self) -> FloatArray:
        """From each place to the next, shape (n - 1,)."""
        return np.asarray(np.hypot(np.diff(self.x_m), np.diff(self.y_m)), float)

    @property
    def median(self) -> "Places":
        """The place in the middle of each axis; there is at least one."""
        return Places.of(*np.median(self.xy_m, axis=1), utm=self.utm)

    def in_zone(self, utm: Utm) -> Self:
        """The same places in another zone."""
        if self.utm == utm:
            return self
        x_m, y_m = utm.to_xy_arrays(*self.utm.to_latlon_arrays(self.x_m, self.y_m))
        return replace(self, utm=utm, x_m=x_m, y_m=y_m)

    def distances_m(self, others: "Places") -> FloatArray:
        """Distance of each place from each of the others (h,), shape (n, h)."""
        squared_m2, north_m = self.x_m[:, None] - others.x_m, self.y_m[:, None] - others.y_m
        np.square(squared_m2, out=squared_m2)
        squared_m2 += np.square(north_m, out=north_m)
        return np.asarray(np.sqrt(squared_m2, out=squared_m2), float)

    def away_m(self, other: "Places") -> float:
        """Distance of one place from another."""
        return hypot(self.x_m.item() - other.x_m.item(), self.y_m.item() - other.y_m.item())

    def log_distance_to(self, others: "Places", height_m: float = 0.0) -> FloatArray:
        """L to antennas `height_m` above the others (h,), shape (n, h): see `path_loss`.

        One product of matrices, |a|^2 + |b|^2 - 2 a b, takes a fifth of the time of differences.
        From the middle of the others, 100 km away, a square of 1 m^2 is exact to 1e-5.
        """
        x0_m, y0_m = (np.mean(v) if len(v) else 0.0 for v in (others.x_m, others.y_m))
        x_m, y_m, other_x_m, other_y_m = (
            self.x_m - x0_m, self.y_m - y0_m, others.x_m - x0_m, others.y_m - y0_m
        )  # fmt: skip
        own_m2 = x_m**2 + y_m**2 + height_m**2 + 2.0 * self.sigma_m**2
        own = np.stack([own_m2, np.ones(len(self)), -2.0 * x_m, -2.0 * y_m], axis=1)
        other = np.stack([np.ones(len(others)), other_x_m**2 + other_y_m**2, other_x_m, other_y_m])
        return log_distances_db(own @ other)

    def with_others(self, chosen: BoolArray, others: "Places") -> Self:
        """These places, but the others where `chosen` (n,)."""
        names = ("x_m", "y_m", "z_m", "sigma_m")
        return replace(
            self,
            **{k: np.where(chosen, getattr(others, k), getattr(self, k)) for k in names},
        )

    def less_sure(self, sigma_m: float) -> Self:
        """One place with another, independent error of this sigma per axis."""
        return replace(self, sigma_m=np.array([hypot(self.sigma_m.item(), sigma_m)]))

    def way_m(self, start_ns: IntArray, end_ns: IntArray) -> FloatArray:
        """Distance between the places at two times, shape (m,)."""
        own_s, start_s, end_s = (self._seconds(t_ns) for t_ns in (self.t_ns, start_ns, end_ns))
        moved_m = [
            np.interp(end_s, own_s, values) - np.interp(start_s, own_s, values)
            for values in (self.x_m, self.y_m)
        ]
        return np.asarray(np.hypot(*moved_m), float)

    def at(self, t_ns: IntArray) -> "Places":
        """Places at times (m,), interpolated between those around each; see `covers`."""
        own_s, t_s = self._seconds(self.t_ns), self._seconds(t_ns)
        x_m, y_m, z_m, sigma_m = (
            np.interp(t_s, own_s, values) for values in (self.x_m, self.y_m, self.z_m, self.sigma_m)
        )
        return Places(x_m, y_m, z_m, sigma_m, t_ns, self.utm)

    def covers(self, t_ns: IntArray) -> BoolArray:
        """Whether a place is near enough in time, shape (m,)."""
        own_s, t_s = self._seconds(self.t_ns), self._seconds(t_ns)
        following = np.searchsorted(own_s, t_s)
        since_s = t_s - own_s[np.maximum(following - 1, 0)]
        until_s = own_s[np.minimum(following, len(own_s) - 1)] - t_s
        is_between = (since_s >= 0) & (until_s >= 0) & (since_s + until_s <= MAX_GAP_S)
        is_beside = np.minimum(np.abs(since_s), np.abs(until_s)) <= MAX_BEYOND_S
        return np.asarray(is_between | is_beside, np.bool_)

    def thin(self, *, again: bool) -> BoolArray:
        """Which of the places are ground not measured before, shape (n,); `again` keeps visits.

        A second visit has the same shadowing, lingering the same fading. A filter takes both for
        new evidence: in simulated worlds (6 dB over 15 to 150 m, four rounds of a square) its 95 %
        ellipse held the truth in 78 to 81 %, and thinned in 90 to 96 %.
        """
        squares: dict[tuple[int, int], list[float]] = {}  # first and last visit, readings of that
        is_new = np.ones(len(self), np.bool_)
        way_m = 0.0
        steps_m = [0.0, *map(hypot, np.diff(self.x_m).tolist(), np.diff(self.y_m).tolist())]
        for k, (x_m, y_m) in enumerate(zip(self.x_m.tolist(), self.y_m.tolist(), strict=True)):
            way_m += steps_m[k]
            key = floor(x_m / _SIDE_M), floor(y_m / _SIDE_M)
            square = squares.setdefault(key, [way_m, way_m, 0])
            if way_m - square[1] > _VISIT_M:
                square[1:] = way_m, 0
            is_visited = way_m - square[0] > _VISIT_M
            is_new[k] = square[2] < _MOST_READINGS and (again or not is_visited)
            square[2] += 1
        return is_new

    def _seconds(self, t_ns: IntArray) -> FloatArray:
        return np.asarray(t_ns - self.t_ns[0], float) / 1e9


@dataclass(frozen=True, slots=True, repr=False)
class Track(Places):
    """The fixes of a run that have a position; `seq` (n,) are the numbers of their records."""

    seq: IntArray = field(kw_only=True)

    _columns: ClassVar[tuple[str, ...]] = ("x_m", "y_m", "z_m", "sigma_m", "t_ns", "seq")

    def at_readings(self, t_ns: IntArray, fix_seq: IntArray) -> Places:
        """As `at`, but a current fix (m,) of exactly that time is used as it is.

        An imported file may have several within one tick of its clock.
        """
        current, has_fix = index_of(self.seq, fix_seq)
        exact = has_fix & (self.t_ns[current] == t_ns)
        return self.at(t_ns).with_others(exact, self.part(current))


def join_places(parts: Sequence[Places]) -> Places:
    """The places of one zone in their order."""
    names = ("x_m", "y_m", "z_m", "sigma_m", "t_ns")
    return Places(
        **{name: np.concatenate([getattr(one, name) for one in parts]) for name in names},
        utm=parts[0].utm,
    )


def track_of(fixes: Rows) -> Track:
    """Track from the table `fixes`, in the zone of the first fix.

    Raises `EstimationError` without a fix and `GeoError` beyond the map.
    """
    has_position = np.isfinite(fixes["lat_deg"]) & np.isfinite(fixes["lon_deg"])
    rows = fixes[(fixes["valid"] == 1) & has_position]
    if not len(rows):
        raise EstimationError("the run has no position fix, so nothing can be located")
    utm = Utm.at(float(rows["lat_deg"][0]), float(rows["lon_deg"][0]))
    rows = rows[np.argsort(rows["t_ns"], kind="stable")]
    x_m, y_m = utm.to_xy_arrays(rows["lat_deg"], rows["lon_deg"])
    z_m = np.asarray(rows["alt_m"], float)
    return Track(x_m, y_m, z_m, _sigma_m(rows), rows["t_ns"], utm, seq=rows["seq"])


def place_of_fix(t_ns: int, fix: Fix, utm: Utm | None = None) -> Places | None:
    """The place of one fix, by default in its own zone; None without one; raises `GeoError`."""
    if not fix.valid or fix.lat_deg is None or fix.lon_deg is None:
        return None
    utm = utm or Utm.at(fix.lat_deg, fix.lon_deg)
    x_m, y_m = utm.to_xy(fix.lat_deg, fix.lon_deg)
    return Places(
        np.array([x_m]),
        np.array([y_m]),
        np.array([np.nan if fix.alt_m is None else fix.alt_m]),
        np.array([fix_sigma_m(fix.acc_m, fix.hdop, fix.quality)]),
        np.array([t_ns]),
        utm,
    )


def fix_sigma_m(acc_m: float | None, hdop: float | None, quality: int | None = None) -> float:
    """Standard deviation per axis of one fix."""
    sigma_m = UNKNOWN_SIGMA_M if hdop is None else hdop * UERE_M
    if acc_m is not None:
        sigma_m = acc_m * SIGMA_OF_RADIUS68
    return hypot(sigma_m, DEAD_RECKONING_SIGMA_M) if quality == DEAD_RECKONING else sigma_m


def _sigma_m(rows: Rows) -> FloatArray:
    """As `fix_sigma_m`, for the table `fixes`."""
    sigma_m = np.where(np.isfinite(rows["hdop"]), rows["hdop"] * UERE_M, UNKNOWN_SIGMA_M)
    sigma_m = np.where(np.isfinite(rows["acc_m"]), rows["acc_m"] * SIGMA_OF_RADIUS68, sigma_m)
    is_reckoned = rows["quality"] == DEAD_RECKONING
    return np.where(is_reckoned, np.hypot(sigma_m, DEAD_RECKONING_SIGMA_M), sigma_m)


def smeared_sigma_m(length_m: npt.ArrayLike) -> FloatArray:
    """Standard deviation per axis of a position somewhere along a way of this length."""
    return np.asarray(np.asarray(length_m, float) / np.sqrt(12.0), float)


def index_of(seqs: IntArray, wanted: IntArray) -> tuple[IntArray, BoolArray]:
    """Index of each wanted number in `seqs`, and whether it is there; (n,) each."""
    order = np.argsort(seqs)
    after = np.searchsorted(seqs, wanted, sorter=order)
    index = order[np.minimum(after, len(seqs) - 1)]
    return index, seqs[index] == wanted
