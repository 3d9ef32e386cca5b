"""Tracks that give another log its positions: GPX, or what Rayhunter keeps beside a recording.

Source: www.topografix.com/GPX/1/1.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from math import cos, hypot, radians
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from logger.core.errors import ConfigError, GeoError, RunFileError
from logger.core.places import SIGMA_OF_RADIUS68, UNKNOWN_SIGMA_M
from logger.core.types import Fix
from postproc.foreign_file import MOST_READINGS, with_limit
from postproc.interop import xml_file
from postproc.interop.contents import look_at, plain_file, unknown_format
from postproc.interop.readers import gsmtap, rayhunter
from postproc.interop.sighting import BadRow, NoCell, Row, Sighting, fix_of, maybe, utc_ns_of

MOST_APART_S = 60.0
"""Between points farther apart in time, a walker may have been anywhere in a block of houses."""
_MOST_APART_NS = round(MOST_APART_S * 1e9)
_DENSE_S = 10.0
"""Within this time a walker goes straight on, to the accuracy of a receiver."""
_DETOUR = 0.25
"""Share of the distance between two points that their straight line may be wrong by."""
_DEGREE_M = 111_200.0
POSITIONS = "-gps.ndjson"
_RAYHUNTER = (("latest_packet_timestamp", "system_time"), ("unix_ts", "lat", "lon"))
_CLOCK_SIGMA_S = 0.5
"""Of a time that was joined with another clock by whole seconds."""


class GpsTrack:
    """Positions by UTC, of at least two points.

    `undated_shift_ns` makes UTC of the times of a modem whose clock was not set, None if unknown.
    `n_bad` lines of the file have no position.
    """

    def __init__(
        self, fixes: list[Fix], undated_shift_ns: int | None = None, n_bad: int = 0
    ) -> None:
        self.undated_shift_ns, self.n_bad = undated_shift_ns, n_bad
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

    def part(self, first_ns: int, last_ns: int) -> "GpsTrack | None":
        """What of it is near a stretch of time; None if nothing is."""
        begin = bisect_left(self._utc_ns, first_ns - _MOST_APART_NS)
        end = bisect_left(self._utc_ns, last_ns + _MOST_APART_NS)
        return GpsTrack(self.fixes[begin:end], self.undated_shift_ns) if end > begin else None


def read_track(source: Path, member: str | None = None) -> GpsTrack:
    """Track of a GPX file, of the positions or of the packets of Rayhunter, also compressed.

    Raises `RunFileError` for another file, for one without two points with a time, and for a place
    that a person typed in.
    """
    with plain_file(source, member) as plain:
        shift_ns, n_bad = None, 0
        # of what a power cut left, which may be binary, the name tells
        is_named = (member or source.name).endswith(POSITIONS)
        seen = None if is_named else look_at(plain)
        if seen and seen.kind == "xml" and seen.has("gpx"):
            fixes = list(with_limit(_gpx_fixes(plain), plain, "points", MOST_READINGS))
        elif seen is None or (seen.kind == "json" and any(seen.has(*one) for one in _RAYHUNTER)):
            lines, shift_ns = rayhunter.positions(plain)
            n_bad = lines.count(None)
            fixes = _less_sure([fix for fix in lines if fix])
        elif seen.kind == "packets":
            fixes = _less_sure(gsmtap.positions(plain))
        else:
            raise unknown_format(source, f"{seen.words}, which is no GPX track")
    track = GpsTrack(fixes, shift_ns, n_bad)
    if len(track.fixes) < 2:
        raise RunFileError(f"{source} has no track: fewer than two points have a time")
    if len({(fix.lat_deg, fix.lon_deg) for fix in track.fixes}) == 1:
        raise RunFileError(f"{source} has one fixed position, which is no walk")
    return track


def _less_sure(fixes: list[Fix]) -> list[Fix]:
    """Fixes without an accuracy, less sure by what is walked in the error of a clock."""
    fixes = sorted(fixes, key=lambda fix: fix.utc_ns or 0)
    most_m = [0.0] * len(fixes)
    for i, (one, other) in enumerate(pairwise(fixes)):
        apart_s = ((other.utc_ns or 0) - (one.utc_ns or 0)) / 1e9
        way_m = _distance_m(one, other) * min(_CLOCK_SIGMA_S / max(apart_s, 1.0), 1.0)
        most_m[i], most_m[i + 1] = max(most_m[i], way_m), way_m
    return [
        replace(fix, acc_m=hypot(UNKNOWN_SIGMA_M, way_m) / SIGMA_OF_RADIUS68)
        for fix, way_m in zip(fixes, most_m, strict=True)
    ]


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
        if not isinstance(row, Sighting) or row.fix.utc_ns is not None:
            yield row
            continue
        first_ns, second_ns = (_utc_ns(row.t_ns, zone, fold) for fold in (0, 1))
        if first_ns != second_ns:
            yield BadRow(row.line, _TWICE.format(zone.key))
        else:
            yield replace(row, t_ns=first_ns, fix=replace(row.fix, utc_ns=first_ns))


def on_track(rows: Iterable[Row], track: GpsTrack) -> Iterator[Row]:
    """The same rows at the positions of a track, whatever position they had."""
    for row in rows:
        if not isinstance(row, Sighting):
            yield row
        elif row.is_position:
            yield NoCell(row.line, "no level")
        elif row.fix.utc_ns is None:
            yield BadRow(
                row.line, "its time has no zone: name it, for example --zone Europe/Berlin"
            )
        elif (fix := track.at(row.fix.utc_ns)) is None:
            apart = f"at most {MOST_APART_S:.0f} s apart"
            yield BadRow(row.line, f"the track has no points before and after it, {apart}")
        else:
            yield replace(row, t_ns=row.fix.utc_ns, fix=fix)


def with_position(rows: Iterable[Row]) -> Iterator[Row]:
    """The same rows; those without a position are bad."""
    for row in rows:
        if isinstance(row, Sighting) and not row.fix.valid:
            how = "add the GPX track of the walk with --track, or name its columns with --columns"
            yield BadRow(row.line, f"no position: {how}")
        else:
            yield row


_TWICE = (
    "in {} that hour came twice or never, as the clocks were changed: name the offset, for "
    "example --zone Etc/GMT-2 for two hours ahead of UTC"
)


def _utc_ns(local_ns: int, zone: ZoneInfo, fold: int) -> int:
    seconds, rest_ns = divmod(local_ns, 10**9)
    local = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)
    local = local.replace(tzinfo=zone, fold=fold)
    since = local.astimezone(UTC) - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 10**9 + rest_ns
