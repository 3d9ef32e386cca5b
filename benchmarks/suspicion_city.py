"""Walks through simulated clean cities as records, for `suspicion.py`.

Odd seeds are a modem with the card of the first network: it names its serving cell and six
neighbours. Even seeds are one without a card that names every cell it decodes.
"""

from collections.abc import Iterator

import numpy as np

from benchmarks.suspicion_logs import Log, hours_of
from logger.core.arrays import FloatArray
from logger.core.types import CellReading, Fix, Record, Scan
from logger.sim.scenario import GRAZ, city
from logger.sim.walk import Walk
from logger.sim.world import Radio, Transmitter, World

_POLL_S = 4.0
DECODED_DBM = -104.0
_NEIGHBOURS = 6
_HYSTERESIS_DB = 4.0
_SILENT_DBM = -130.0
_SWITCHED_ON = 0.4
"""Share of the walk after which the new cell is on the air."""


def city_logs(n: int) -> Iterator[Log]:
    """One walk through each of `n` cities."""
    for seed in range(n):
        yield city_log(seed)


def city_log(seed: int, more: tuple[Transmitter, ...] = ()) -> Log:
    """A walk through a city; `more` are stations that are not its own."""
    records = SimulatedCity(seed, more).walk()
    return Log(f"city {seed}", records, hours_of(records))


class SimulatedCity:
    """A city that is walked once or several times: shadowing stays, fading is drawn anew.

    `new` is the number of the cell that is switched on during each walk.
    """

    def __init__(self, seed: int, more: tuple[Transmitter, ...] = ()) -> None:
        self._rng = np.random.default_rng([seed, 77])
        drawn = city(self._rng)
        self.cells = (*drawn, *more)
        self.new = len(drawn) - 1
        where = GRAZ.lat_deg, GRAZ.lon_deg
        self._world = World.build(self.cells, *where, Radio(6.0, 30.0, 2.0), self._rng)
        self._has_card = bool(seed % 2)

    def walk(self, gain_db: float = 0.0, off_air: int | None = None) -> list[Record]:
        """Records of a walk with an antenna of this gain, without the cell of this number."""
        way = Walk(GRAZ.walk)
        t_s = np.arange(0.0, way.duration_s, _POLL_S)
        east_m, north_m = way.positions(t_s)
        levels_dbm = self._world.received_dbm(east_m, north_m, self._rng) + gain_db
        levels_dbm[self.new, : int(_SWITCHED_ON * len(t_s))] = _SILENT_DBM
        if off_air is not None:
            levels_dbm[off_air] = _SILENT_DBM
        records: list[Record] = []
        serving = -1
        for k, t in enumerate(t_s):
            lat_deg, lon_deg = self._world.to_latlon(float(east_m[k]), float(north_m[k]))
            t_ns = round(t * 1e9)
            records.append(Record(t_ns, "gnss", Fix(True, lat_deg=lat_deg, lon_deg=lon_deg)))
            level_dbm = levels_dbm[:, k]
            heard = self._audible(level_dbm)
            if not heard:
                continue
            if serving not in heard or level_dbm[heard[0]] > level_dbm[serving] + _HYSTERESIS_DB:
                serving = heard[0]
            records.append(Record(t_ns, "modem", self._scan(t_ns, serving, heard, level_dbm)))
        return records

    def _audible(self, level_dbm: FloatArray) -> list[int]:
        """Cells that the modem decodes, the strongest first."""
        heard = [i for i in np.argsort(-level_dbm).tolist() if level_dbm[i] >= DECODED_DBM]
        if not self._has_card:
            return heard
        home = GRAZ.operators[0][:2]
        return [i for i in heard if (self.cells[i].mcc, self.cells[i].mnc) == home]

    def _scan(self, t_ns: int, serving: int, heard: list[int], level_dbm: FloatArray) -> Scan:
        others = [i for i in heard if i != serving]
        others = others[:_NEIGHBOURS] if self._has_card else others
        readings = [reading_of(self.cells[serving], float(level_dbm[serving]), "serving")]
        readings += [reading_of(self.cells[i], float(level_dbm[i]), "neighbour") for i in others]
        return Scan(t_ns, tuple(readings))


def reading_of(cell: Transmitter, level_dbm: float, role: str) -> CellReading:
    """A cell as a modem prints it."""
    c1 = round(level_dbm) + 105
    return CellReading(
        role, "GSM", cell.mcc, cell.mnc, cell.lac, cell.cid, cell.arfcn, bsic=cell.bsic,  # type: ignore[arg-type]
        rssi_dbm=level_dbm, c1=c1, c2=c1,
    )  # fmt: skip
