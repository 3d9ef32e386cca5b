"""What earlier walks heard in squares of 300 m, as rules and the comparison of walks ask for it.

`logger.baseline_file` reads a `Baseline` from SQLite, `logger.baseline_store` makes it. It answers
the same for the same file. It changes with each run, so the live estimate records the answers it
received, as bytes of the source "live": its words can be repeated without the file.

Levels are those of `CellReading.level_dbm`, as each modem printed them: two modems may differ by
several dB. A level at the limit of the modem's scale counts as that level.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import cos, floor, radians, sqrt
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.fix_gate import METRES_PER_DEG

# Squares on the whole Earth, numbered without a map projection. The grid is a reduced
# latitude-longitude grid: belts of 1/370 degree of latitude (299 m at the equator, 302 m at the
# poles), each divided into a whole number of columns that are as close to 300 m as possible. A
# square of UTM would be cut at the border of a zone, and one place would belong to two squares;
# here no border exists, not at a zone, the equator or the date line. Squares of neighbouring belts
# are shifted against each other, so neighbours are found by distance (`squares_within`).

SQUARE_M = 300.0
"""Houses shadow over tens of metres, cells reach kilometres; a walker needs minutes for it."""

_BELTS_PER_DEG = 370
_LAST_BELT = 180 * _BELTS_PER_DEG - 1
_EQUATOR_M = 40_075_017.0
"""Circumference at the equator (WGS 84)."""
_COLUMN_BITS = 18
"""The equator has 133 583 columns."""


def square_of(lat_deg: float, lon_deg: float) -> int:
    """Number of the square that contains a WGS 84 position."""
    belt = _belt(lat_deg)
    return belt << _COLUMN_BITS | _column(belt, lon_deg)


def squares_of(lat_lon_deg: FloatArray) -> IntArray:
    """Number of the square of each position (2, n), shape (n,); equal to `square_of`."""
    lat_deg, lon_deg = lat_lon_deg
    belt = np.clip(np.floor((lat_deg + 90.0) * _BELTS_PER_DEG), 0, _LAST_BELT).astype(np.int64)
    belts, which = np.unique(belt, return_inverse=True)
    n_columns = np.array([_columns(int(b)) for b in belts], np.int64)[which]
    column = np.floor((lon_deg + 180.0) / 360.0 * n_columns).astype(np.int64) % n_columns
    return np.asarray(belt << _COLUMN_BITS | column, np.int64)


def squares_within(lat_deg: float, lon_deg: float, radius_m: float) -> list[int]:
    """Squares that a disc around a position touches; the first is that of the position.

    Up to 84 degrees of latitude, where cellwalk ends; the radius is small against the Earth.
    """
    belt_m, reach_deg = METRES_PER_DEG / _BELTS_PER_DEG, radius_m / METRES_PER_DEG
    here, north_m = square_of(lat_deg, lon_deg), (lat_deg + 90.0) * METRES_PER_DEG
    touched = [here]
    for belt in range(_belt(lat_deg - reach_deg), _belt(lat_deg + reach_deg) + 1):
        apart_m = max(belt * belt_m - north_m, north_m - (belt + 1) * belt_m, 0.0)
        half_m = sqrt(max(radius_m**2 - apart_m**2, 0.0))
        # one width for belt and position: the cosine changes by less than 0.1 % between them
        half_deg = half_m / (METRES_PER_DEG * cos(radians(_middle_deg(belt))))
        n = _columns(belt)
        first, last = (
            floor((lon_deg + sign * half_deg + 180.0) / 360.0 * n) for sign in (-1.0, 1.0)
        )
        columns = [column % n for column in range(first, min(last, first + n - 1) + 1)]
        touched += [belt << _COLUMN_BITS | column for column in columns]
    return list(dict.fromkeys(touched))


def _belt(lat_deg: float) -> int:
    return min(max(floor((lat_deg + 90.0) * _BELTS_PER_DEG), 0), _LAST_BELT)


def _middle_deg(belt: int) -> float:
    return (belt + 0.5) / _BELTS_PER_DEG - 90.0


def _column(belt: int, lon_deg: float) -> int:
    n = _columns(belt)
    return floor((lon_deg + 180.0) / 360.0 * n) % n


@lru_cache(maxsize=4096)
def _columns(belt: int) -> int:
    """The whole number of squares that makes them closest to 300 m wide."""
    return max(round(_EQUATOR_M * cos(radians(_middle_deg(belt))) / SQUARE_M), 1)


# --- earlier walks ---

READ, UNREADABLE = "baseline", "baseline-unreadable"
"""Codes of the events: a baseline is read, and none is from now on."""
FILE, SQUARE, CELL, CHANNELS, TRUST = "file", "square", "cell", "channels", "trust"
DOUBT = "doubt"
"""Kinds of answers."""


@dataclass(frozen=True, slots=True)
class HeardInSquare:
    """How earlier walks heard one cell in one square.

    `n_walks` walks heard it in `n_scans` scans. `best_dbm` is the strongest level of all walks,
    `least_best_dbm` the lowest among the strongest levels of each walk. `mean_dbm` and `sigma_db`
    are of all scans; `sigma_db` is 0 for a single one.
    """

    n_walks: int
    n_scans: int
    best_dbm: float
    least_best_dbm: float
    mean_dbm: float
    sigma_db: float


@dataclass(frozen=True, slots=True)
class SquareHistory:
    """Earlier walks in one square.

    `n_walks` has, by technology ("GSM", "LTE", ...; "" where none was printed), the walks in which
    the modem named a cell of it here: only these could have heard another one. `cells` has the
    cells by name.
    """

    square: int
    n_walks: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    cells: Mapping[str, HeardInSquare] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, slots=True)
class KnownCell:
    """A cell that earlier walks heard, anywhere.

    `rat` is its technology, "" if unknown. `channels` has its pairs (channel number, code); the
    code is BSIC, PSC or PCI, and either is None where not printed. `best_dbm` is the strongest
    level of all walks.
    """

    name: str
    rat: str
    n_walks: int
    n_scans: int
    n_squares: int
    best_dbm: float
    channels: frozenset[tuple[int | None, int | None]]


_ANSWERS: Mapping[str, Any] = MappingProxyType(
    {
        FILE: int,
        SQUARE: SquareHistory,
        CELL: KnownCell,
        CHANNELS: dict[int, int],
        TRUST: str,
        DOUBT: bool,
    }
)


class Baseline(ABC):
    """Earlier walks. A cell that was named by one scan only is unknown, as on a walk.

    `n_walks` is their number; 0 means that there is nothing to compare with. `fingerprint` is a
    digest of all walks and of what is trusted: equal for baselines that answer the same.
    """

    n_walks: int
    fingerprint: str

    @abstractmethod
    def ask(self, kind: str, key: Any) -> Any:
        """The answer of a kind about a key; None where it is unknown."""

    def square(self, square: int) -> SquareHistory:
        """Earlier walks in a square, numbered as in `logger.core.baseline`; empty if unvisited."""
        known: SquareHistory | None = self.ask(SQUARE, square)
        return known or SquareHistory(square)

    def cell(self, name: str) -> KnownCell | None:
        """What is known of the cell `mcc-mnc-area-cid`; None if no earlier walk heard it."""
        known: KnownCell | None = self.ask(CELL, name)
        return known

    def channels(self, mcc: str, mnc: str, rat: str) -> Mapping[int, int]:
        """Channel numbers on which cells of an operator were heard, with the number of cells."""
        known: Mapping[int, int] | None = self.ask(CHANNELS, (mcc, mnc, rat))
        return known or {}

    def trust_note(self, name: str) -> str | None:
        """The user's note about a cell that is trusted; None if it is not."""
        note: str | None = self.ask(TRUST, name)
        return note

    def is_doubted(self, name: str) -> bool:
        """Whether a cell was heard and not learnt."""
        return bool(self.ask(DOUBT, name))


class NotedBaseline(Baseline):
    """What a live estimate received, in lines of `answer_line`; without lines nothing."""

    def __init__(self, text: bytes = b"") -> None:
        self._answers: dict[str, dict[Any, Any]] = {kind: {} for kind in _ANSWERS}
        for line in text.splitlines():
            kind, key, answer = msgspec.json.decode(line)
            known = self._answers[kind]  # a list is no key
            known[tuple(key) if kind == CHANNELS else key] = msgspec.convert(
                answer, _ANSWERS[kind], str_keys=True
            )
        ((self.fingerprint, self.n_walks),) = self._answers[FILE].items() or [("", 0)]

    def ask(self, kind: str, key: Any) -> Any:
        return self._answers[kind].get(key)


NO_BASELINE = NotedBaseline()


def answer_line(kind: str, key: Any, answer: Any) -> bytes:
    """An answer as a line of JSON; empty for one that says nothing."""
    is_empty = kind != FILE and not (answer.n_walks if kind == SQUARE else answer)
    return b"" if is_empty else msgspec.json.encode((kind, key, answer), enc_hook=dict) + b"\n"


def baseline_of(run: Any) -> Baseline:
    """The baseline by its answers to the live estimate of a run."""
    try:
        return NotedBaseline(_noted_in(run))
    except (msgspec.MsgspecError, LookupError, TypeError, ValueError):  # no recorder of ours
        return NO_BASELINE


def has_whole_baseline(run: Any) -> bool:
    """Whether `baseline_of` answers as on the walk.

    Not where the file failed on the way, nor for runs of versions that recorded no answers.
    """
    codes = run.tables["notes"]["code"]
    is_read, has_failed = (bool(np.any(codes == code.encode())) for code in (READ, UNREADABLE))
    return not is_read or (not has_failed and bool(_noted_in(run)))


def _noted_in(run: Any) -> bytes:
    raw = run.tables["raw"]
    noted: bytes = run.bytes_of(raw[raw["source"] == b"live"])
    return noted


def squares_around(
    baseline: Baseline, lat_deg: float, lon_deg: float, radius_m: float
) -> tuple[SquareHistory, ...]:
    """Earlier walks in all squares that a disc touches; the first is the square of the position."""
    return tuple(baseline.square(square) for square in squares_within(lat_deg, lon_deg, radius_m))


def best_dbm(squares: tuple[SquareHistory, ...], name: str) -> float | None:
    """Strongest level of a cell in some squares; None if it was heard in none."""
    heard = [square.cells[name].best_dbm for square in squares if name in square.cells]
    return max(heard, default=None)
