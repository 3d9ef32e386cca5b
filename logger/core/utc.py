"""UTC: the times that a run can have, and their text."""

from datetime import UTC, datetime, timedelta

EARLIEST_UTC_NS = 1_577_836_800 * 10**9
"""2020-01-01, before any run of this program.

A receiver that is wrong by a rollover of GPS's week counter is outside of the 1024 weeks from here,
as is a clock that was never set.
"""
LATEST_UTC_NS = EARLIEST_UTC_NS + 1024 * 7 * 86_400 * 10**9

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def utc_text(utc_ns: int, *, compact: bool = False) -> str:
    """ISO 8601 to the second, `20200207T021417Z` when compact."""
    when = _EPOCH + timedelta(microseconds=utc_ns // 1000)
    return when.strftime("%Y%m%dT%H%M%SZ" if compact else "%Y-%m-%dT%H:%M:%SZ")
