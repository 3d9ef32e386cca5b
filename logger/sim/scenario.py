"""Named walks through named worlds, each of them decided by a seed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from logger.core.types import Broadcast
from logger.sim import city
from logger.sim.dialects import SIM800, Dialect
from logger.sim.modem import SimulatedModem
from logger.sim.receiver import SimulatedReceiver
from logger.sim.walk import Walk
from logger.sim.world import Radio, Transmitter, World

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

    `city_name` is that of `city.CITIES` where the scenario is a city.
    """
    if name not in SCENARIOS:
        raise ValueError(f"no scenario {name!r}; there are {', '.join(SCENARIOS)}")
    radio = SCENARIOS[name]
    rng = np.random.default_rng([seed, 0])
    if name.startswith("city"):
        place = city.CITIES[city_name]
        walk, where = Walk(place.walk), (place.lat_deg, place.lon_deg)
        cells = city.with_lists(city.city(rng, place))
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
