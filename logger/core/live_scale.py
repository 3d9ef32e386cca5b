"""The levels of one cell on the scale of the modem that heard it first, reading by reading.

One walker carries all modems. So what two of them read of a cell at one place differs by their
offset and by fading alone, whatever stands between them and the cell. The desktop program takes the
offsets as unknowns of the model instead (`logger.core.locator.offsets`).
"""

from collections import deque
from dataclasses import dataclass, field, replace
from math import hypot, sqrt

from logger.core.readings import Readings

CERTAIN_DB = 1.0
"""Sigma of an offset from which on a modem counts, as in a survey: levels are integers in dB."""
_NEAR_M = 10.0
"""Way of a walker between two polls, and far less than what shadowing needs to change."""
_FADING_DB, _FADING_PAIRS = 4.0, 8
"""Difference of two readings with 3 dB of fading each, and how many pairs that is worth: the first
few may agree by chance."""
_MOST_WAITING = 100
MANY_MORE = 30
"""A minute of polls: a modem that is not away has been compared by then."""


@dataclass(slots=True)
class _Compared:
    """What a modem reads above the first: mean of `n` pairs, and their sum of squares about it."""

    n: int = 0
    mean_db: float = 0.0
    squares_db2: float = 0.0
    n_waiting: int = 0
    waiting: deque[Readings] = field(default_factory=lambda: deque(maxlen=_MOST_WAITING))
    is_paired: bool = True

    @property
    def sigma_db(self) -> float:
        """Standard deviation of the mean."""
        variance_db2 = _FADING_DB**2 * _FADING_PAIRS + self.squares_db2
        return sqrt(variance_db2 / (_FADING_PAIRS + max(self.n - 1, 0)) / max(self.n, 1))

    def add(self, above_db: float) -> None:
        self.n += 1
        change_db = above_db - self.mean_db
        self.mean_db += change_db / self.n
        self.squares_db2 += change_db * (above_db - self.mean_db)


class LiveScale:
    """Of one cell; `first` is the modem whose scale it is."""

    def __init__(self) -> None:
        self.first: str | None = None
        self._latest: Readings | None = None
        self._others: dict[str, _Compared] = {}

    def take(self, modem: str, reading: Readings) -> Readings | None:
        """A reading on the scale of the first modem; None while the offset is not certain."""
        if self.first is None:
            self.first = modem
        if modem == self.first:
            self._latest = reading
            for other in self._others.values():
                other.is_paired = False
            return reading
        other = self._others.setdefault(modem, _Compared(is_paired=False))
        self._compare(other, reading)
        if other.sigma_db > CERTAIN_DB:
            other.n_waiting += 1
            other.waiting.append(reading)
            return None
        other.waiting.clear()
        limit = reading.limit
        return replace(reading, level_dbm=reading.level_dbm - other.mean_db, known_limit=limit)

    def offset_db(self, modem: str) -> float | None:
        """What a modem reads above the first, None while that is not certain."""
        other = self._others.get(modem)
        return None if other is None or other.sigma_db > CERTAIN_DB else other.mean_db

    def waiting(self, modem: str, n: int) -> tuple[Readings, ...]:
        """The latest readings of a modem that has many more than `n` and cannot be compared."""
        other = self._others.get(modem)
        if other is None or other.n_waiting <= n + MANY_MORE or not other.waiting:
            return ()
        return tuple(other.waiting)

    def _compare(self, other: _Compared, reading: Readings) -> None:
        """Each reading of the first modem is compared once with each other modem."""
        latest = self._latest
        if latest is None or other.is_paired or latest.limit.item() or reading.limit.item():
            return
        east_m = reading.x_m.item() - latest.x_m.item()
        if hypot(east_m, reading.y_m.item() - latest.y_m.item()) <= _NEAR_M:
            other.add(reading.level_dbm.item() - latest.level_dbm.item())
            other.is_paired = True
