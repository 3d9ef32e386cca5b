"""What the page refuses: floods, strangers, other names of this machine."""

import time
from collections.abc import Callable

from logger.core.latest import Latest

PER_S, BURST = 20.0, 60.0
"""Requests of one phone: the page makes two a second, and about twenty when it is opened."""
ALL_PER_S, ALL_BURST = 100.0, 300.0
WRITES_PER_S, WRITE_BURST = 1.0, 5.0
"""Marks and cells to follow."""
_MOST_ADDRESSES = 256


class Bucket:
    """Holds `burst` tokens at most and gains `per_s`; each request takes one."""

    def __init__(self, per_s: float, burst: float, now_s: float) -> None:
        self._per_s, self._burst = per_s, burst
        self._left, self._at_s = burst, now_s

    def take(self, now_s: float) -> bool:
        """Whether one more is allowed."""
        self._left = min(self._burst, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Limits:
    """Limits of requests for each address and for all together."""

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._all = Bucket(ALL_PER_S, ALL_BURST, clock_s())
        self._reads: Latest[Bucket] = Latest(_MOST_ADDRESSES)
        self._writes: Latest[Bucket] = Latest(_MOST_ADDRESSES)

    def allows(self, address: str, *, write: bool) -> bool:
        """Whether this request may be answered; a flood of one does not use up that of all."""
        now_s = self._clock_s()
        one = self._reads.get(address) or Bucket(PER_S, BURST, now_s)
        self._reads.put(address, one)
        if not one.take(now_s) or not self._all.take(now_s):
            return False
        if not write:
            return True
        bucket = self._writes.get(address) or Bucket(WRITES_PER_S, WRITE_BURST, now_s)
        self._writes.put(address, bucket)
        return bucket.take(now_s)


def host_names(address: str, port: int) -> frozenset[str]:
    """Values of Host that name this page: the address alone, since DNS may name any machine."""
    host = f"[{address}]" if ":" in address else address
    return frozenset({f"{host}:{port}"} | ({host} if port == 80 else set()))
