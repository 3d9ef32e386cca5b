"""Time of a walk: seconds since it began, by a clock that may run faster than the real one."""

import threading
from typing import Protocol


class Clock(Protocol):
    """What the simulator needs of a clock."""

    def now_ns(self) -> int:
        """Nanoseconds since any moment."""
        ...

    def wait(self, event: threading.Event, seconds: float) -> bool:
        """Sleep until the event is set (True) or the seconds of this clock have passed (False)."""
        ...


class WalkTime:
    """The walk begins when this is made; shared by the devices that are carried along it."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._start_ns = clock.now_ns()

    def now_s(self) -> float:
        return (self._clock.now_ns() - self._start_ns) / 1e9

    def wait_until(self, event: threading.Event, t_s: float) -> bool:
        """Sleep until the event is set (True) or it is `t_s` (False)."""
        while not event.is_set():
            left_s = t_s - self.now_s()
            if left_s <= 0.0:
                return False
            self._clock.wait(event, left_s)
        return True
