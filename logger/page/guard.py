"""What the page refuses: floods, strangers, other names of this machine."""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from logger.core.latest import Latest

PER_S, BURST = 20.0, 60.0
"""Requests of one phone: the page makes two a second, and about twenty when it is opened."""
ALL_PER_S, ALL_BURST = 100.0, 300.0
WRITES_PER_S, WRITE_BURST = 1.0, 5.0
"""Marks and cells to follow."""
_MOST_ADDRESSES = 256
TOKEN_S = 1.0
"""A phone's request arrives in a fraction of this, also over a poor Wi-Fi."""


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


class Connection(Protocol):
    """What `Places` needs of tornado's IOStream."""

    def close(self) -> None: ...
    def closed(self) -> bool: ...
    def writing(self) -> bool: ...


@dataclass
class _Holder:
    """Who holds a place; `is_known` after a request with the token, `is_busy` during one."""

    address: str
    since_s: float
    is_known: bool = False
    is_busy: bool = False


class Places:
    """The places of connections, at most so many and so many of one address.

    Where they are taken, one gives way to a newcomer: a connection that could have brought the
    token by now and has not, else one that waits for its next request, else one that is new, else
    one of an address that has two more than the newcomer's. Among these it is the oldest one of the
    address that has the most of them.
    """

    def __init__(
        self, most: int, most_of_one: int, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._most, self._most_of_one = most, most_of_one
        self._clock_s = clock_s
        self._holders: dict[Connection, _Holder] = {}

    def admit(self, connection: Connection, address: str) -> bool:
        """Give a place, if need be that of another, which is closed; False without one."""
        self._holders = {one: who for one, who in self._holders.items() if not one.closed()}
        n_held = Counter(who.address for who in self._holders.values())
        is_full = len(self._holders) >= self._most
        if is_full or n_held[address] >= self._most_of_one:
            leaves = self._one_to_leave(n_held, address)
            if leaves is None:
                return False
            leaves.close()
            del self._holders[leaves]
        self._holders[connection] = _Holder(address, self._clock_s())
        return True

    def begin(self, connection: Connection) -> None:
        """Note that a connection has brought a complete request with the token."""
        if holder := self._holders.get(connection):
            holder.is_known = holder.is_busy = True

    def end(self, connection: Connection) -> None:
        """Note that its request is answered; what is written may still be under way."""
        if holder := self._holders.get(connection):
            holder.is_busy = False

    def _one_to_leave(self, n_held: Counter[str], address: str) -> Connection | None:
        """The connection that gives way to one of an address."""
        has_all_of_one = n_held[address] >= self._most_of_one
        holders = [
            (one, who)
            for one, who in self._holders.items()
            if who.address == address or not has_all_of_one
        ]
        strangers = [pair for pair in holders if not pair[1].is_known]
        idle = [
            (one, who)
            for one, who in holders
            if who.is_known and not who.is_busy and not one.writing()
        ]
        greedy = [pair for pair in holders if n_held[pair[1].address] > n_held[address] + 1]
        late = [pair for pair in strangers if self._clock_s() - pair[1].since_s > TOKEN_S]
        pool = late or idle or strangers or greedy
        n_of_pool = Counter(who.address for _, who in pool)
        oldest = max(pool, key=lambda pair: n_of_pool[pair[1].address], default=None)
        return None if oldest is None else oldest[0]


def host_names(address: str, port: int) -> frozenset[str]:
    """Values of Host that name this page: the address alone, since DNS may name any machine."""
    host = f"[{address}]" if ":" in address else address
    return frozenset({f"{host}:{port}"} | ({host} if port == 80 else set()))
