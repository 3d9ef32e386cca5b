"""Readings without an identity get the name of their channel and code, or an identity near them.

A reading is joined to an identity where the run names it with both near in time and place, and no
other. That confirms nothing: the identity is marked as unsure.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from logger.core.arrays import BoolArray, IntArray
from logger.core.cell_names import (
    CODES,
    FEWEST_SCANS,
    HIGHEST,
    SAME_CARRIER,
    Identities,
    channel_name,
)
from logger.core.errors import EstimationError, GeoError
from logger.core.latest import Latest
from logger.core.places import Places, track_of
from logger.core.readings import places_of
from logger.core.rows import Rows, numbered_texts
from logger.core.types import UNKNOWN_ID, CellReading, Scan

JOIN_S = 300.0
JOIN_M = 2000.0
_JOIN_NS = round(JOIN_S * 1e9)
_PARTS: Mapping[str, object] = MappingProxyType(
    {"mcc": b"", "mnc": b"", "lac": UNKNOWN_ID, "tac": UNKNOWN_ID, "cid": UNKNOWN_ID}
)
"""Parts of an identity, and how a row says that one is unknown."""
_CHANNEL_BITS, _CODE_BITS = 24, 12
_AT_ONCE = 256
_MOST_PAIRS = 1000


def with_names(fixes: Rows, scans: Rows, readings: Rows, *, has_times: bool = True) -> Rows:
    """The table `readings` of a run with a name for each row of a known channel and code.

    A row without a place joins no identity, nor does one of a run without times.
    """
    pair, rat = _pairs(readings)
    is_nameless = (readings["cell"] == b"") & (pair >= 0)
    if not np.any(is_nameless):
        return readings
    named = readings.copy()
    rows = np.flatnonzero(is_nameless)
    _, first, which = np.unique(pair[rows], return_index=True, return_inverse=True)
    names = [
        f"{rat[row]}-{readings['arfcn'][row]}-{pair[row] % (1 << _CODE_BITS)}"
        for row in rows[first].tolist()
    ]
    named["cell"][rows] = np.array([name.encode() for name in names])[which]
    is_witness = _is_witness(readings) & np.isin(pair, pair[rows])
    if not has_times or not np.any(is_witness):
        return named
    try:
        places, is_placed = places_of(track_of(fixes), scans, readings)
    except (EstimationError, GeoError):
        return named
    is_witness &= is_placed
    for one in np.intersect1d(pair[is_witness], pair[rows]).tolist():
        waiting = np.flatnonzero(is_nameless & is_placed & (pair == one))
        joined, to = _join(readings, places, waiting, np.flatnonzero(is_witness & (pair == one)))
        named["cell"][joined] = readings["cell"][to]
        named["identity_unsure"][joined] = 1
    return named


def _pairs(readings: Rows) -> tuple[IntArray, npt.NDArray[np.str_]]:
    """A number for technology, channel and code of each row, -1 if unknown; the technology."""
    pair = np.full(len(readings), -1, np.int64)
    technology = np.full(len(readings), "", "U8")
    channel = readings["arfcn"].astype(np.int64)
    for number, (rat, column) in enumerate(CODES.items()):
        code = readings[column].astype(np.int64)
        highest_channel, highest_code = HIGHEST[rat]
        words = [rat, *(word for word, same in SAME_CARRIER.items() if same == rat)]
        own = np.isin(readings["rat"], [word.encode() for word in words])
        own &= (channel >= 0) & (channel <= highest_channel) & (code >= 0) & (code <= highest_code)
        technology[own] = rat
        pair[own] = ((((number << _CHANNEL_BITS) + channel) << _CODE_BITS) + code)[own]
    return pair, technology


def _is_witness(readings: Rows) -> BoolArray:
    is_sure = (readings["cell"] != b"") & (readings["identity_unsure"] == 0)
    names, cell = numbered_texts(readings["cell"])
    in_scans = np.unique(np.stack([cell[is_sure], readings["seq"][is_sure]]), axis=1)[0]
    exists = np.bincount(in_scans, minlength=len(names)) >= FEWEST_SCANS
    return np.asarray(is_sure & exists[cell], np.bool_)


def _join(
    readings: Rows, places: Places, rows: IntArray, witnesses: IntArray
) -> tuple[IntArray, IntArray]:
    """Which rows of a pair belong to an identity, and for each a row that names it."""
    t_ns = places.t_ns
    rows = rows[np.argsort(t_ns[rows], kind="stable")]
    witnesses = witnesses[np.argsort(t_ns[witnesses], kind="stable")]
    identity = numbered_texts(readings["cell"][witnesses])[1]
    joined, to = [rows[:0]], [rows[:0]]
    for begin in range(0, len(rows), _AT_ONCE):
        some = rows[begin : begin + _AT_ONCE]
        between = t_ns[some[0]] - _JOIN_NS, t_ns[some[-1]] + _JOIN_NS
        first = np.searchsorted(t_ns[witnesses], between[0], side="left")
        end = np.searchsorted(t_ns[witnesses], between[1], side="right")
        near, which = witnesses[first:end], identity[first:end]
        if not len(near):
            continue
        is_near = np.abs(t_ns[some][:, None] - t_ns[near]) <= _JOIN_NS
        is_near &= places.part(some).distances_m(places.part(near)) <= JOIN_M
        is_near &= _may_be_same(readings[some], readings[near])
        n_identities = sum(np.any(is_near[:, which == one], axis=1) for one in np.unique(which))
        only = n_identities == 1
        joined.append(some[only])
        to.append(near[np.argmax(is_near, axis=1)][only])
    return np.concatenate(joined), np.concatenate(to)


def _may_be_same(rows: Rows, others: Rows) -> BoolArray:
    """Shape (n, m): whether no known part of the identities differs."""
    same = np.ones((len(rows), len(others)), np.bool_)
    for name, unknown in _PARTS.items():
        one, other = rows[name], others[name]
        if np.any(one != unknown):
            same &= (one == unknown)[:, None] | (other == unknown) | (one[:, None] == other)
    return same


class RecentNames:
    """As `with_names` for scans in their order, by what came before."""

    def __init__(self) -> None:
        # by channel name and identity: when, where and as what a scan named it last
        self._witnesses: Latest[dict[str, tuple[int, Places, CellReading]]] = Latest(_MOST_PAIRS)

    def take(self, t_ns: int, scan: Scan, place: Places | None, known: Identities) -> Scan:
        """The scan with names; cells that are `known` bear witness of their channel and code."""
        by_channel = [channel_name(one) for one in scan.readings]
        if place is not None:
            for name, one in zip(by_channel, scan.readings, strict=True):
                cell = one.cell
                if name and cell and cell in known and not one.identity_unsure:
                    of_pair = self._witnesses.get(name, {})
                    of_pair[cell] = t_ns, place, one
                    self._witnesses.put(name, of_pair)
        named = tuple(
            one if one.cell or name is None else self._with_name(t_ns, name, one, place)
            for name, one in zip(by_channel, scan.readings, strict=True)
        )
        return replace(scan, readings=named)

    def _with_name(
        self, t_ns: int, name: str, reading: CellReading, place: Places | None
    ) -> CellReading:
        of_pair = self._witnesses.get(name, {})
        for cell in [cell for cell, seen in of_pair.items() if t_ns - seen[0] > _JOIN_NS]:
            del of_pair[cell]
        near = [
            cell
            for cell, (_, where, one) in of_pair.items()
            if place is not None and where.away_m(place) <= JOIN_M and _agree(one, reading)
        ]
        if len(near) == 1:
            return replace(reading, label=near[0], identity_unsure=True)
        return replace(reading, label=name)


def _agree(one: CellReading, other: CellReading) -> bool:
    """As `_may_be_same` of two readings."""
    parts = [(getattr(one, name), getattr(other, name)) for name in _PARTS]
    return all(None in pair or pair[0] == pair[1] for pair in parts)
