"""What earlier walks heard, as rules and the comparison of walks ask for it.

`logger.baseline_file` reads a `Baseline` from SQLite, `logger.baseline_store` makes it. It answers
the same for the same file. It changes with each run, so the live estimate records the answers it
received, as bytes of the source "live": its words can be repeated without the file.

Levels are those of `CellReading.level_dbm`, as each modem printed them: two modems may differ by
several dB. A level at the limit of the modem's scale counts as that level.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Protocol

import msgspec
import numpy as np

from logger.core.squares import squares_within

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
    code is BSIC, PSC or PCI, and either is None where not printed. `strongest_square` is where its
    level was `best_dbm`, the strongest of all walks.
    """

    name: str
    rat: str
    n_walks: int
    n_scans: int
    n_squares: int
    best_dbm: float
    strongest_square: int
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


class Baseline(Protocol):
    """Earlier walks. A cell that was named by one scan only is unknown, as on a walk."""

    @property
    def n_walks(self) -> int:
        """Number of walks; 0 means that there is nothing to compare with."""

    @property
    def fingerprint(self) -> str:
        """Digest of all walks and of what is trusted: equal for baselines that answer the same."""

    def square(self, square: int) -> SquareHistory:
        """Earlier walks in a square, numbered as in `logger.core.squares`; empty if unvisited."""

    def cell(self, name: str) -> KnownCell | None:
        """What is known of the cell `mcc-mnc-area-cid`; None if no earlier walk heard it."""

    def channels(self, mcc: str, mnc: str, rat: str) -> Mapping[int, int]:
        """Channel numbers on which cells of an operator were heard, with the number of cells."""

    def trust_note(self, name: str) -> str | None:
        """The user's note about a cell that is trusted; None if it is not."""

    def is_doubted(self, name: str) -> bool:
        """Whether a cell was heard and not learnt."""


class NotedBaseline:
    """What a live estimate received, in lines of `answer_line`; without lines nothing."""

    def __init__(self, text: bytes = b"") -> None:
        self._answers: dict[str, dict[Any, Any]] = {kind: {} for kind in _ANSWERS}
        for line in text.splitlines():
            kind, key, answer = msgspec.json.decode(line)
            known = self._answers[kind]  # a list is no key
            known[tuple(key) if kind == CHANNELS else key] = msgspec.convert(
                answer, _ANSWERS[kind], str_keys=True
            )
        ((fingerprint, n_walks),) = self._answers[FILE].items() or [("", 0)]
        self.fingerprint: str = fingerprint
        self.n_walks: int = n_walks

    def square(self, square: int) -> SquareHistory:
        return self._answers[SQUARE].get(square) or SquareHistory(square)

    def cell(self, name: str) -> KnownCell | None:
        return self._answers[CELL].get(name)

    def channels(self, mcc: str, mnc: str, rat: str) -> Mapping[int, int]:
        known: Mapping[int, int] = self._answers[CHANNELS].get((mcc, mnc, rat), {})
        return known

    def trust_note(self, name: str) -> str | None:
        return self._answers[TRUST].get(name)

    def is_doubted(self, name: str) -> bool:
        return name in self._answers[DOUBT]


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
    rows = raw[raw["source"] == b"live"] if len(run.raw_bytes) else raw[:0]
    spans = zip(rows["offset"].tolist(), rows["length"].tolist(), strict=True)
    return b"".join(run.raw_bytes[start : start + n].tobytes() for start, n in spans)


def squares_around(
    baseline: Baseline, lat_deg: float, lon_deg: float, radius_m: float
) -> tuple[SquareHistory, ...]:
    """Earlier walks in all squares that a disc touches; the first is the square of the position."""
    return tuple(baseline.square(square) for square in squares_within(lat_deg, lon_deg, radius_m))


def best_dbm(squares: tuple[SquareHistory, ...], name: str) -> float | None:
    """Strongest level of a cell in some squares; None if it was heard in none."""
    heard = [square.cells[name].best_dbm for square in squares if name in square.cells]
    return max(heard, default=None)
