"""Searches in simulated cities: a walker goes where the phone's arrow points.

The whole way of the product, without ports: scans of a modem with a card, the rules of suspicion,
the choice of the target, the live estimate, the advice.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.types import CellReading, Fix, Note, Record, Scan
from logger.device.live_view import LiveView, live_view
from logger.sim.city import CITIES, Place, city, with_lists
from logger.sim.receiver import GnssNoise
from logger.sim.scenario import SCENARIOS
from logger.sim.walk import GuidedWalk
from logger.sim.world import Air, Radio, ReceivedCell, Transmitter, World

from .world import FARTHEST_M, LONGEST_M, NEAREST_M, SPEED_MPS

LONGEST_S = 240.0 + LONGEST_M / SPEED_MPS
_POLL_S = 4.0
_DECODED_DBM = -104.0
_ON_AIR_S = 240.0
"""When the rogue is switched on: the walk has heard its surroundings before."""
_OFF_DBM = -130.0


class Search(NamedTuple):
    """How a search ended; times in seconds from its begin, None for what did not happen.

    `led_s` is how long an arrow led to a cell that is no rogue, `changes` how often the target was
    another one.
    """

    city: str
    seed: int
    has_rogue: bool
    start_m: float | None
    named_s: float | None
    located_s: float | None
    error_m: float | None
    changes: int
    led_s: float
    walked_s: float


def search(
    seed: int, *, has_rogue: bool, radio: Radio = SCENARIOS["block"], longest_s: float = LONGEST_S
) -> Search:
    """One search in a city that the seed draws; it ends where the rogue is located."""
    rng = np.random.default_rng([seed, 79])
    name = list(CITIES)[seed % len(CITIES)]
    place = CITIES[name]
    cells = with_lists(city(rng, place).cells)
    rogue = _moved(place, rng) if has_rogue else None
    if rogue is not None:
        cells = (rogue, *cells)
    world = World.build(cells, place.lat_deg, place.lon_deg, radio, rng)
    walker = _Walker(world, place, rng, has_rogue=has_rogue)
    cell = rogue and f"{rogue.mcc}-{rogue.mnc}-{rogue.lac}-{rogue.cid}"
    named_s = located_s = error_m = None
    led_s, t_s = 0.0, 0.0
    while t_s < longest_s and located_s is None:
        view = walker.step(t_s)
        target = view.target and view.target.cell
        led_s += view.next is not None and target != cell
        if cell and named_s is None and view.suspicions and view.suspicions[0].cell == cell:
            named_s = t_s if view.suspicions[0].word == "suspicious" else None
        position = view.position
        if cell and position and position.cell == cell and position.verdict == "located":
            located_s = t_s
            east_m, north_m = walker.world.to_local(position.lat, position.lon)
            error_m = float(np.hypot(east_m - cells[0].east_m, north_m - cells[0].north_m))
        t_s += 1.0
    start = np.asarray(place.walk[0])
    start_m = rogue and float(np.hypot(*(start - [rogue.east_m, rogue.north_m])))
    return Search(
        name, seed, has_rogue, start_m, named_s, located_s, error_m, walker.changes, led_s, t_s
    )


def _moved(place: Place, rng: np.random.Generator) -> Transmitter:
    """The rogue of a city, as far from the start as the worlds of `guided.world` have it."""
    away_m, angle = rng.uniform(NEAREST_M, FARTHEST_M), rng.uniform(0.0, 2.0 * np.pi)
    start_m = np.asarray(place.walk[0])
    east_m, north_m = start_m + away_m * np.array([np.sin(angle), np.cos(angle)])
    return replace(place.rogue, east_m=float(east_m), north_m=float(north_m))


class _Walker:
    """The tracker, and who walks with it."""

    def __init__(
        self, world: World, place: Place, rng: np.random.Generator, *, has_rogue: bool
    ) -> None:
        self.world = world
        self._rng = rng
        self._tracker = LiveTracker(LiveSettings())
        self._view = LiveView()
        self._walk = GuidedWalk(place.walk, self._goal)
        self._noise = GnssNoise()
        self._error_m = rng.normal(0.0, self._noise.wander_sigma_m, 2)
        self._has_rogue = has_rogue
        self._seq = 0
        self._scan_s = 0.0
        self.changes = 0

    def step(self, t_s: float) -> LiveView:
        """A second of the walk."""
        here_m = np.array(self._walk.position(t_s))
        kept = float(np.exp(-1.0 / self._noise.wander_time_s))
        drawn = self._rng.normal(0.0, self._noise.wander_sigma_m, 2)
        self._error_m = kept * self._error_m + np.sqrt(1.0 - kept**2) * drawn
        lat_deg, lon_deg = self.world.to_latlon(*(here_m + self._error_m))
        self._feed(t_s, "gnss", Fix(True, lat_deg=lat_deg, lon_deg=lon_deg, hdop=0.9))
        if t_s >= self._scan_s:
            self._scan_s += _POLL_S
            scan = self._scan(t_s, here_m)
            self._feed(t_s, "modem", scan)
            self._view = live_view(self._tracker)
        return self._view

    def _feed(self, t_s: float, source: str, value: Fix | Scan) -> None:
        for found in self._tracker.feed(self._seq, Record(round(t_s * 1e9), source, value)):
            self.changes += isinstance(found, Note) and found.code == "target-changed"
        self._seq += 1

    def _scan(self, t_s: float, here_m: FloatArray) -> Scan:
        levels_dbm = self.world.received_dbm(here_m[:1], here_m[1:], self._rng)[:, 0].tolist()
        if self._has_rogue and t_s < _ON_AIR_S:
            levels_dbm[0] = _OFF_DBM
        air = Air.of(
            [
                ReceivedCell(cell, level_dbm, is_decoded=level_dbm >= _DECODED_DBM)
                for cell, level_dbm in zip(self.world.transmitters, levels_dbm, strict=True)
            ]
        )
        if air.serving is None:
            return Scan(round(t_s * 1e9), ())
        readings = [_reading(air.serving, "serving")]
        readings += [_reading(one, "neighbour") for one in air.decoded_neighbours]
        return Scan(round(t_s * 1e9), tuple(readings))

    def _goal(self) -> FloatArray | None:
        goal = self._view.goal
        return None if goal is None else np.array(self.world.to_local(goal.lat, goal.lon))


def _reading(one: ReceivedCell, role: str) -> CellReading:
    """A cell as a modem prints it."""
    cell = one.cell
    return CellReading(
        role, "GSM", cell.mcc, cell.mnc, cell.lac, cell.cid, cell.arfcn, bsic=cell.bsic,  # type: ignore[arg-type]
        rssi_dbm=float(one.dbm), c1=one.c1, c2=one.c2, broadcast=cell.broadcast,
    )  # fmt: skip
