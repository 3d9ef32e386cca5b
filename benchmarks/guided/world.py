"""Worlds to walk in: streets or open ground, one transmitter or a trap, shadowing by place.

Everything that belongs to a place comes from the seed, so all policies meet the same world. White
noise and errors of the receiver are drawn along the walk.
"""

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.guidance.street_map import StreetMap
from logger.core.model.path_loss import log_distance_db
from logger.core.readings import GSM_CEILING_DBM, GSM_FLOOR_DBM
from logger.sim.world import Shadowing

from .ground import Ground, Node, OpenGround, Streets, Way

SPEED_MPS = 1.3
NEAREST_M, FARTHEST_M = 50.0, 800.0
"""Distance of the transmitter from the start."""
HEIGHT_M = 8.0
_GPS_M, _GPS_S = 3.0, 60.0
"""Standard deviation of a fix per axis and how long an error lasts."""
_SCAN_S = (2.0, 5.0)
_HEARD_DBM = (-95.0, -70.0)
"""Mean level at the start: that is why somebody walks."""
_FINE_ABOVE_DBM = -70.0
"""Above it the modem reports steps of 2 dB, below of 1 dB."""
_STREETS = 41
_BLOCK_M = (80.0, 120.0)
_MISSING, _DIAGONAL = 0.15, 0.06
"""Shares of the blocks of irregular streets: without a street, and with a street across."""


class Noise(NamedTuple):
    """White noise in dB, and shadowing as (dB, decorrelation distance in m)."""

    white_db: float
    shadowing: tuple[tuple[float, float], ...] = ()


NOISES = MappingProxyType(
    {
        "white": Noise(3.0),
        "6 dB/15 m": Noise(2.0, ((6.0, 15.0),)),
        "8 dB/50 m": Noise(2.0, ((8.0, 50.0),)),
        # three quarters of the variance of 7 dB over 300 m, as measured walks have it
        "300 m": Noise(1.6, ((6.1, 300.0), (3.1, 15.0))),
    }
)
GROUNDS = ("open", "streets", "irregular")
TRAPS = ("", "two", "moving")
LONGEST_M = 3000.0


@dataclass
class World:
    """One world: `emitter_m` (k, 2) are the transmitters at the start of the walk."""

    seed: int
    noise: str
    ground: str
    trap: str = ""
    nearest_m: float = NEAREST_M
    farthest_m: float = FARTHEST_M
    trap_speed_mps: float = 0.5
    longest_m: ClassVar[float] = LONGEST_M
    rat: ClassVar[str] = "GSM"
    slack_m: ClassVar[float] = 0.0
    streets: StreetMap | None = field(init=False, default=None)
    emitter_m: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng([self.seed, 77])
        kind = NOISES[self.noise]
        self._white_db = kind.white_db
        self._eta = float(np.clip(rng.normal(rng.uniform(2.6, 3.0), 0.5), 1.7, 4.2))
        if self.ground != "open":
            lines = _street_lines(rng, is_irregular=self.ground == "irregular")
            self.streets = StreetMap(lines)
        away_m, angle = rng.uniform(self.nearest_m, self.farthest_m), rng.uniform(0, 2 * np.pi)
        emitters = [away_m * np.array([np.sin(angle), np.cos(angle)])]
        heard_db = 10.0 * self._eta * np.log10(np.hypot(away_m, HEIGHT_M))
        self._p0_dbm = rng.uniform(*_HEARD_DBM) + heard_db
        if self.trap == "two":
            other_m = rng.uniform(150.0, self.farthest_m)
            angle += rng.uniform(0.5, 1.5) * np.pi
            emitters.append(other_m * np.array([np.sin(angle), np.cos(angle)]))
        self.emitter_m = np.array(emitters)
        course = rng.uniform(0, 2 * np.pi)
        speed_mps = self.trap_speed_mps if self.trap == "moving" else 0.0
        self._velocity_mps = speed_mps * np.array([np.sin(course), np.cos(course)])
        self._fields = [
            [Shadowing.draw(sigma_db, apart_m, rng) for sigma_db, apart_m in kind.shadowing]
            for _ in emitters
        ]
        self._rng = np.random.default_rng([self.seed, 99])
        self._gps_m = np.zeros(2)
        self._until_scan_m = 0.0
        self.walked_m = 0.0

    def emitters_now(self) -> FloatArray:
        """Transmitters (k, 2) at the walker's time."""
        return self.emitter_m + self._velocity_mps * (self.walked_m / SPEED_MPS)

    def crossings(self) -> Ground:
        """Where one can walk."""
        return Streets(self.streets) if self.streets else OpenGround()

    def street_lines_m(self) -> list[FloatArray]:
        """The streets of a map, none on open ground."""
        return [leg.line_m for leg in self.streets.legs] if self.streets else []

    def levels_dbm(self, point_m: FloatArray, walked_m: FloatArray) -> FloatArray:
        """What the modem reports at points (n, 2) after so many metres."""
        moved_m = np.outer(walked_m / SPEED_MPS, self._velocity_mps)
        best = np.full(len(point_m), -np.inf)
        for emitter, fields in zip(self.emitter_m, self._fields, strict=True):
            east_m, north_m = (point_m - emitter - moved_m).T
            level = self._p0_dbm - self._eta * log_distance_db(east_m, north_m, HEIGHT_M)
            for one in fields:
                level = level + one.at_db(*point_m.T)
            best = np.maximum(best, level)
        level = best + self._rng.normal(0.0, self._white_db, len(best))
        step = np.where(level > _FINE_ABOVE_DBM, 2.0, 1.0)
        return np.clip(step * np.round(level / step), GSM_FLOOR_DBM, GSM_CEILING_DBM)

    def stand(self, here_m: FloatArray) -> FloatArray:
        """A reading at one place, as `walk`."""
        return self._along(np.stack([here_m, here_m + 1e-3]))

    def walk(self, _node: Node, way: Way) -> FloatArray:
        """Readings on a way: rows t_s, x, y by the receiver, level; shape (n, 4)."""
        return self._along(way.line_m)

    def _along(self, line_m: FloatArray) -> FloatArray:
        along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line_m, axis=0).T))])
        at_m = []
        while self._until_scan_m < along_m[-1]:
            at_m.append(self._until_scan_m)
            self._until_scan_m += SPEED_MPS * self._rng.uniform(*_SCAN_S)
        self._until_scan_m -= along_m[-1]
        point_m = np.stack([np.interp(at_m, along_m, v) for v in line_m.T], axis=1)
        walked_m = self.walked_m + np.array(at_m)
        level_dbm = self.levels_dbm(point_m, walked_m)
        self.walked_m += float(along_m[-1])
        seen_m = point_m + self._gps_errors(walked_m)
        return np.column_stack([walked_m / SPEED_MPS, seen_m, level_dbm])

    def _gps_errors(self, walked_m: FloatArray) -> FloatArray:
        """Errors (n, 2) of the receiver that last for a minute (first-order Gauss-Markov)."""
        errors = np.empty((len(walked_m), 2))
        kept = np.exp(-np.mean(_SCAN_S) / _GPS_S)
        for k in range(len(walked_m)):
            drawn = self._rng.standard_normal(2)
            self._gps_m = kept * self._gps_m + np.sqrt(1.0 - kept**2) * _GPS_M * drawn
            errors[k] = self._gps_m
        return errors


def _street_lines(rng: np.random.Generator, *, is_irregular: bool) -> list[FloatArray]:
    """Streets of a town around the origin, block by block."""
    x_m, y_m = (_street_distances_m(rng) for _ in range(2))
    node = np.stack(np.meshgrid(x_m, y_m, indexing="ij"), axis=-1)
    if not is_irregular:
        return [*node, *node.transpose(1, 0, 2)]
    node = node + rng.uniform(-25.0, 25.0, node.shape)
    lines = []
    for i in range(_STREETS):
        for j in range(_STREETS):
            here = node[i, j]
            if i + 1 < _STREETS and rng.random() > _MISSING:
                lines.append(np.stack([here, node[i + 1, j]]))
            if j + 1 < _STREETS and rng.random() > _MISSING:
                lines.append(np.stack([here, node[i, j + 1]]))
            if max(i, j) + 1 < _STREETS and rng.random() < _DIAGONAL:
                lines.append(np.stack([here, node[i + 1, j + 1]]))
    return lines


def _street_distances_m(rng: np.random.Generator) -> FloatArray:
    at_m = np.concatenate([[0.0], np.cumsum(rng.uniform(*_BLOCK_M, _STREETS - 1))])
    return np.asarray(at_m - at_m[_STREETS // 2], float)
