"""Ground far from other ground: the towns of a survey, and the places of one identity.

Readings are stored in the UTM zone of the first fix of their run. A town has one zone, that of its
middle, in which all its readings are placed: ground on both sides of a border between zones is one
ground, and none of it counts twice. Distances are through the Earth, so that no meridian, equator
or pole is a border.
"""

from collections.abc import Iterable, Mapping
from math import atan2, degrees, hypot
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from logger.core.arrays import FloatArray, IntArray
from logger.core.cell_names import REUSED_M, is_by_channel
from logger.core.places import MAX_LATITUDE_DEG, Utm
from logger.core.readings import Readings
from postproc.multi_run import REACH_M, in_zone

_TILE_M = 5000.0
"""Readings are first taken together in squares of their own zone: a city has some hundred."""
_APART_M = 25_000.0
"""Between two towns: one picture of both would show little but the way between them."""
_LARGEST_M = 300_000.0
"""Of a town: farther from its middle a zone distorts. What is larger is divided."""
_EARTH_M = 6_371_000.0
_OFFSET, _STRIDE = 1 << 19, 1 << 20


class Ground(NamedTuple):
    """Some positions (n,): east and north in a UTM zone each, negative in the south."""

    zone: IntArray
    x_m: FloatArray
    y_m: FloatArray


def place_numbers(lat_deg: FloatArray, lon_deg: FloatArray, apart_m: float) -> IntArray:
    """Number of the place of each position (n,).

    Positions that are nearer than `apart_m` to each other are in one place.
    """
    point_m = _points_m(lat_deg, lon_deg)
    if not len(point_m):
        return np.zeros(0, np.int64)
    pairs = cKDTree(point_m).query_pairs(apart_m, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(point_m),) * 2)
    return np.asarray(connected_components(links, directed=False)[1], np.int64)


def places_of(parts: Mapping[str, Readings]) -> list[dict[str, Readings]]:
    """Readings of one identity by digest of the run, where one transmitter may be heard.

    The place with most readings comes first. Those of a place are in the zone of its first run.
    """
    tile = {digest: _tiles(ground_of(obs)) for digest, obs in parts.items()}
    tiles = np.unique(np.concatenate(list(tile.values()))) if tile else np.zeros(0, np.int64)
    is_reused = any(is_by_channel(obs.cell) for obs in parts.values())
    apart_m = REUSED_M if is_reused else 2.0 * REACH_M
    number = place_numbers(*tile_centres_deg(tiles), apart_m)
    places: list[dict[str, Readings]] = [{} for _ in range(np.max(number, initial=-1) + 1)]
    for digest, obs in parts.items():
        own = number[np.searchsorted(tiles, tile[digest])]
        for place in np.unique(own).tolist():
            whole = bool(np.all(own == place))
            first = next(iter(places[place].values()), obs)
            places[place][digest] = in_zone(obs if whole else obs.part(own == place), first.utm)
    return sorted(places, key=lambda place: -sum(map(len, place.values())))


def ground_of(obs: Readings) -> Ground:
    """Where the readings of a cell are."""
    return Ground(np.full(len(obs), obs.utm.zone), obs.x_m, obs.y_m)


class Towns:
    """The towns of some ground, the largest first; `zones` has the zone of each."""

    def __init__(self, ground: Iterable[Ground]) -> None:
        tiles = [np.unique(_tiles(part)) for part in ground]
        self._tile = np.unique(np.concatenate(tiles)) if tiles else np.zeros(0, np.int64)
        centre_deg = tile_centres_deg(self._tile)
        number = _divide(place_numbers(*centre_deg, _APART_M), _points_m(*centre_deg))
        rank = np.argsort(np.argsort(-np.bincount(number), kind="stable"))
        self._town = rank[number]
        self.zones = tuple(_zone_of(self._tile[self._town == town]) for town in range(len(rank)))

    def place(self, ground: Ground) -> tuple[IntArray, FloatArray, FloatArray]:
        """Number of the town of each position (n,), with east and north in its zone."""
        town = self._town[np.searchsorted(self._tile, _tiles(ground))]
        x_m, y_m = ground.x_m.copy(), ground.y_m.copy()
        target = np.array([utm.zone for utm in self.zones], np.int64)[town]
        ways = np.stack([ground.zone, target])[:, ground.zone != target]
        for zone, to in np.unique(ways, axis=1).T.tolist():
            rows = (ground.zone == zone) & (target == to)
            lat_lon_deg = Utm(zone).to_latlon_arrays(x_m[rows], y_m[rows])
            x_m[rows], y_m[rows] = Utm(to).to_xy_arrays(*lat_lon_deg)
        return town, x_m, y_m


def _tiles(ground: Ground) -> IntArray:
    """Number of the tile of each position (n,)."""
    column = np.floor(ground.x_m / _TILE_M).astype(np.int64) + _OFFSET
    row = np.floor(ground.y_m / _TILE_M).astype(np.int64) + _OFFSET
    return (ground.zone.astype(np.int64) * _STRIDE + column) * _STRIDE + row


def tile_centres_deg(tile: IntArray) -> tuple[FloatArray, FloatArray]:
    """Latitude and longitude of the middle of tiles (n,)."""
    row, column = tile % _STRIDE - _OFFSET, tile // _STRIDE % _STRIDE - _OFFSET
    zone = tile // _STRIDE // _STRIDE
    lat_lon_deg = np.zeros((2, len(tile)))
    for number in np.unique(zone).tolist():
        own = zone == number
        middle_m = ((values[own] + 0.5) * _TILE_M for values in (column, row))
        lat_lon_deg[:, own] = Utm(number).to_latlon_arrays(*middle_m)
    return lat_lon_deg[0], lat_lon_deg[1]


def _points_m(lat_deg: FloatArray, lon_deg: FloatArray) -> FloatArray:
    """On a sphere, shape (n, 3)."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    axes = (np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat))
    return np.asarray(_EARTH_M * np.stack(axes, axis=1), float)


def _divide(number: IntArray, point_m: FloatArray) -> IntArray:
    """Places (n,) of bounded size: those that are larger are cut in their middle."""
    number = number.copy()
    waiting = list(range(int(np.max(number, initial=-1)) + 1))
    while waiting:
        own = np.flatnonzero(number == waiting.pop())
        axis = int(np.argmax(np.ptp(point_m[own], axis=0)))
        along_m = point_m[own, axis]
        if np.ptp(along_m) > _LARGEST_M:
            new = int(np.max(number)) + 1
            number[own[along_m > 0.5 * (along_m.min() + along_m.max())]] = new
            waiting += [int(number[own[np.argmin(along_m)]]), new]
    return number


def _zone_of(tile: IntArray) -> Utm:
    """The zone of a town: that of all its tiles, else of their middle."""
    zones = np.unique(tile // _STRIDE // _STRIDE)
    if len(zones) == 1:
        return Utm(int(zones[0]))
    x, y, z = np.mean(_points_m(*tile_centres_deg(tile)), axis=0).tolist()
    lat_deg = degrees(atan2(z, hypot(x, y)))
    most_deg = MAX_LATITUDE_DEG
    return Utm.at(min(max(lat_deg, -most_deg), most_deg), degrees(atan2(y, x)))
