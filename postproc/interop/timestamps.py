"""Times as text and as seconds."""

from logger.core.utc import utc_text


def moment(utc_ns: int | None) -> str | None:
    """ISO 8601 in UTC, to the millisecond."""
    return None if utc_ns is None else f"{utc_text(utc_ns)[:-1]}.{utc_ns // 10**6 % 1000:03d}Z"


def seconds(t_ns: int) -> float:
    """Seconds, to the millisecond."""
    return round(t_ns / 1e9, 3)
