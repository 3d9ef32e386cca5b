"""Searches in simulated cities: a walker goes where the phone's arrow points.

The whole way of the product, without ports: scans of a modem with a card, the rules of suspicion,
the choice of the target, the live estimate, the advice.
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.live import LiveTracker
from logger.core.live_settings import FOLLOW, LiveSettings
from logger.core.types import CellReading, Fix, Note, Record, Role, Scan
from logger.device.live_view import LiveView, live_view
from logger.sim.devices import GnssNoise
from logger.sim.scenario import CITIES, SCENARIOS, Place, city, with_lists
from logger.sim.walk import GuidedWalk
from logger.sim.world import Air, Radio, ReceivedCell, World

from .world import FARTHEST_M, LONGEST_M, NEAREST_M, SPEED_MPS

LONGEST_S = LONGEST_M / SPEED_MPS
_POLL_S = 4.0
_DECODED_DBM = -104.0
_ON_AIR_S = 240.0
"""When the rogue is switched on near the walker, who has heard the surroundings before."""
_OFF_DBM = -130.0


class Search(NamedTuple):
    """How a search ended; times in seconds from its begin, None for what did not happen.

    `start_m` is how far off the rogue was switched on, `changes` how often another cell became the
    target. An arrow led to a cell that is no rogue for `led_s` by itself, and for `chosen_s` after
    the walker had chosen that cell for its word.
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
    chosen_s: float
    walked_s: float


def search(
    seed: int, *, has_rogue: bool, radio: Radio = SCENARIOS["block"], longest_s: float = LONGEST_S
) -> Search:
    """One search in a city that the seed draws; it ends where the rogue is located.

    The walker follows the arrow, and takes an unusual cell that is offered where there is none.
    """
    rng = np.random.default_rng([seed, 79])
    name = list(CITIES)[seed % len(CITIES)]
    place = CITIES[name]
    cells = with_lists(city(rng, place))
    if has_rogue:
        cells = (place.rogue, *cells)
    world = World.build(cells, place.lat_deg, place.lon_deg, radio, rng)
    walker = _Walker(world, place, rng, has_rogue=has_rogue)
    cell = place.rogue.name if has_rogue else None
    named_s = located_s = error_m = None
    led_s, chosen_s, t_s = 0.0, 0.0, 0.0
    end_s = longest_s + _ON_AIR_S if has_rogue else longest_s
    while t_s < end_s and located_s is None:
        view = walker.step(t_s)
        if view.next is not None and view.target is not None and view.target.cell != cell:
            if view.target.cell == walker.chosen:
                chosen_s += 1.0
            else:
                led_s += 1.0
        if cell and named_s is None:
            words = {one.cell: one.word for one in view.suspicions}
            named_s = t_s if words.get(cell) == "suspicious" else None
        position = view.position
        if cell and position and position.cell == cell and position.verdict == "located":
            located_s = t_s
            error_m = walker.away_m(walker.world.to_local(position.lat, position.lon))
        t_s += 1.0
    return Search(
        name,
        seed,
        has_rogue,
        walker.start_m,
        named_s,
        located_s,
        error_m,
        walker.changes,
        led_s,
        chosen_s,
        t_s,
    )


def print_searches(first: int, n: int, log: Path | None = None) -> None:
    """Follow the arrow through cities with a rogue, and through clean ones."""
    for has_rogue in (True, False):
        each = []
        for seed in range(first, first + n):
            each.append(search(seed, has_rogue=has_rogue))
            if log is not None:
                with log.open("a") as file:
                    print(json.dumps(each[-1]._asdict()), file=file)
        led_min = max(one.led_s for one in each) / 60.0
        chosen_min = max(one.chosen_s for one in each) / 60.0
        chosen = sum(one.chosen_s > 0.0 for one in each)
        print(
            f"{'rogue' if has_rogue else 'clean'}: led elsewhere for {led_min:.1f} min at most; "
            f"{chosen} of {n} chose a cell for its word, for {chosen_min:.1f} min at most"
        )
        if has_rogue:
            found = [one for one in each if one.located_s is not None]
            worst_m = max((one.error_m or 0.0 for one in found), default=0.0)
            changes = max(one.changes for one in each)
            print(
                f"located {len(found)} of {n}, at most {worst_m:.0f} m off; changes of target: "
                f"at most {changes}"
            )


class _Walker:
    """The tracker, and who walks with it."""

    def __init__(
        self, world: World, place: Place, rng: np.random.Generator, *, has_rogue: bool
    ) -> None:
        self.world = world
        self._rng = rng
        self._tracker = LiveTracker(LiveSettings())
        self._view = LiveView()
        self._walk = GuidedWalk(place.walk, world, lambda: self._view.goal)
        self._noise = GnssNoise()
        self._error_m = rng.normal(0.0, self._noise.wander_sigma_m, 2)
        self._has_rogue = has_rogue
        self._seq = 0
        self._scan_s = 0.0
        self.changes = 0
        self.chosen = ""
        self.start_m: float | None = None

    def away_m(self, place_m: Sequence[float] | FloatArray) -> float:
        """From the rogue."""
        rogue = self.world.transmitters[0]
        return float(np.hypot(*(np.asarray(place_m) - [rogue.east_m, rogue.north_m])))

    def step(self, t_s: float) -> LiveView:
        """A second of the walk."""
        here_m = np.array(self._walk.position(t_s))
        if self._has_rogue and t_s == _ON_AIR_S:
            self._place_rogue(here_m)
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
            self._choose(t_s)
        return self._view

    def _place_rogue(self, here_m: FloatArray) -> None:
        """Put the rogue as far from here as the worlds of `guided.world` have a transmitter."""
        self.start_m, angle = self._rng.uniform([NEAREST_M, 0.0], [FARTHEST_M, 2.0 * np.pi])
        east_m, north_m = here_m + self.start_m * np.array([np.sin(angle), np.cos(angle)])
        rogue, *cells = self.world.transmitters
        rogue = replace(rogue, east_m=float(east_m), north_m=float(north_m))
        self.world = replace(self.world, transmitters=(rogue, *cells))

    def _choose(self, t_s: float) -> None:
        """Take the cell that is offered, if it has a word, where nothing leads on."""
        view = self._view
        words = {one.cell for one in view.suspicions}
        if view.target is not None and view.target.over and view.offer in words:
            self.chosen = str(view.offer)
            self._feed(t_s, "page", Note("info", FOLLOW, self.chosen))

    def _feed(self, t_s: float, source: str, value: Fix | Scan | Note) -> None:
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


def _reading(one: ReceivedCell, role: Role) -> CellReading:
    """A cell as a modem prints it."""
    cell = one.cell
    return CellReading(
        role, "GSM", cell.mcc, cell.mnc, cell.lac, cell.cid, cell.arfcn, bsic=cell.bsic,
        rssi_dbm=float(one.dbm), c1=one.c1, c2=one.c2, broadcast=cell.broadcast,
    )  # fmt: skip
