"""Cities of 40 GSM cells of three networks, with what makes legitimate cells look unusual.

Each network has two location areas that meet in the middle. Between the rooftops are a cell of the
railway, an indoor cell with an area of its own, a cell that two networks share, and a new cell.
Positions, powers and channels are drawn; the networks are real.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot
from types import MappingProxyType

import numpy as np

from logger.core.types import Broadcast
from logger.sim.walk import Waypoints
from logger.sim.world import Transmitter

HALF_M = 1300.0
"""Half of the side of the square of the rooftops; the walk is inside of half of it."""
_RAILWAY_AREA = 6001
_ROOFTOPS = 12
_APART_M = 350.0
_MOST_TRIES = 2000
_T3212 = 10


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
    listed = [
        tuple(sorted(a for a in channels[cell.mcc, cell.mnc] if a != cell.arfcn)) for cell in cells
    ]
    return tuple(
        replace(cell, broadcast=Broadcast(arfcns, cro_db=0, penalty_time=0, t3212_raw=_T3212))
        for cell, arfcns in zip(cells, listed, strict=True)
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
