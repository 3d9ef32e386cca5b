"""A row of any third-party format: one cell received at one position."""

import marshal
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from dataclasses import fields as fields_of
from operator import attrgetter
from pathlib import Path
from tempfile import TemporaryFile
from typing import TypeVar

import numpy as np

from logger.core.arrays import BoolArray, IntArray
from logger.core.errors import GeoError
from logger.core.places import Places, Track, fix_sigma_m
from logger.core.types import Broadcast, CellReading, Fix

Fields = TypeVar("Fields")
REMARK = "remark"
"""Code of the note of a warning."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """One cell received at one position.

    `line` is the number of the line, row or record, `t_ns` gives the order in time; `fix.utc_ns` is
    None where the file has no UTC, and `fix.valid` is False where it has no position. `receiver`
    tells the receivers of one modem apart.
    """

    line: int
    t_ns: int
    fix: Fix
    reading: CellReading
    receiver: int = 0

    @property
    def lat_deg(self) -> float:
        return _number_of(self.fix.lat_deg)

    @property
    def lon_deg(self) -> float:
        return _number_of(self.fix.lon_deg)

    @property
    def rssi_dbm(self) -> float:
        """Level, whatever the technology calls it."""
        return _number_of(self.reading.level_dbm)


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that could not be used, and why."""

    line: int
    why: str


@dataclass(frozen=True, slots=True)
class NoCell:
    """Rows about something else: Wi-Fi, Bluetooth, a technology without a 3GPP cell identity."""

    line: int
    why: str = "no cell"
    n: int = 1


@dataclass(frozen=True, slots=True)
class Remark:
    """What another program noticed at a time, for example a warning; `code` is that of its note."""

    line: int
    utc_ns: int
    text: str
    code: str = REMARK


Row = Sighting | BadRow | NoCell | Remark
Parsed = Row | Sequence[Row] | None


def parse_rows(
    rows: Iterable[tuple[int, Fields]], parse: Callable[[int, Fields], Parsed]
) -> Iterator[Row]:
    """Parsed rows with line numbers; `parse` returns None for no cell, raises for bad rows."""
    for line, fields in rows:
        try:
            parsed = parse(line, fields)
        except (ValueError, GeoError) as error:
            yield BadRow(line, str(error))
        except RecursionError:
            yield BadRow(line, "its values are nested too deeply")
        else:
            yield from parsed if isinstance(parsed, Sequence) else [parsed or NoCell(line)]


def _number_of(value: float | None) -> float:
    if value is None:
        raise TypeError("a sighting has a position and a level")
    return value


_READING = [f.name for f in fields_of(CellReading) if f.name not in {"broadcast", "more"}]
_VALUES_OF = {
    kind: attrgetter(*names)
    for kind, names in (
        (Fix, [f.name for f in fields_of(Fix)]),
        (Broadcast, [f.name for f in fields_of(Broadcast)]),
        (CellReading, _READING),
    )
}


class SightingFile:
    """Sightings, at first in the order in which they came; in memory are 56 bytes of each.

    The file has no name and goes with the object. Raises OSError where it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._file = TemporaryFile(dir=folder)  # noqa: SIM115 (closed with this object)
        self._at = array("q", [0])
        self._t_ns, self._hashes = array("q"), array("q")
        self._place = array("d")
        self._order: IntArray | None = None

    def close(self) -> None:
        """Remove the file."""
        self._file.close()

    def append(self, one: Sighting) -> None:
        """Add a sighting behind the others, before anything is asked."""
        fix, reading = one.fix, one.reading
        broadcast = _VALUES_OF[Broadcast](reading.broadcast) if reading.broadcast else None
        known = _VALUES_OF[Fix](fix), _VALUES_OF[CellReading](reading), broadcast
        data = marshal.dumps((one.line, one.t_ns, *known, one.receiver))
        self._file.write(data)
        self._at.append(self._at[-1] + len(data))
        self._t_ns.append(one.t_ns)
        self._hashes.append(hash((one.t_ns, fix, reading)))
        if fix.valid:
            sigma_m = fix_sigma_m(fix.acc_m, fix.hdop, fix.quality)
            self._place.extend((one.lat_deg, one.lon_deg, sigma_m))

    def __len__(self) -> int:
        return len(self._t_ns if self._order is None else self._order)

    def __iter__(self) -> Iterator[Sighting]:
        self._file.flush()
        for i in self._order_of_rows().tolist():
            yield self._read(i)

    def leave_out_repeated(self) -> None:
        """Keep one of equal sightings, the last."""
        order = self._order_of_rows()
        hashes = np.frombuffer(self._hashes, np.int64)[order]
        by_hash = np.argsort(hashes, kind="stable")
        same = np.flatnonzero(np.diff(hashes[by_hash]) == 0)
        keep: BoolArray = np.ones(len(order), np.bool_)
        self._file.flush()
        for i in same.tolist():
            one, next_ = (int(order[by_hash[k]]) for k in (i, i + 1))
            if self._key(one) == self._key(next_):  # hashes may be equal by chance
                keep[by_hash[i]] = False
        self._order = order[keep]

    def leave_out_before(self, t_ns: int) -> int:
        """Leave out those before a time if there are any after it; how many were left out."""
        order = self._order_of_rows()
        is_after = np.frombuffer(self._t_ns, np.int64)[order] >= t_ns
        if not np.any(is_after):
            return 0
        self._order = order[is_after]
        return int(np.count_nonzero(~is_after))

    def span_ns(self) -> tuple[int, int]:
        """First and last time of those that are left, at least one."""
        t_ns = np.frombuffer(self._t_ns, np.int64)[self._order_of_rows()]
        return int(t_ns.min()), int(t_ns.max())

    def sort_by_time(self) -> bool:
        """Sort them, those of one time as they came; whether they were out of order."""
        order = self._order_of_rows()
        t_ns = np.frombuffer(self._t_ns, np.int64)[order]
        if np.all(np.diff(t_ns) >= 0):
            return False
        self._order = order[np.argsort(t_ns, kind="stable")]
        return True

    def track(self) -> Track:
        """Positions, which all have, each once at a time; raises `GeoError` outside of UTM."""
        order = self._order_of_rows()
        t_ns = np.frombuffer(self._t_ns, np.int64)[order]
        place = np.frombuffer(self._place).reshape(-1, 3)[order]
        _, first = np.unique(np.column_stack([t_ns, place]), axis=0, return_index=True)
        first.sort()
        lat_deg, lon_deg, sigma_m = place[first].T
        at = Places.of_degrees(lat_deg, lon_deg)
        seq = np.arange(len(first))
        return Track(at.x_m, at.y_m, at.z_m, sigma_m, t_ns[first], at.utm, seq=seq)

    def _order_of_rows(self) -> IntArray:
        if self._order is None:
            self._order = np.arange(len(self._t_ns))
        return self._order

    def _key(self, i: int) -> tuple[object, ...]:
        one = self._read(i)
        return one.t_ns, one.fix, one.reading

    def _read(self, i: int) -> Sighting:
        self._file.seek(self._at[i])
        data = self._file.read(self._at[i + 1] - self._at[i])
        values = marshal.loads(data)  # noqa: S302 (written above)
        line, t_ns, fix, reading, broadcast, receiver = values
        more = dict(zip(_READING, reading, strict=True))
        if broadcast is not None:
            more["broadcast"] = Broadcast(*broadcast)
        return Sighting(line, t_ns, Fix(*fix), CellReading(**more), receiver)
