"""Named walks through named worlds and through cities, each of them decided by a seed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from math import hypot
from types import MappingProxyType

import numpy as np

from logger.core.types import Broadcast
from logger.sim.devices import SimulatedModem, SimulatedReceiver
from logger.sim.dialects import SIM800, Dialect
from logger.sim.walk import Walk, Waypoints
from logger.sim.world import Radio, Transmitter, World

# Cities have 40 GSM cells of three networks, with what makes legitimate cells look unusual.
# Each network has two location areas that meet in the middle. Between the rooftops are a cell of
# the railway, an indoor cell with an area of its own, a cell that two networks share, and a new
# cell. Positions, powers and channels are drawn; the networks are real.

HALF_M = 1300.0
"""Half of the side of the square of the rooftops; the walk is inside of half of it."""
_RAILWAY_AREA = 6001
_ROOFTOPS = 12
_APART_M = 350.0
_MOST_TRIES = 2000


@dataclass(frozen=True, slots=True)
class Place:
    """Where a city is, and its networks.

    `operators` have country and network code, first area code and first channel, `railway` its
    codes and channel. `walk` is the walk through it, `rogue` what a scenario adds to it: the first
    network's code with an area that it does not have, on a channel of the second, without
    neighbours and with the largest offset but one.
    """

    lat_deg: float
    lon_deg: float
    operators: tuple[tuple[str, str, int, int], ...]
    railway: tuple[str, str, int]
    walk: Waypoints
    rogue: Transmitter


_BROADCAST = Broadcast((), cro_db=60, penalty_time=0, t3212_raw=1)
GRAZ = Place(
    47.0707, 15.4395,
    operators=(("232", "01", 1201, 2), ("232", "03", 4301, 42), ("232", "05", 9101, 82)),
    railway=("232", "91", 960),
    walk=(
        (-600.0, -400.0), (-600.0, 100.0), (-150.0, 100.0), (-150.0, 420.0), (300.0, 420.0),
        (300.0, -80.0), (650.0, -80.0), (650.0, 300.0), (420.0, 300.0), (420.0, -420.0),
        (-80.0, -420.0), (-80.0, -150.0), (-420.0, -150.0),
    ),
    rogue=Transmitter(
        180.0, 445.0, p0_dbm=-5.0, eta=3.2, mcc="232", mnc="01", lac=7777, cid=4660, arfcn=63,
        bsic=44, broadcast=_BROADCAST,
    ),
)  # fmt: skip
LEIPZIG = Place(
    51.3400, 12.3747,
    operators=(("262", "01", 5101, 2), ("262", "02", 1501, 42), ("262", "03", 3301, 82)),
    railway=("262", "10", 960),
    walk=(
        (500.0, 480.0), (500.0, 120.0), (140.0, 120.0), (140.0, 520.0), (-260.0, 520.0),
        (-260.0, 60.0), (-640.0, 60.0), (-640.0, -340.0), (-180.0, -340.0), (-180.0, -90.0),
        (260.0, -90.0), (260.0, -560.0), (610.0, -560.0),
    ),
    rogue=Transmitter(
        -420.0, -200.0, p0_dbm=-5.0, eta=3.2, mcc="262", mnc="01", lac=7777, cid=4660, arfcn=63,
        bsic=44, broadcast=_BROADCAST,
    ),
)  # fmt: skip
BRNO = Place(
    49.1951, 16.6068,
    operators=(("230", "01", 2201, 2), ("230", "02", 6301, 42), ("230", "03", 8401, 82)),
    railway=("230", "98", 960),
    walk=(
        (-520.0, 560.0), (-90.0, 560.0), (-90.0, 210.0), (330.0, 210.0), (330.0, 600.0),
        (640.0, 600.0), (640.0, -60.0), (180.0, -60.0), (180.0, -480.0), (-340.0, -480.0),
        (-340.0, -20.0), (-620.0, -20.0), (-620.0, -500.0),
    ),
    rogue=Transmitter(
        430.0, 330.0, p0_dbm=-5.0, eta=3.2, mcc="230", mnc="01", lac=7777, cid=4660, arfcn=63,
        bsic=44, broadcast=_BROADCAST,
    ),
)  # fmt: skip
CITIES: Mapping[str, Place] = MappingProxyType({"graz": GRAZ, "leipzig": LEIPZIG, "brno": BRNO})


def city(rng: np.random.Generator, place: Place = GRAZ) -> tuple[Transmitter, ...]:
    """Draw the cells of a clean city; the last one is switched on during the walk."""
    operators = place.operators
    cells: list[Transmitter] = []
    for k, (mcc, mnc, area, arfcn) in enumerate(operators):
        channels = rng.permutation(np.arange(arfcn, arfcn + 36, 3))
        for i, (east_m, north_m) in enumerate(_rooftops(rng)):
            lac = area + (east_m > 0.0)
            where = float(east_m), float(north_m), *_power(rng)
            cid = 10_000 * (k + 1) + 10 * i + int(rng.integers(1, 4))
            bsic = 8 * (k + 1) + int(rng.integers(0, 8))
            cells.append(
                Transmitter(
                    *where, mcc, mnc, lac, cid, int(channels[i]), bsic, height_m=_height_m(rng)
                )
            )
    mcc, mnc, area, arfcn = operators[0]
    shared, new = cells[_ROOFTOPS], cells[2 * _ROOFTOPS - 1]
    railway = _beside(rng, 900.0)
    cells += [
        Transmitter(*railway, *_power(rng), *place.railway[:2], _RAILWAY_AREA, 71,
                    place.railway[2], 20, height_m=20.0),
        Transmitter(*_beside(rng, 500.0), -38.0, 3.0, mcc, mnc, 1299, 19_999, 38, 9, height_m=4.0),
        Transmitter(
            shared.east_m, shared.north_m, shared.p0_dbm, shared.eta, *operators[2][:2],
            operators[2][2], 39_001,
            118, 27, height_m=shared.height_m,
        ),
        Transmitter(
            *_beside(rng, 700.0), *_power(rng), new.mcc, new.mnc, new.lac, 29_001, 79, 18,
            height_m=_height_m(rng),
        ),
    ]  # fmt: skip
    return tuple(cells)


def with_lists(cells: Sequence[Transmitter]) -> tuple[Transmitter, ...]:
    """The cells, each of which lists the channels of its own network."""
    channels: dict[tuple[str, str], list[int]] = {}
    for cell in cells:
        channels.setdefault((cell.mcc, cell.mnc), []).append(cell.arfcn)
    return tuple(
        replace(cell, broadcast=_broadcast(sorted(a for a in own if a != cell.arfcn)))
        for cell, own in ((cell, channels[cell.mcc, cell.mnc]) for cell in cells)
    )


def _rooftops(rng: np.random.Generator) -> list[tuple[float, float]]:
    sites: list[tuple[float, float]] = []
    for _ in range(_MOST_TRIES):
        east_m, north_m = rng.uniform(-HALF_M, HALF_M, 2)
        if all(hypot(east_m - x, north_m - y) >= _APART_M for x, y in sites):
            sites.append((float(east_m), float(north_m)))
        if len(sites) == _ROOFTOPS:
            break
    return sites


def _power(rng: np.random.Generator) -> tuple[float, float]:
    return float(rng.uniform(-12.0, -4.0)), float(rng.uniform(2.9, 3.3))


def _height_m(rng: np.random.Generator) -> float:
    return float(rng.uniform(20.0, 40.0))


def _beside(rng: np.random.Generator, reach_m: float) -> tuple[float, float]:
    east_m, north_m = rng.uniform(-reach_m, reach_m, 2)
    return float(east_m), float(north_m)


# --- scenarios ---

DEFAULT = "block"
ORIGIN_LAT_DEG, ORIGIN_LON_DEG = 46.9480, 7.4474
UTC_START = datetime(2024, 5, 14, 9, 0, tzinfo=UTC)
COLD_START_S = 30.0
APART_DB = 9.0
"""Between two modems: 3GPP TS 45.008 8.1.2 allows each an error of 6 dB."""

# A small transmitter between the streets that the walk takes, and rooftop cells around them. 001-01
# is the test network of ITU-T E.212.
ROGUE = Transmitter(
    130.0,
    100.0,
    p0_dbm=-15.0,
    eta=3.0,
    mcc="001",
    mnc="01",
    lac=0x7D01,
    cid=0x1A2B,
    arfcn=54,
    bsic=9,
)
CELLS = (
    Transmitter(
        -150.0, 120.0, -10.0, 3.0, "001", "01", 0x0113, 0x4E72, arfcn=21, bsic=8, height_m=25.0
    ),
    Transmitter(
        330.0, 290.0, -12.0, 3.1, "001", "01", 0x0113, 0xA53F, arfcn=37, bsic=25, height_m=30.0
    ),
    Transmitter(
        420.0, -220.0, -8.0, 3.0, "001", "01", 0x0113, 0x4E71, arfcn=80, bsic=20, height_m=22.0
    ),
    Transmitter(
        -330.0, -420.0, -5.0, 2.9, "001", "01", 0x0114, 0x5E58, arfcn=86, bsic=40, height_m=35.0
    ),
    Transmitter(
        60.0, 930.0, -6.0, 3.0, "001", "01", 0x0114, 0x4F2F, arfcn=11, bsic=62, height_m=40.0
    ),
)
BLOCK = (
    (-120.0, -100.0), (-120.0, 80.0), (110.0, 80.0), (110.0, 200.0), (-40.0, 200.0),
    (-40.0, 330.0), (330.0, 330.0), (330.0, 118.0), (150.0, 118.0),
    (150.0, -90.0), (330.0, -90.0), (330.0, 20.0), (-20.0, 20.0),
)  # fmt: skip


T3212 = 10
"""Periodic update once an hour."""


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """All that a simulated walk needs; the same seed gives the same walk to the last digit."""

    name: str
    world: World
    walk: Walk
    seed: int
    utc_start: datetime
    duration_s: float
    target: Transmitter

    def streets_deg(self) -> tuple[tuple[tuple[float, float], ...], ...]:
        """Streets of the world, latitude and longitude of their ends: they bound its blocks.

        They are those of the walk, from one edge of the quarter to the other.
        """
        return tuple(
            tuple(self.world.to_latlon(*end_m) for end_m in street) for street in self.walk.streets
        )

    def modem(
        self, now_s: Callable[[], float], dialect: Dialect = SIM800, number: int = 0
    ) -> SimulatedModem:
        """A modem on the walk; `now_s` is the time of the walk.

        Each `number` has noise of its own and reads `APART_DB` lower than the one before.
        """
        rng = np.random.default_rng([self.seed, 1, number] if number else [self.seed, 1])
        return SimulatedModem(
            dialect,
            self.world,
            self.walk,
            now_s,
            rng,
            utc_start=self.utc_start,
            above_db=-APART_DB * number,
        )

    def receiver(self, cold_start_s: float = COLD_START_S) -> SimulatedReceiver:
        """The receiver that is carried."""
        rng = np.random.default_rng([self.seed, 2])
        return SimulatedReceiver(
            self.world, self.walk, self.utc_start, rng, cold_start_s=cold_start_s
        )


def scenario(
    name: str = DEFAULT, seed: int = 1, duration_s: float | None = None, city_name: str = "graz"
) -> Scenario:
    """A named scenario; it lasts as long as its walk unless `duration_s` is given.

    `city_name` is that of `CITIES` where the scenario is a city.
    """
    if name not in SCENARIOS:
        raise ValueError(f"no scenario {name!r}; there are {', '.join(SCENARIOS)}")
    radio = SCENARIOS[name]
    rng = np.random.default_rng([seed, 0])
    if name.startswith("city"):
        place = CITIES[city_name]
        walk, where = Walk(place.walk), (place.lat_deg, place.lon_deg)
        cells = with_lists(city(rng, place))
        cells = (place.rogue, *cells) if name == "city-rogue" else cells
    else:
        walk, where = Walk(BLOCK), (ORIGIN_LAT_DEG, ORIGIN_LON_DEG)
        cells = with_neighbours((ROGUE, *CELLS))
    world = World.build(cells, *where, radio, rng)
    lasts_s = walk.duration_s if duration_s is None else duration_s
    return Scenario(name, world, walk, seed, UTC_START, lasts_s, target=world.transmitters[0])


def with_neighbours(cells: Sequence[Transmitter]) -> tuple[Transmitter, ...]:
    """The cells; each that broadcasts nothing yet lists the channels of the others."""
    channels = sorted({cell.arfcn for cell in cells})
    return tuple(
        cell
        if cell.broadcast is not None
        else replace(cell, broadcast=_broadcast([n for n in channels if n != cell.arfcn]))
        for cell in cells
    )


def _broadcast(neighbours: Sequence[int]) -> Broadcast:
    return Broadcast(tuple(neighbours), cro_db=0, penalty_time=0, t3212_raw=T3212)


SCENARIOS: Mapping[str, Radio] = {
    "block": Radio(shadowing_sigma_db=4.0, decorrelation_m=10.0),
    "clear": Radio(shadowing_sigma_db=0.0, fading_sigma_db=0.0),  # the formula alone, for checks
    "city-clean": Radio(shadowing_sigma_db=6.0, decorrelation_m=30.0),
    "city-rogue": Radio(shadowing_sigma_db=6.0, decorrelation_m=30.0),
}
