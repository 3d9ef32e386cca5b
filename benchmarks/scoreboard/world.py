"""A walk with a known transmitter, simulated or measured: input of each method and the truth."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from logger.core.arrays import FloatArray

try:
    from logger.core.places import Places, Utm
    from logger.core.readings import Readings
except ImportError:  # in an older tree only measured walks are read
    from logger.core.geo import Utm

Place = tuple[float, float]

_ZONE = Utm(32)

NOISE_OF_MEASURED_WALKS_DB = 5.4
"""Median residual of 464 measured walks."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of the levels of a simulated world, known to the exact posterior only.

    White noise `white_db`, shadowing `shadow_db` with correlation exp(-D / `decorrelation_m`),
    where D is the distance of two readings along the path or (`in_plane`) straight across, and
    rounding to `step_db`. Of the variance of the shadowing the share `long_share` is correlated
    over `long_m` instead.
    """

    white_db: float
    shadow_db: float = 0.0
    decorrelation_m: float = 15.0
    in_plane: bool = False
    step_db: float = 0.0
    long_share: float = 0.0
    long_m: float = 300.0

    @property
    def white_variance_db2(self) -> float:
        """Variance of white noise and rounding."""
        return self.white_db**2 + self.step_db**2 / 12.0

    @property
    def total_db(self) -> float:
        """Standard deviation of one level."""
        return float(np.sqrt(self.white_variance_db2 + self.shadow_db**2))

    def shadowing_db2(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Covariance of the shadowing at places of shape (n,), shape (n, n)."""
        if self.in_plane:
            apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
        else:
            along_m = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x_m), np.diff(y_m)))])
            apart_m = np.abs(along_m[:, None] - along_m)
        near, far = np.exp(-apart_m / self.decorrelation_m), np.exp(-apart_m / self.long_m)
        correlation = (1.0 - self.long_share) * near + self.long_share * far
        return np.asarray(self.shadow_db**2 * correlation, float)

    def covariance_db2(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Covariance of the levels, shape (n, n)."""
        return self.shadowing_db2(x_m, y_m) + self.white_variance_db2 * np.eye(len(x_m))


@dataclass(frozen=True, slots=True)
class Walk:
    """Readings along a walk, shape (n,): where the receiver was, and the level."""

    x_m: FloatArray
    y_m: FloatArray
    level_dbm: FloatArray

    def __len__(self) -> int:
        return len(self.x_m)

    def transform(self, turn: FloatArray, shift_m: Place) -> "Walk":
        """Turned about the origin by a (2, 2) rotation, then shifted."""
        x_m, y_m = turn @ np.vstack([self.x_m, self.y_m])
        return replace(self, x_m=x_m + shift_m[0], y_m=y_m + shift_m[1])


@dataclass(frozen=True, slots=True)
class World:
    """One walk with a known answer; places are (x, y) in metres.

    `walk` is the recorded walk, `whole` the same without errors of the receiver's position and
    without censoring, as the exact limit uses it. `sources` has one position, or two if two
    transmitters share an identity; `mirror` is another position that fits equally well. `eta` and
    `noise` are None where they are unknown. `position_sigma_m`, scalar or of shape (n,), is the
    standard deviation of the receiver's position per axis, `slack_m` the error of the survey.
    `t_s` has the shape (n,), or is None for a reading every second. `published_scores` are errors
    that others have reached, by method. A measured walk has a `name`.
    """

    walk: Walk
    whole: Walk
    sources: tuple[Place, ...]
    eta: float | None = None
    noise: Noise | None = None
    mirror: Place | None = None
    position_sigma_m: float | FloatArray = 0.0
    floor_dbm: float | None = None
    slack_m: float = 0.0
    t_s: FloatArray | None = None
    utm: Utm = _ZONE
    published_scores: Mapping[str, float] = field(default_factory=dict)
    name: str = ""

    @property
    def noise_db(self) -> float:
        """Noise that the filters know."""
        return self.noise.total_db if self.noise else NOISE_OF_MEASURED_WALKS_DB

    def error_m(self, place: Place) -> float:
        """Distance of a place to the nearest source."""
        return float(min(np.hypot(place[0] - x_m, place[1] - y_m) for x_m, y_m in self.sources))

    def transform(self, turn: FloatArray, shift_m: Place) -> "World":
        """Turned about the origin, then shifted: nothing that is true of it changes."""

        def place(at: Place) -> Place:
            x_m, y_m = turn @ at
            return float(x_m) + shift_m[0], float(y_m) + shift_m[1]

        return replace(
            self,
            walk=self.walk.transform(turn, shift_m),
            whole=self.whole.transform(turn, shift_m),
            sources=tuple(place(source) for source in self.sources),
            mirror=place(self.mirror) if self.mirror else None,
        )


def observations(world: World, walk: Walk) -> "Readings":
    """A walk of a world as the locator wants it."""
    count = len(walk)
    t_s = np.arange(count, dtype=float) if world.t_s is None else world.t_s
    return Readings(
        "cell",
        "GSM" if world.floor_dbm is not None else None,
        Places.of(
            walk.x_m,
            walk.y_m,
            utm=world.utm,
            sigma_m=np.broadcast_to(world.position_sigma_m, (count,)).astype(float),
            t_ns=np.asarray(np.round(t_s * 1e9), np.int64),
        ),
        walk.level_dbm,
        np.arange(count),
    )
