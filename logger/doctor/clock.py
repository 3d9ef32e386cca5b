"""Test of the clocks: that of the receiver must be right, that of the machine need not."""

import time

from logger.core.column import UNKNOWN_TIME
from logger.core.runfile import Run
from logger.core.timebase import fit_run
from logger.core.utc import EARLIEST_UTC_NS, LATEST_UTC_NS, utc_text
from logger.device.check_line import Line

_CLOSE_S = 5.0


def wall_minus_boot_ns() -> int:
    """UTC by the machine's clock at a time since boot of 0."""
    return time.clock_gettime_ns(time.CLOCK_REALTIME) - time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def clock_line(run: Run, wall_ns: int) -> Line:
    """Compare the receiver's UTC with the machine's clock; `wall_ns` is `wall_minus_boot_ns`."""
    fixes = run.tables["fixes"]
    valid = fixes[(fixes["valid"] == 1) & (fixes["utc_ns"] != UNKNOWN_TIME)]
    if not len(valid):
        return Line("ok", "clock", "no time from the receiver yet; the machine's clock is not used")
    utc_ns = int(valid["utc_ns"][-1])
    if not EARLIEST_UTC_NS <= utc_ns < LATEST_UTC_NS:
        text = f"the receiver reports {utc_text(utc_ns)}: the date of its runs will be unknown"
        return Line("warn", "clock", text)
    timebase = fit_run(run.meta.origin, fixes)
    if timebase is None:
        text = "the receiver's times contradict each other: a bad connection, or a fake signal"
        return Line("warn", "clock", text)
    off_s = (wall_ns - timebase.utc_ns(0)) / 1e9
    if abs(off_s) <= _CLOSE_S:
        return Line("ok", "clock", "the machine's clock agrees with the receiver")
    days, seconds = divmod(abs(off_s), 86_400)
    amount = f"{days:.0f} days" if days else f"{seconds:.0f} s"
    side = "ahead of" if off_s > 0 else "behind"
    text = f"the machine's clock is {amount} {side} the receiver; runs take their time from it"
    return Line("ok", "clock", text)
