"""Walks through simulated clean cities as records, for `suspicion.py`.

Odd seeds are a modem with the card of the first network: it names its serving cell and six
neighbours. Even seeds are one without a card that names every cell it decodes.
"""

from collections.abc import Iterator

import numpy as np

from benchmarks.suspicion_logs import Log, hours_of
from logger.core.types import CellReading, Fix, Record, Scan
from logger.sim.city import LAT_DEG, LON_DEG, OPERATORS, WALK, city
from logger.sim.walk import Walk
from logger.sim.world import Radio, Transmitter, World

_POLL_S = 4.0
_DECODED_DBM = -104.0
_NEIGHBOURS = 6
_HYSTERESIS_DB = 4.0
_SWITCHED_ON = 0.4
"""Share of the walk after which the new cell is on the air."""


def city_logs(n: int) -> Iterator[Log]:
    """One walk through each of `n` cities."""
    for seed in range(n):
        yield city_log(seed)


def city_log(seed: int, more: tuple[Transmitter, ...] = ()) -> Log:
    """A walk through a city; `more` are stations that are not its own."""
    rng = np.random.default_rng([seed, 77])
    drawn = city(rng)
    cells = (*drawn.cells, *more)
    world = World.build(cells, LAT_DEG, LON_DEG, Radio(6.0, 30.0, 2.0), rng)
    walk = Walk(WALK)
    t_s = np.arange(0.0, walk.duration_s, _POLL_S)
    east_m, north_m = walk.positions(t_s)
    levels_dbm = world.received_dbm(east_m, north_m, rng)
    levels_dbm[drawn.new, : int(_SWITCHED_ON * len(t_s))] = -130.0
    records: list[Record] = []
    serving = -1
    for k, t in enumerate(t_s):
        lat_deg, lon_deg = world.to_latlon(float(east_m[k]), float(north_m[k]))
        t_ns = round(t * 1e9)
        records.append(Record(t_ns, "gnss", Fix(True, lat_deg=lat_deg, lon_deg=lon_deg)))
        level_dbm = levels_dbm[:, k]
        heard = [i for i in np.argsort(-level_dbm).tolist() if level_dbm[i] >= _DECODED_DBM]
        if seed % 2:
            home = OPERATORS[0][:2]
            heard = [i for i in heard if (cells[i].mcc, cells[i].mnc) == home]
        if not heard:
            continue
        if serving not in heard or level_dbm[heard[0]] > level_dbm[serving] + _HYSTERESIS_DB:
            serving = heard[0]
        others = [i for i in heard if i != serving]
        others = others[:_NEIGHBOURS] if seed % 2 else others
        readings = [_reading(cells[serving], level_dbm[serving], "serving")]
        readings += [_reading(cells[i], level_dbm[i], "neighbour") for i in others]
        records.append(Record(t_ns, "modem", Scan(t_ns, tuple(readings))))
    return Log(f"city {seed}", records, hours_of(records))


def _reading(cell: Transmitter, level_dbm: float, role: str) -> CellReading:
    c1 = round(level_dbm) + 105
    return CellReading(
        role, "GSM", cell.mcc, cell.mnc, cell.lac, cell.cid, cell.arfcn, bsic=cell.bsic,  # type: ignore[arg-type]
        rssi_dbm=float(level_dbm), c1=c1, c2=c1,
    )  # fmt: skip
