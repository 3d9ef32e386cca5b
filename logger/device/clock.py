"""The time of a run: since boot, never wall time; faster for a simulated walk."""

import threading
import time
from pathlib import Path

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class Clock:
    """CLOCK_BOOTTIME: monotonic, counts suspend, and immune to whatever sets the wall clock.

    Time is an argument: whoever waits or stamps is given a clock.
    """

    def now_ns(self) -> int:
        """Nanoseconds since boot."""
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)

    def wait(self, event: threading.Event, seconds: float) -> bool:
        """Sleep until the event is set (True) or the seconds of this clock have passed (False)."""
        return event.wait(self.real_s(seconds))

    def real_s(self, seconds: float) -> float:
        """Real duration of this clock's seconds, for timeouts of the system."""
        return seconds

    def real_now_s(self) -> float:
        """Now in real seconds: a modem needs its time, however fast a simulated walk runs."""
        return self.real_s(self.now_ns() / 1e9)


class ScaledClock(Clock):
    """A clock that runs `rate` times faster than the real one, from zero."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._start_ns = time.monotonic_ns()

    def now_ns(self) -> int:
        return round((time.monotonic_ns() - self._start_ns) * self._rate)

    def real_s(self, seconds: float) -> float:
        return seconds / self._rate


def boot_id() -> str:
    """The kernel's identity of this boot, or "unknown" where there is none."""
    try:
        return _BOOT_ID.read_text().strip()
    except OSError:
        return "unknown"
