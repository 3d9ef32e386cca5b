"""GPX tracks that give another log its positions.

Source: www.topografix.com/GPX/1/1.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from math import cos, hypot, radians
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from logger.core.errors import ConfigError, GeoError, RunFileError
from logger.core.types import Fix
from postproc.foreign_file import MOST_READINGS, with_limit
from postproc.interop import xml_file
from postproc.interop.contents import look_at, unknown_format
from postproc.interop.decompression import plain_file
from postproc.interop.fields import fix_of, maybe, utc_ns_of
from postproc.interop.sighting import BadRow, Row, Sighting

MOST_APART_S = 60.0
"""Between points farther apart in time, a walker may have been anywhere in a block of houses."""
_DENSE_S = 10.0
"""Within this time a walker goes straight on, to the accuracy of a receiver."""
_DETOUR = 0.25
"""Share of the distance between two points that their straight line may be wrong by."""
_DEGREE_M = 111_200.0


class GpsTrack:
    """Positions by UTC, of at least two points."""

    def __init__(self, fixes: list[Fix]) -> None:
        self.fixes = sorted(
            (fix for fix in fixes if fix.utc_ns is not None), key=lambda fix: fix.utc_ns or 0
        )
        self._utc_ns = [fix.utc_ns or 0 for fix in self.fixes]

    def at(self, utc_ns: int) -> Fix | None:
        """Position at a time, None outside of the track and in its gaps."""
        after = bisect_left(self._utc_ns, utc_ns)
        if after < len(self.fixes) and self._utc_ns[after] == utc_ns:
            return self.fixes[after]
        if not 0 < after < len(self.fixes):
            return None
        first, last = self.fixes[after - 1], self.fixes[after]
        gap_s = (self._utc_ns[after] - self._utc_ns[after - 1]) / 1e9
        share = (utc_ns - self._utc_ns[after - 1]) / 1e9 / gap_s
        return None if gap_s > MOST_APART_S else _between(first, last, share, utc_ns, gap_s)


def read_track(source: Path) -> GpsTrack:
    """Track of a GPX file, also compressed.

    Raises `RunFileError` for another file and for one without two points with a time.
    """
    with plain_file(source) as plain:
        seen = look_at(plain)
        if not (seen.kind == "xml" and seen.has("gpx")):
            raise unknown_format(source, f"{seen.words}, which is no GPX track")
        fixes = list(with_limit(_gpx_fixes(plain), plain, "points", MOST_READINGS))
    track = GpsTrack(fixes)
    if len(track.fixes) < 2:
        raise RunFileError(f"{source} has no track: fewer than two points have a time")
    return track


def _gpx_fixes(source: Path) -> Iterator[Fix]:
    for point in xml_file.elements(source, "trkpt"):
        place = {"lat": point.get("lat", ""), "lon": point.get("lon", "")}
        place |= {name: point.findtext(name) or "" for name in ("ele", "hdop")}
        try:
            utc_ns = utc_ns_of((point.findtext("time") or "").strip(), "time")
            known = {"alt_m": maybe(place, "ele"), "hdop": maybe(place, "hdop", (0.0, 100.0))}
            yield fix_of(place, "lat", "lon", utc_ns, **known)
        except (ValueError, GeoError):
            continue


def _between(first: Fix, last: Fix, share: float, utc_ns: int, gap_s: float) -> Fix:
    ends = (first, last)
    lat_deg, lon_deg, alt_m = (
        _mix([getattr(fix, name) for fix in ends], share)
        for name in ("lat_deg", "lon_deg", "alt_m")
    )
    known = [fix.acc_m for fix in ends if fix.acc_m is not None]
    acc_m = max(known, default=None)
    if gap_s > _DENSE_S:
        acc_m = max(acc_m or 0.0, _DETOUR * _distance_m(first, last)) or None
    hdop = max((fix.hdop for fix in ends if fix.hdop is not None), default=None)
    return Fix(
        True, utc_ns=utc_ns, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=alt_m, acc_m=acc_m, hdop=hdop
    )


def _mix(values: list[float | None], share: float) -> float | None:
    first, last = values
    return None if first is None or last is None else first + share * (last - first)


def _distance_m(first: Fix, last: Fix) -> float:
    assert first.lat_deg is not None
    assert last.lat_deg is not None
    assert first.lon_deg is not None
    assert last.lon_deg is not None
    north_m = (last.lat_deg - first.lat_deg) * _DEGREE_M
    east_m = (last.lon_deg - first.lon_deg) * _DEGREE_M * cos(radians(first.lat_deg))
    return hypot(north_m, east_m)


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
