"""The numbering plan: networks of this country, and identities that contradict each other."""

from collections.abc import Iterable
from functools import partial
from math import hypot, inf, log

from logger.core.latest import Latest
from logger.core.suspicion.countries import (
    GSMR_ARFCNS,
    INTERNATIONAL,
    TEST_MCC,
    TEST_MCCS,
    countries,
)
from logger.core.suspicion.earlier_walks import FEWEST_MOVED
from logger.core.suspicion.heard import HeardCell, Memory
from logger.core.suspicion.rule import GSM, Evidence, Rate, ScanRule, on_telephones
from logger.core.suspicion.spots import Spot

_FEWEST_SCANS = 2
"""With a cell of a network of this country before a test network is unusual: else the place is a
laboratory or a simulation."""
_MOST_TEST_CELLS = 2  # of a catcher, where nothing else is heard; a simulation has more
_HELD_S = 10.0
_NEAR_M = 300.0
_STRONGER_DB = 10.0
"""Of two cells on one channel the weaker cannot be decoded below 9 dB (3GPP TS 45.005)."""
_MOST_CHANNELS = 500
_FEWEST_CELLS = 10
"""Of an operator, from which on its channels in earlier walks are known."""


class _Networks:
    def __init__(self) -> None:
        self.plan = countries()
        self._near: tuple[float, float, tuple[str, ...]] = (inf, inf, ())
        self._whys: dict[tuple[str, str | None], str | None] = {}
        self.has_public = False

    def why_not(self, mcc: str, mnc: str | None, lat_deg: float, lon_deg: float) -> str | None:
        """Why a network is not expected here, None if it is or that is unknown."""
        if hypot(lat_deg - self._near[0], lon_deg - self._near[1]) > 0.01:
            self._near = lat_deg, lon_deg, self.plan.near(lat_deg, lon_deg)
            self._whys = {}
        if (mcc, mnc) not in self._whys:
            if len(self._whys) >= _MOST_CHANNELS:
                self._whys.clear()
            self._whys[mcc, mnc] = self._why_foreign(mcc, mnc, self._near[2])
        return self._whys[mcc, mnc]

    def _why_foreign(self, mcc: str, mnc: str | None, near: Iterable[str]) -> str | None:
        plan = self.plan
        if mcc in TEST_MCCS:
            return "a test network"
        if mcc == INTERNATIONAL:
            return "a network of ships, aircraft or satellites"
        owners = plan.countries_of(mcc)
        if not owners:
            return "the country code is nobody's"
        if not near or any(owner in near for owner in owners):
            is_known = mnc is None or plan.is_listed(mcc, mnc)
            return None if is_known else "no network has this code in this country"
        return f"the network is of {plan.name(owners[0])}, more than {plan.near_km:.0f} km away"


@ScanRule(
    id="P1",
    family="plan",
    needs=("position", "country code"),
    gate="railways are named; a test network counts once 2 scans heard a cell of this country, "
    "one or two cells of 001 also 300 m on",
    sentence="network {operator}: {why}",
    harmless="borders, ships and aircraft, private networks",
    detection=0.9,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(0, 83, 9.8)),
    elsewhere=Rate(0, 85, 0.0, "88 cells at one place, railways left out"),
)
def _foreign(memory: Memory, cell: HeardCell) -> Evidence | None:
    now, reading, networks = memory.now, cell.heard.reading, memory.of(_Networks)
    mcc, mnc = reading.mcc, reading.mnc
    if mcc is None or now.lat_deg is None or now.lon_deg is None:
        return None
    why = networks.why_not(mcc, mnc, now.lat_deg, now.lon_deg)
    if why is None:
        networks.has_public |= cell.n_scans >= _FEWEST_SCANS
        return None
    if networks.plan.is_railway(mcc, mnc) or reading.arfcn in GSMR_ARFCNS:
        return None
    if mcc in TEST_MCCS and not networks.has_public and not _is_catcher(memory, cell):
        return None
    memory.foreign.put(cell.name, None)
    return {"operator": cell.operator, "why": why}


def _is_catcher(memory: Memory, cell: HeardCell) -> bool:
    # too wide for a laboratory; private networks of other test codes may be as wide
    now = memory.now
    if cell.operator[:3] != TEST_MCC or now.x_m is None or now.y_m is None or cell.first_m is None:
        return False
    n_cells = sum(one.operator[:3] == TEST_MCC for one in memory.cells.values())
    away_m = hypot(now.x_m - cell.first_m[0], now.y_m - cell.first_m[1])
    return n_cells <= _MOST_TEST_CELLS and away_m > _NEAR_M


_BY_CID = partial(Latest[list[str]], _MOST_CHANNELS)
_BY_CHANNEL = partial(Latest[list[str]], _MOST_CHANNELS)
"""Names of cells that share an identity under several areas, and a channel with its code."""


def _others(names_of: Latest[list[str]], key: str, name: str) -> list[str]:
    """Other names of the key; adds `name` to them."""
    names = names_of.get(key)
    if names is None:
        names_of.put(key, [name])
        return []
    if name not in names:
        names_of.put(key, [*names, name][-4:])
        return names
    return [other for other in names if other != name] if len(names) > 1 else []


def _number(cell: HeardCell) -> str:
    return f"{cell.operator} {cell.rat} {cell.cid}"


def _is_renumbered(memory: Memory, name: str) -> bool:
    cell = memory.cells.get(name)
    if cell is None:
        return False
    names_of = memory.of(_BY_CID)
    of_area = [
        other
        for other in memory.of_operator(cell.operator, cell.rat)
        if other.area == cell.area and len(names_of.get(_number(other), ())) > 1
    ]
    return len(of_area) >= FEWEST_MOVED


@ScanRule(
    id="P4",
    family="plan",
    needs=("identity", "area code"),
    gate="both heard for 10 s, not within 10 s of a change of technology; not where 3 cells of "
    "the area are also heard in another",
    sentence="cell identity {cid} is heard in area {area} and in area {other_area}",
    harmless="an operator has renumbered, or two areas meet and use the number twice",
    detection=0.8,
    measured=on_telephones(GSM=(0, 23, 2.7), LTE=(0, 814, 36.1), WCDMA=(0, 83, 9.8)),
    refuted_by=_is_renumbered,
)
def _two_areas(memory: Memory, cell: HeardCell) -> Evidence | None:
    if cell.area is None or cell.longest_s < _HELD_S:
        return None
    if abs(cell.since_s - memory.changed_rat_s) < _HELD_S:
        return None
    for name in _others(memory.of(_BY_CID), _number(cell), cell.name):
        other = memory.cells.get(name)
        if other is None or other.area is None or other.area == cell.area:
            continue
        if other.rat == cell.rat:
            return {"cid": str(cell.cid), "area": cell.area, "other_area": other.area}
    return None


@ScanRule(
    id="P5",
    family="plan",
    needs=("identity", "channel", "colour code", "position"),
    gate="each held for 10 s; within 300 m of each other one is 10 dB stronger",
    sentence="channel {channel} with code {code} is also that of {other}, heard {apart_m} away",
    harmless="a telephone that prints the old identity with the new channel",
    detection=0.5,
    measured=on_telephones(GSM=(0, 21, 2.0)),
    rats=GSM,
)
def _anothers_channel(memory: Memory, cell: HeardCell) -> Evidence | None:
    pair = cell.usual_pair
    if cell.heard.reading.arfcn is None or pair is None:
        return None
    key = f"{cell.rat} {pair[0]} {pair[1]}"
    for name in _others(memory.of(_BY_CHANNEL), key, cell.name):
        other = memory.cells.get(name)
        if other is None or other.usual_pair != pair or cell.is_renamed or other.is_renamed:
            continue
        if (other.area, other.cid) == (cell.area, cell.cid):
            continue  # one cell of two networks (3GPP TS 23.251)
        above_db, apart_m = _closest(cell, other)
        if apart_m <= _NEAR_M and abs(above_db) >= _STRONGER_DB:
            return {
                "channel": pair[0],
                "code": pair[1],
                "other": other.name,
                "apart_m": round(apart_m),
                "above_db": round(above_db),
            }
    return None


def _closest(cell: HeardCell, other: HeardCell) -> tuple[float, float]:
    """How much stronger a cell was than another where both were heard closest, and that distance.

    The distance is in metres, infinite if either has no place.
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


def _has_twin(memory: Memory, cell: HeardCell) -> bool:
    # a telephone's list has the old and the new channel of a handover, for one scan
    if cell.twin is None:
        return False
    _, since_s, n_scans = cell.twin
    return n_scans == cell.n_scans and memory.now.t_s - since_s >= _HELD_S


def _channels_nats(memory: Memory, cell: HeardCell) -> float:
    rate = _two_channels.rate(cell.rat) if _has_twin(memory, cell) else None
    return log(_two_channels.detection / (rate or _two_channels.measured["GSM"]).per_cell)


@ScanRule(
    id="P6",
    family="plan",
    needs=("identity", "channel", "colour code"),
    gate="each channel held for 10 s, or scans that name it on both, one after another, for 10 s",
    sentence="is heard on channel {channel} and on channel {other_channel}",
    harmless="an operator has changed the channels during the walk",
    detection=0.9,
    measured=on_telephones(GSM=(0, 21, 2.0)),
    elsewhere=Rate(0, 66, 0.0, "lists of modems with 66 cells"),
    rats=GSM,
    weigh=_channels_nats,
)
def _two_channels(memory: Memory, cell: HeardCell) -> Evidence | None:
    channel = cell.heard.reading.arfcn
    if channel is not None and _has_twin(memory, cell):
        return {"channel": channel, "other_channel": cell.twin[0] if cell.twin else channel}
    channels = cell.held_channels if len(cell.held_s) > 1 and cell.rat == "GSM" else []
    return {"channel": channels[0], "other_channel": channels[1]} if len(channels) > 1 else None


@ScanRule(
    id="P2",
    family="plan",
    needs=("identity", "channel", "earlier walks"),
    gate="10 cells of the operator known on channels of earlier walks; only warns",
    sentence="channel {channel} is none of the {channels} channels of this operator in "
    "earlier walks",
    harmless="the operator has a new channel",
    detection=0.5,
    strength="warns",
)
def _new_channel(memory: Memory, cell: HeardCell) -> Evidence | None:
    reading, baseline = cell.heard.reading, memory.baseline
    if not baseline.n_walks or memory.now.lat_deg is None:
        return None
    if reading.mcc is None or reading.mnc is None or reading.arfcn is None:
        return None
    known = baseline.channels(reading.mcc, reading.mnc, cell.rat)
    if reading.arfcn in known or sum(known.values()) < _FEWEST_CELLS:
        return None
    return {"channel": reading.arfcn, "channels": len(known)}
