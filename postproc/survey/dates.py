"""Days that a user names."""

from datetime import UTC, date, datetime

from logger.core.errors import ConfigError


def day_utc_ns(text: str) -> int:
    """Begin of a day in UTC, in ns since 1970; raises `ConfigError`."""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        raise ConfigError(f"{text[:40]!r} is no date, such as 2026-11-01") from None
    return int(datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()) * 10**9
