"""What came last, in bounded memory: a dict, and the value current at some time."""

from collections import deque
from collections.abc import Container
from typing import Generic, TypeVar

T = TypeVar("T")

_CAPACITY = 4000
"""A scan of all networks takes up to 3 min, and a fast receiver gives 10 fixes a second."""


class Latest(dict[str, T]):
    """The entries put last, in order of time, at most `most` of them."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def has_room(self, key: str, among: Container[str]) -> bool:
        """Whether an entry fits, and none `among` these goes."""
        return key in self or len(self) < self._most or next(iter(self)) not in among

    def put(self, key: str, value: T) -> None:
        """Set an entry; of too many the oldest goes."""
        self.pop(key, None)
        self[key] = value
        if len(self) > self._most:
            del self[next(iter(self))]


class SampleHold(Generic[T]):
    """Values by their times, each current until the next one or too old."""

    def __init__(self, max_age_s: float) -> None:
        self._max_age_ns = round(max_age_s * 1e9)
        self._entries: deque[tuple[int, T | None]] = deque(maxlen=_CAPACITY)

    @property
    def last(self) -> T | None:
        """The newest value, however old."""
        return self._entries[-1][1] if self._entries else None

    def add(self, t_ns: int, value: T | None) -> None:
        """From this time on `value` is current; None means unknown."""
        self._entries.append((t_ns, value))

    def at(self, t_ns: int) -> T | None:
        """The value current then, None without a recent one."""
        before = (entry for entry in reversed(self._entries) if entry[0] <= t_ns)
        since_ns, value = next(before, (0, None))
        return value if t_ns - since_ns <= self._max_age_ns else None
