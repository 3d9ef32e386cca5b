"""Times as other programs write them, read and written: since 1970, ISO 8601, or a telephone's."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime

from logger.core.utc import utc_text
from postproc.interop.fields import ns_since_1970, utc_ns_of

_YEAR_FIRST = re.compile(
    r"(\d{4})[-./](\d{1,2})[-./](\d{1,2})[ T_](\d{1,2})[:.](\d{2})[:.](\d{2})(?:[.,](\d{1,9}))?"
)
_DAY_FIRST = re.compile(
    r"(\d{1,2})\.(\d{1,2})\.(\d{4})[ T_](\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?"
)
"""With dots only: with slashes nobody knows which of two numbers is the month."""
_TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?")
_SINCE_1970 = re.compile(r"(\d{9,10})(?:[.,](\d{1,9}))?|(\d{12,13})(?:[.,]\d+)?")


@dataclass(frozen=True, slots=True)
class Moment:
    """Nanoseconds since 1970 in UTC, or by a clock whose zone the file does not name."""

    t_ns: int
    is_utc: bool

    @property
    def utc_ns(self) -> int | None:
        return self.t_ns if self.is_utc else None


def moment_of(time: str, name: str) -> Moment:
    """The moment that a text means; raises ValueError for none, naming the column.

    Nine or ten digits are seconds since 1970, twelve or thirteen are milliseconds. A time of day
    without a date counts from 1970.
    """
    if not time:
        raise ValueError(f"{name} is empty")
    if found := _SINCE_1970.fullmatch(time):
        if found[3]:
            return Moment(int(found[3]) * 10**6, is_utc=True)
        return Moment(int(found[1]) * 10**9 + _fraction_ns(found[2]), is_utc=True)
    if found := _YEAR_FIRST.fullmatch(time):
        year, month, day, *clock = found.groups()
        return _by_clock(time, name, (year, month, day), clock)
    if found := _DAY_FIRST.fullmatch(time):
        day, month, year, *clock = found.groups()
        return _by_clock(time, name, (year, month, day), clock)
    if found := _TIME_OF_DAY.fullmatch(time):
        return _by_clock(time, name, ("1970", "1", "1"), list(found.groups()))
    return Moment(utc_ns_of(time, name), is_utc=True)


def _by_clock(time: str, name: str, date: tuple[str, str, str], clock: list[str | None]) -> Moment:
    hour, minute, second, fraction = clock
    try:
        when = datetime(*(int(part or 0) for part in (*date, hour, minute, second)), tzinfo=UTC)  # type: ignore[misc, arg-type]
    except ValueError as error:
        raise ValueError(f"{name} is no time: {time[:40]!r} ({error})") from None
    return Moment(ns_since_1970(when, name) + _fraction_ns(fraction), is_utc=False)


def _fraction_ns(digits: str | None) -> int:
    return int((digits or "0").ljust(9, "0"))


def moment(utc_ns: int | None) -> str | None:
    """ISO 8601 in UTC, to the millisecond."""
    return None if utc_ns is None else f"{utc_text(utc_ns)[:-1]}.{utc_ns // 10**6 % 1000:03d}Z"


def seconds(t_ns: int) -> float:
    """Seconds, to the millisecond."""
    return round(t_ns / 1e9, 3)
