"""What held at a time not long ago."""

from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")

_KEPT = 4000
"""A scan of all networks takes up to three minutes, and a fast receiver gives ten fixes a
second.
"""


class SampleHold(Generic[T]):
    """Values in the order of their times, each holding until the next one or until it is too
    old.
    """

    def __init__(self, max_age_s: float) -> None:
        self._max_age_ns = round(max_age_s * 1e9)
        self._entries: deque[tuple[int, T | None]] = deque(maxlen=_KEPT)

    @property
    def last(self) -> T | None:
        return self._entries[-1][1] if self._entries else None

    def add(self, t_ns: int, value: T | None) -> None:
        """From this time on it is `value`; None where nothing is known from then on."""
        self._entries.append((t_ns, value))

    def at(self, t_ns: int) -> T | None:
        """What held then, None without a fresh value."""
        since_ns, value = next(
            (entry for entry in reversed(self._entries) if entry[0] <= t_ns), (0, None)
        )
        return value if t_ns - since_ns <= self._max_age_ns else None
