"""The numbering plan: networks of this country, and identities that contradict each other."""

from collections.abc import Iterator
from math import hypot, inf

from logger.core.latest import Latest
from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.countries import (
    GSMR_ARFCNS,
    TEST_MCCS,
    Countries,
    countries,
    is_international,
)
from logger.core.suspicion.finding import Evidence
from logger.core.suspicion.heard import Heard, HeardCell, Memory, Moment
from logger.core.suspicion.spots import Spot

_FEWEST_PUBLIC = 3
"""Cells of networks of this country that must be heard before a test network is unusual: where all
cells belong to it, the place is a laboratory or a simulation."""
_HELD_S = 10.0
_NEAR_M = 300.0
_STRONGER_DB = 10.0
"""Of two cells on one channel the weaker one cannot be decoded below 9 dB (3GPP TS 45.005)."""
_MOST_CHANNELS = 500


class PlanRules:
    """P1, P4, P5 and P6."""

    def __init__(self, plan: Countries | None = None) -> None:
        self._plan = plan or countries()
        self._near: tuple[float, float, tuple[str, ...]] = (inf, inf, ())
        self._whys: dict[tuple[str, str | None], str | None] = {}
        """Why each network is not expected near here, None if it is."""
        self._public: set[str] = set()
        self._on_channel: Latest[list[str]] = Latest(_MOST_CHANNELS)
        self._by_cid: Latest[list[str]] = Latest(_MOST_CHANNELS)

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:
        """As `FamilyRules`."""
        for cell, heard in taken:
            yield from self._network(now, memory, cell, heard)
            if cell.area is not None and cell.longest_s >= _HELD_S:
                yield from self._area_of_cid(memory, cell)
            if heard.reading.arfcn is not None and (pair := cell.usual_pair) is not None:
                yield from self._channel(memory, cell, pair)
            if len(cell.held_s) > 1:
                yield from _channels_of(cell)

    def _network(
        self, now: Moment, memory: Memory, cell: HeardCell, heard: Heard
    ) -> Iterator[Broken]:
        """P1: a network that is not of this country."""
        mcc, mnc = heard.reading.mcc, heard.reading.mnc
        if mcc is None or now.lat_deg is None or now.lon_deg is None:
            return
        near = self._countries_near(now.lat_deg, now.lon_deg)
        if (mcc, mnc) not in self._whys:
            if len(self._whys) >= _MOST_CHANNELS:
                self._whys.clear()
            self._whys[mcc, mnc] = self._foreign(mcc, mnc, near)
        why = self._whys[mcc, mnc]
        if why is None:
            self._public.add(cell.name)
            return
        is_railway = self._plan.is_railway(mcc, mnc) or heard.reading.arfcn in GSMR_ARFCNS
        if is_railway or (mcc in TEST_MCCS and len(self._public) < _FEWEST_PUBLIC):
            return
        memory.foreign.put(cell.name, None)
        yield Broken("P1", cell.name, {"operator": cell.operator, "why": why})

    def _foreign(self, mcc: str, mnc: str | None, near: tuple[str, ...]) -> str | None:
        """Why a network is not expected here, None if it is or if that is unknown."""
        plan = self._plan
        if mcc in TEST_MCCS:
            return "a test network"
        if is_international(mcc):
            return "a network of ships, aircraft or satellites"
        owners = plan.countries_of(mcc)
        if not owners:
            return "the country code is nobody's"
        if not near or any(owner in near for owner in owners):
            is_known = mnc is None or plan.is_listed(mcc, mnc)
            return None if is_known else "no network has this code in this country"
        return f"the network is of {plan.name(owners[0])}, more than {plan.near_km:.0f} km away"

    def _countries_near(self, lat_deg: float, lon_deg: float) -> tuple[str, ...]:
        if hypot(lat_deg - self._near[0], lon_deg - self._near[1]) > 0.01:
            self._near = lat_deg, lon_deg, self._plan.near(lat_deg, lon_deg)
            self._whys = {}
        return self._near[2]

    def _area_of_cid(self, memory: Memory, cell: HeardCell) -> Iterator[Broken]:
        """P4: one cell identity under two area codes."""
        if abs(cell.since_s - memory.changed_rat_s) < _HELD_S:
            return
        key = f"{cell.operator} {cell.rat} {cell.cid}"
        for name in _others(self._by_cid, key, cell.name):
            other = memory.cells.get(name)
            if other is None or other.area is None or other.area == cell.area:
                continue
            if other.rat == cell.rat:
                yield Broken("P4", cell.name, {"cid": str(cell.cid), "area": cell.area or 0,
                                               "other_area": other.area})  # fmt: skip

    def _channel(self, memory: Memory, cell: HeardCell, pair: tuple[int, int]) -> Iterator[Broken]:
        """P5: another identity on the channel and colour code of a cell heard near here."""
        for name in _others(self._on_channel, f"{cell.rat} {pair[0]} {pair[1]}", cell.name):
            other = memory.cells.get(name)
            if other is None or other.usual_pair != pair:
                continue
            above_db, apart_m = _closest(cell, other)
            if apart_m <= _NEAR_M and abs(above_db) >= _STRONGER_DB:
                evidence: Evidence = {
                    "channel": pair[0],
                    "code": pair[1],
                    "other": other.name,
                    "apart_m": round(apart_m),
                    "above_db": round(above_db),
                }
                yield Broken("P5", cell.name, evidence)


def _others(names_of: Latest[list[str]], key: str, name: str) -> list[str]:
    """Other names of a key before; the name is one of them from now on."""
    names = names_of.get(key)
    if names is None:
        names_of.put(key, [name])
        return []
    if name not in names:
        names_of.put(key, [*names, name][-4:])
        return names
    return [other for other in names if other != name] if len(names) > 1 else []


def _closest(cell: HeardCell, other: HeardCell) -> tuple[float, float]:
    """How much stronger a cell was than another where both were heard closest, and that distance.

    Metres; infinite if either has no place.
    """
    here = cell.spots.here
    if here is None:
        return 0.0, inf
    x_m, y_m = here.x_m, here.y_m
    there: Spot | None = min(
        other.spots, key=lambda s: hypot(s.x_m - x_m, s.y_m - y_m), default=None
    )
    if there is None:
        return 0.0, inf
    apart_m = hypot(there.x_m - here.x_m, there.y_m - here.y_m)
    return here.level_dbm - there.level_dbm, apart_m


def _channels_of(cell: HeardCell) -> Iterator[Broken]:
    """P6: one identity on two channels."""
    channels = cell.held_channels if cell.rat == "GSM" else []
    if len(channels) > 1:
        evidence: Evidence = {"channel": channels[0], "other_channel": channels[1]}
        yield Broken("P6", cell.name, evidence)
