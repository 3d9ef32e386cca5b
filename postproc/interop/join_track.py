"""UTC and positions for rows that lack them: by the zone of their clock, and by a track."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from logger.core.errors import ConfigError
from postproc.interop.sighting import BadRow, Row, Sighting
from postproc.interop.track_file import MOST_APART_S, GpsTrack


def zone_named(name: str) -> ZoneInfo:
    """A time zone by its name; raises `ConfigError` for none."""
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise ConfigError(
            f"--zone: {name[:40]!r} is no time zone, such as Europe/Berlin or UTC"
        ) from None


def in_zone(rows: Iterable[Row], zone: ZoneInfo) -> Iterator[Row]:
    """The same rows with UTC where only a local time was known."""
    for row in rows:
        if isinstance(row, Sighting) and row.fix.utc_ns is None:
            utc_ns = _utc_ns(row.t_ns, zone)
            yield replace(row, t_ns=utc_ns, fix=replace(row.fix, utc_ns=utc_ns))
        else:
            yield row


def on_track(rows: Iterable[Row], track: GpsTrack) -> Iterator[Row]:
    """The same rows at the positions of a track, whatever position they had."""
    for row in rows:
        if not isinstance(row, Sighting):
            yield row
        elif row.fix.utc_ns is None:
            yield BadRow(
                row.line, "its time has no zone: name it, for example --zone Europe/Berlin"
            )
        elif (fix := track.at(row.fix.utc_ns)) is None:
            yield BadRow(row.line, f"the track has no points within {MOST_APART_S:.0f} s of it")
        else:
            yield replace(row, t_ns=row.fix.utc_ns, fix=fix)


def with_position(rows: Iterable[Row]) -> Iterator[Row]:
    """The same rows; those without a position are bad."""
    for row in rows:
        if isinstance(row, Sighting) and not row.fix.valid:
            yield BadRow(row.line, "no position: add the GPX track of the walk with --track")
        else:
            yield row


def _utc_ns(local_ns: int, zone: ZoneInfo) -> int:
    seconds, rest_ns = divmod(local_ns, 10**9)
    local = (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)).replace(tzinfo=zone)
    since = local.astimezone(UTC) - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 10**9 + rest_ns
