"""gpsd (gpsd_json(5), protocol 3): lines of JSON in, reports out, joined to fixes."""

from collections.abc import Iterator
from datetime import UTC, date, datetime, timedelta
from typing import Annotated, Any

import msgspec

from logger.core.foreign import decode_json
from logger.core.types import Fix
from logger.drivers.protocols.line_noise import Garbage
from logger.drivers.protocols.nmea import EARLIEST_UTC, radius68_m

MAX_LINE = 16_384
"""Bytes; gpsd cuts its own lines at 10240."""
MAX_DEVICES = 16
SAME_EPOCH_S = 0.9
"""Reports without a time are of one epoch for so long: gpsd repeats them without a fix."""

Size = Annotated[float, msgspec.Meta(ge=0)]
Count = Annotated[int, msgspec.Meta(ge=0, le=999)]
Latitude = Annotated[float, msgspec.Meta(ge=-90, le=90)]
Longitude = Annotated[float, msgspec.Meta(ge=-180, le=180)]
Course = Annotated[float, msgspec.Meta(ge=0, le=360)]

# TPV status to GGA quality: RTK fixed and floating, dead reckoning, satellites helped by it,
# military P(Y). Absent is unknown; 7 (surveyed in by hand) and 8 (simulator) are no positions that
# were measured.
_QUALITY = {1: 1, 2: 2, 3: 4, 4: 5, 5: 6, 6: 1, 7: 7, 8: 8, 9: 3}
_NOT_MEASURED = frozenset({7, 8})
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class Version(msgspec.Struct, frozen=True):
    """The first report of gpsd."""

    release: str
    proto_major: int
    proto_minor: int


class Device(msgspec.Struct, frozen=True):
    """A receiver of gpsd; `activated` is a time, 0 or absent when gpsd has closed it."""

    path: str = ""
    driver: str = ""
    activated: str | float = 0.0


class Devices(msgspec.Struct, frozen=True):
    """All receivers of gpsd."""

    devices: tuple[Device, ...]


class Error(msgspec.Struct, frozen=True):
    """A request that gpsd did not understand."""

    message: str


class Tpv(msgspec.Struct, frozen=True):
    """Time, position, velocity: mode 2 has a position, mode 3 a height too, 0 and 1 none."""

    mode: int
    device: str = ""
    time: str | None = None
    status: int | None = None
    lat: Latitude | None = None
    lon: Longitude | None = None
    alt: float | None = None
    altMSL: float | None = None  # noqa: N815  gpsd's name
    eph: Size | None = None
    speed: Size | None = None
    track: Course | None = None


class Sky(msgspec.Struct, frozen=True):
    """Dilution of precision, and how many satellites the position was made of."""

    device: str = ""
    hdop: Size | None = None
    uSat: Count | None = None  # noqa: N815  gpsd's name


class Gst(msgspec.Struct, frozen=True):
    """Standard deviations of a position, metres."""

    device: str = ""
    time: str | None = None
    lat: Size | None = None
    lon: Size | None = None


Report = Version | Device | Devices | Error | Tpv | Sky | Gst

_CLASSES: dict[str, type[Any]] = {
    kind.__name__.upper(): kind for kind in (Version, Device, Devices, Error, Tpv, Sky, Gst)
}


class _Head(msgspec.Struct, frozen=True):
    name: str = msgspec.field(name="class")


def watch(device: str = "") -> bytes:
    """The request for reports of all devices, or of one."""
    only = {"device": device} if device else {}
    return b"?VERSION;\n?WATCH=%b;\n" % msgspec.json.encode({"enable": True, "json": True, **only})


class GpsdFramer:
    """Bytes of gpsd to reports; never raises."""

    def __init__(self) -> None:
        self._tail = b""  # a line under way

    def feed(self, data: bytes) -> Iterator[Report | Garbage]:
        """Reports completed by `data`, which is all consumed at the call."""
        *lines, self._tail = (self._tail + data).split(b"\n")
        events = [event for line in lines if (event := _report(line.strip(b"\r"))) is not None]
        if len(self._tail) > MAX_LINE:
            events.append(Garbage(self._tail))
            self._tail = b""
        return iter(events)


class GpsdFixes:
    """Reports of one gpsd to fixes: one for each epoch, also where it has no position."""

    def __init__(self) -> None:
        self._t_ns = 0
        self._tpv: Tpv | None = None
        self._reported = False
        self._sky = Sky()
        self._gst = Gst()
        self._drivers: dict[str, str] = {}

    def feed(self, report: Report, t_ns: int) -> Iterator[tuple[int, Fix]]:
        """Fixes completed by a report stamped `t_ns`; a fix has the stamp of its epoch's first TPV.

        gpsd reports an epoch in one TPV or in several with more and more values, with SKY and GST
        before or after them. It ends when the next begins, or by `flush`; later TPV are left out.
        """
        fixes: list[tuple[int, Fix]] = []
        if isinstance(report, Tpv):
            if not self._is_same_epoch(report, t_ns):
                fixes += self.flush()
                self._t_ns, self._reported = t_ns, False
            if not self._reported:
                self._tpv = report
        elif isinstance(report, Sky):
            self._sky = _merge_sky(self._sky, report)
        elif isinstance(report, Gst):
            self._gst = report
        elif isinstance(report, (Device, Devices)):
            devices = report.devices if isinstance(report, Devices) else (report,)
            self._drivers = dict(
                [*self._drivers.items(), *((d.path, d.driver) for d in devices)][-MAX_DEVICES:]
            )
        return iter(fixes)

    def flush(self) -> Iterator[tuple[int, Fix]]:
        """The fix of what is pending, after a pause."""
        if self._tpv is None or self._reported:
            return iter(())
        self._reported = True
        sky = self._sky if self._sky.device == self._tpv.device else Sky()
        accuracy_m = _accuracy_m(self._tpv, self._gst, self._drivers.get(self._tpv.device, ""))
        if self._tpv.mode < 2:
            self._sky = Sky()  # the next position is made of other satellites
        return iter([(self._t_ns, _fix(self._tpv, sky, accuracy_m))])

    @property
    def time(self) -> str | None:
        """As that of `FixAssembler`."""
        return self._tpv.time if self._tpv else None

    @property
    def impossible_date(self) -> date | None:
        """As that of `FixAssembler`."""
        when = _when(self._tpv) if self._tpv else None
        return when.date() if when and when.date() < EARLIEST_UTC else None

    def _is_same_epoch(self, tpv: Tpv, t_ns: int) -> bool:
        if self._tpv is None or (tpv.device, tpv.time) != (self._tpv.device, self._tpv.time):
            return False
        return tpv.time is not None or t_ns - self._t_ns < SAME_EPOCH_S * 1e9


def _report(line: bytes) -> Report | Garbage | None:
    if not line:
        return None
    try:
        kind = _CLASSES.get(decode_json(line, _Head).name)
        return None if kind is None else decode_json(line, kind)
    except msgspec.DecodeError:
        return Garbage(line)


def _merge_sky(before: Sky, sky: Sky) -> Sky:
    """One SKY may have the DOPs and the next the satellites."""
    if sky.device != before.device:
        return sky
    hdop = before.hdop if sky.hdop is None else sky.hdop
    return Sky(sky.device, hdop, before.uSat if sky.uSat is None else sky.uSat)


def _fix(tpv: Tpv, sky: Sky, accuracy_m: float | None) -> Fix:
    valid = (
        tpv.mode >= 2
        and tpv.lat is not None
        and tpv.lon is not None
        and tpv.status not in _NOT_MEASURED
    )
    quality = None if tpv.status is None else _QUALITY.get(tpv.status)
    if not valid:
        return Fix(
            valid=False,
            utc_ns=_utc_ns(tpv),
            hdop=sky.hdop or None,
            sats_used=sky.uSat,
            quality=quality,
        )
    return Fix(
        valid=True,
        utc_ns=_utc_ns(tpv),
        lat_deg=tpv.lat,
        lon_deg=tpv.lon,
        alt_m=(tpv.alt if tpv.altMSL is None else tpv.altMSL) if tpv.mode == 3 else None,
        acc_m=accuracy_m,
        hdop=sky.hdop or None,
        sats_used=sky.uSat,
        quality=quality,
        speed_mps=tpv.speed,
        course_deg=tpv.track,
    )


def _accuracy_m(tpv: Tpv, gst: Gst, driver: str) -> float | None:
    """Radius that holds 68 % of the positions, where the receiver itself reports one.

    For an NMEA receiver gpsd makes up `eph`: a constant times the HDOP, often that of the epoch
    before. Others report it themselves, with an unknown certainty, which is taken as 68 %.
    """
    if (
        tpv.time is not None
        and (gst.device, gst.time) == (tpv.device, tpv.time)
        and gst.lat
        and gst.lon
    ):
        return radius68_m(gst.lat, gst.lon)
    return tpv.eph or None if driver and not driver.startswith("NMEA") else None


def _utc_ns(tpv: Tpv) -> int | None:
    """None without a fix, for a leap second and for an impossible year."""
    when = _when(tpv)
    if when is None or when.date() < EARLIEST_UTC:
        return None
    utc_ns = (when - _EPOCH) // timedelta(microseconds=1) * 1000
    return utc_ns if utc_ns < 1 << 63 else None  # from the year 2262 on no column holds it


def _when(tpv: Tpv) -> datetime | None:
    if tpv.mode < 2 or tpv.time is None:
        return None
    try:
        when = datetime.fromisoformat(tpv.time)
    except ValueError:
        return None
    return None if when.tzinfo is None else when
