"""Readings without an identity get the name of their channel and code, or an identity near them.

Where the run names one identity with the channel and the code near in time and place, and no other,
a reading is joined to it. It confirms nothing: it is marked as an unsure identity.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, IntArray
from logger.core.cell_names import KINDS, SAME_CARRIER, channel_name
from logger.core.column import UNKNOWN_ID
from logger.core.errors import EstimationError, GeoError
from logger.core.identities import FEWEST_SCANS, Identities
from logger.core.latest import Latest
from logger.core.places import Places, track_of
from logger.core.readings import places_of
from logger.core.rows import Rows, numbered_texts
from logger.core.types import CellReading, Scan

JOIN_S = 300.0
JOIN_M = 2000.0
"""A reading belongs to an identity that the run names within this time and distance."""


def with_names(fixes: Rows, scans: Rows, readings: Rows, *, has_times: bool = True) -> Rows:
    """The table `readings` of a run with a name for each row of a known channel and code.

    A row without a place joins no identity, nor does one of a run without times.
    """
    pair, kind = _pairs(readings)
    is_nameless = (readings["cell"] == b"") & (pair >= 0)
    if not np.any(is_nameless):
        return readings
    named = readings.copy()
    rows = np.flatnonzero(is_nameless)
    different, first, which = np.unique(pair[rows], return_index=True, return_inverse=True)
    names = [
        f"{_NUMBERED[kind[row]]}-{readings['arfcn'][row]}-{value & _CODES}"
        for row, value in zip(rows[first].tolist(), different.tolist(), strict=True)
    ]
    named["cell"][rows] = np.array([name.encode() for name in names])[which]
    is_witness = _is_witness(readings) & np.isin(pair, different)
    if not has_times or not np.any(is_witness):
        return named
    try:
        places, is_placed = places_of(track_of(fixes), scans, readings)
    except (EstimationError, GeoError):
        return named
    is_witness &= is_placed
    for one in np.intersect1d(pair[is_witness], pair[is_nameless]).tolist():
        waiting = np.flatnonzero(is_nameless & is_placed & (pair == one))
        joined, to = _join(readings, places, waiting, np.flatnonzero(is_witness & (pair == one)))
        named["cell"][joined] = readings["cell"][to]
        named["identity_unsure"][joined] = 1
    return named


_NUMBERED = tuple(KINDS)
_CODES = (1 << 12) - 1
_CHANNEL_BITS = 24


def _pairs(readings: Rows) -> tuple[IntArray, IntArray]:
    """A number for technology, channel and code, -1 where one is unknown, and the technology."""
    n = len(readings)
    pair, number = np.full(n, -1, np.int64), np.zeros(n, np.int64)
    channel = readings["arfcn"].astype(np.int64)
    for k, (rat, kind) in enumerate(KINDS.items()):
        words = [rat, *(word for word, same in SAME_CARRIER.items() if same == rat)]
        code = readings[kind.code].astype(np.int64)
        own = np.isin(readings["rat"], [word.encode() for word in words])
        own &= (channel >= 0) & (channel <= kind.highest_channel)
        own &= (code >= 0) & (code <= kind.highest_code)
        number[own] = k
        pair[own] = (((k << _CHANNEL_BITS) + channel[own]) << 12) + code[own]
    return pair, number


def _is_witness(readings: Rows) -> BoolArray:
    """Rows that name a cell without doubt, of cells that exist: so many scans name them."""
    is_sure = (readings["cell"] != b"") & (readings["identity_unsure"] == 0)
    names, cell = numbered_texts(readings["cell"])
    in_scans = np.unique(np.stack([cell[is_sure], readings["seq"][is_sure]]), axis=1)[0]
    exists = np.bincount(in_scans, minlength=len(names)) >= FEWEST_SCANS
    return np.asarray(is_sure & exists[cell], np.bool_)


_AT_ONCE = 256
_PARTS: Mapping[str, object] = MappingProxyType(
    {"mcc": b"", "mnc": b"", "lac": UNKNOWN_ID, "tac": UNKNOWN_ID, "cid": UNKNOWN_ID}
)
"""Parts of an identity, and how a row says that one is unknown."""


def _join(
    readings: Rows, places: Places, rows: IntArray, witnesses: IntArray
) -> tuple[IntArray, IntArray]:
    """Which of the rows of a pair belong to an identity, and a row that names it; (k,) each."""
    t_ns = places.t_ns
    rows = rows[np.argsort(t_ns[rows], kind="stable")]
    witnesses = witnesses[np.argsort(t_ns[witnesses], kind="stable")]
    identity = numbered_texts(readings["cell"][witnesses])[1]
    reach_ns = round(JOIN_S * 1e9)
    joined, to = [rows[:0]], [rows[:0]]
    for begin in range(0, len(rows), _AT_ONCE):
        some = rows[begin : begin + _AT_ONCE]
        first = np.searchsorted(t_ns[witnesses], t_ns[some[0]] - reach_ns, side="left")
        end = np.searchsorted(t_ns[witnesses], t_ns[some[-1]] + reach_ns, side="right")
        near = witnesses[first:end]
        is_near = np.abs(t_ns[some][:, None] - t_ns[near]) <= reach_ns
        is_near &= places.part(some).distances_m(places.part(near)) <= JOIN_M
        is_near &= _may_be_same(readings[some], readings[near])
        candidates = np.unique(identity[first:end])
        found = [np.any(is_near[:, identity[first:end] == one], axis=1) for one in candidates]
        only = np.sum(found, axis=0) == 1 if found else np.zeros(len(some), np.bool_)
        joined.append(some[only])
        to.append(near[np.argmax(is_near, axis=1)][only] if len(near) else some[only])
    return np.concatenate(joined), np.concatenate(to)


def _may_be_same(rows: Rows, others: Rows) -> BoolArray:
    """Whether no known part of the identity of a row differs from that of another, (n, m)."""
    same = np.ones((len(rows), len(others)), np.bool_)
    for name, unknown in _PARTS.items():
        one, other = rows[name], others[name]
        if np.any(one != unknown):
            same &= (one == unknown)[:, None] | (other == unknown) | (one[:, None] == other)
    return same


class _Witness(NamedTuple):
    """Where and when a scan named an identity last."""

    t_ns: int
    place: Places
    reading: CellReading


_MOST_PAIRS = 1000


class RecentNames:
    """Names of the readings of scans in their order: as `with_names`, from what came before."""

    def __init__(self) -> None:
        self._witnesses: Latest[dict[str, _Witness]] = Latest(_MOST_PAIRS)

    def take(self, t_ns: int, scan: Scan, place: Places | None, known: Identities) -> Scan:
        """The scan with names; without a place its readings join no identity.

        Cells that are `known` bear witness of their channel and code.
        """
        names = [channel_name(one) for one in scan.readings]
        if place is not None:
            for name, one in zip(names, scan.readings, strict=True):
                if name is None or one.cell is None or one.identity_unsure or one.cell not in known:
                    continue
                of_pair = self._witnesses.get(name, {})
                of_pair[one.cell] = _Witness(t_ns, place, one)
                self._witnesses.put(name, of_pair)
        if all(name is None or one.cell for name, one in zip(names, scan.readings, strict=True)):
            return scan
        named = [
            one if name is None or one.cell else self._with_name(t_ns, name, one, place)
            for name, one in zip(names, scan.readings, strict=True)
        ]
        return replace(scan, readings=tuple(named))

    def _with_name(
        self, t_ns: int, name: str, reading: CellReading, place: Places | None
    ) -> CellReading:
        """The reading with the identity that it belongs to, or with its own name."""
        of_pair = self._witnesses.get(name, {})
        for cell in [cell for cell, one in of_pair.items() if t_ns - one.t_ns > JOIN_S * 1e9]:
            del of_pair[cell]
        if place is not None:
            near = [
                cell
                for cell, one in of_pair.items()
                if one.place.away_m(place) <= JOIN_M and _agree(one.reading, reading)
            ]
            if len(near) == 1:
                return replace(reading, label=near[0], identity_unsure=True)
        return replace(reading, label=name)


def _agree(one: CellReading, other: CellReading) -> bool:
    """As `_may_be_same` of two readings."""
    parts = [(getattr(one, name), getattr(other, name)) for name in _PARTS]
    return all(None in pair or pair[0] == pair[1] for pair in parts)
