"""Receivers in modems: +CGNSINF, +CGPSINFO (SIMCom), +QGPSLOC (Quectel), $GPSACP (Telit).

    +CGNSINF:
    1,1,20150327014838.000,31.221783,121.354528,114.600,0.28,0.0,1,,1.9,2.2,1.0,,8,4,,,42,,
    +CGPSINFO: 4429.967842,N,01124.141582,E,250325,160319.0,57.7,0.0, +QGPSLOC:
    142748.0,2259.0881S,04321.5515W,2.0,-83.0,2,0.00,0.0,0.0,140119,10

A position is read completely or not at all. The course of +QGPSLOC is documented as degrees and
minutes, which captures do not prove, so it is not read. Sources: firmware_notes/simcom.md.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime

from logger.core.types import Fix
from logger.drivers.protocols.at import Command
from logger.drivers.reading.row_language import MPS_PER_KNOT, decimal

CGNSINF_ON = (Command("AT+CGNSPWR=1"),)
CGNSINF = (Command("AT+CGNSINF"),)
CGNSINF_TIME = {"+CGNSINF": "(?:19|20)[0-9]{2}[01][0-9][0-3][0-9][0-2][0-9][0-5][0-9][0-6][0-9]"}
"""The time of a position, which has more digits than other numbers."""
CGPSINFO_ON = (Command("AT+CGPS=1"), Command("AT+CGNSSPWR=1"))  # the second for an A76xx
CGPSINFO = (Command("AT+CGPSINFO"),)
QGPSLOC_ON = (Command("AT+QGPS=1"),)
QGPSLOC = (Command("AT+QGPSLOC=2"),)
GPSACP_ON = (Command("AT$GPSP=1"),)
GPSACP = (Command("AT$GPSACP"),)

# A receiver without a fix prints a date of 1980. One 19.6 years early, from a lost count of weeks,
# is for whoever records it to judge.
EARLIEST_YEAR = 1981

MPS_PER_KMH = 1 / 3.6

_BODY = r"([-+\w. ,]*)"
_CGNSINF = re.compile(r"\+U?C?GNSINF:" + _BODY, re.ASCII)
_CGPSINFO = re.compile(r"\+CGPSINFO:" + _BODY, re.ASCII)
_QGPSLOC = re.compile(r"(?:\+QGPSLOC|\$GPSACP):" + _BODY, re.ASCII)
_QGPSLOC_COMMAND = re.compile(r"AT\+QGPSLOC", re.IGNORECASE)
_NOT_FIXED = re.compile(r"\+CME ERROR:\s*516(?!\d)")
_COMMAND = re.compile(r"(?:\A|\W)AT\+", re.IGNORECASE)

_CGNSINF_VALUES = (
    *("run", "fix", "utc", "lat", "lon", "alt", "kmh", "course", "mode", "r1", "hdop", "pdop"),
    *("vdop", "r2", "view", "used", "glonass", "r3", "cn0", "hpa", "vpa"),
)
_CGPSINFO_VALUES = ("lat", "north", "lon", "east", "date", "time", "alt", "knots", "course")
_QGPSLOC_VALUES = (
    *("time", "lat", "lon", "hdop", "alt", "fix"),
    *("course_minutes", "kmh", "knots", "date", "used"),
)

_NUMBER = re.compile(r"[-+]?\d{1,6}(?:\.\d{0,9})?", re.ASCII)
_MINUTES = re.compile(r"(\d{1,3})(\d\d\.\d{1,8})\s*([NSEW])", re.ASCII)
_DAY_AND_TIME = re.compile(r"(\d{4})(\d\d)(\d\d)(\d\d)(\d\d)(\d\d)(?:\.(\d{0,9}))?", re.ASCII)
_DATE = re.compile(r"(\d\d)(\d\d)(\d\d)", re.ASCII)
_TIME = re.compile(r"(\d\d)(\d\d)(\d\d)(?:\.(\d{0,9}))?", re.ASCII)
_LETTER_APART = re.compile(r"\s*,\s*([NSEW])\s*(?=,)")


def read_cgnsinf(lines: Sequence[str]) -> tuple[Fix, ...]:
    """Fixes in +CGNSINF and +UGNSINF lines."""
    return tuple(_cgnsinf(named) for named in _rows(_CGNSINF, _CGNSINF_VALUES, lines))


def read_cgpsinfo(lines: Sequence[str]) -> tuple[Fix, ...]:
    """Fixes in +CGPSINFO lines; all values are empty without a fix."""
    return tuple(_cgpsinfo(named) for named in _rows(_CGPSINFO, _CGPSINFO_VALUES, lines))


def read_qgpsloc(lines: Sequence[str]) -> tuple[Fix, ...]:
    """Fixes in +QGPSLOC (all formats) and $GPSACP lines; error 516 reports that there is none."""
    fixes: list[Fix] = []
    is_answer = False
    for line in lines:
        if _COMMAND.search(line):
            is_answer = _QGPSLOC_COMMAND.search(line) is not None
        if is_answer and _NOT_FIXED.search(line):
            fixes.append(Fix(valid=False))
        fixes += [
            _fix_of_minutes(named, named["lat"], named["lon"], valid=named["fix"] in {"2", "3"})
            for named in _rows(_QGPSLOC, _QGPSLOC_VALUES, [_LETTER_APART.sub(r"\1", line)])
        ]
    return tuple(fixes)


def _rows(
    prefix: re.Pattern[str], names: tuple[str, ...], lines: Sequence[str]
) -> Iterator[dict[str, str]]:
    """Values by name; the last value of a short row may be cut and is left out."""
    for line in lines:
        for body in prefix.findall(line):
            values = [value.strip() for value in body.split(",")]
            if len(values) < len(names):
                values.pop()
            yield dict.fromkeys(names, "") | dict(zip(names, values, strict=False))


def _cgnsinf(named: Mapping[str, str]) -> Fix:
    time = _DAY_AND_TIME.fullmatch(named["utc"])
    return _fix(
        named,
        lat_deg=_number(named["lat"], -90.0, 90.0),
        lon_deg=_number(named["lon"], -180.0, 180.0),
        valid=(named["run"], named["fix"]) == ("1", "1"),
        utc_ns=_utc_ns(*time.groups()) if time else None,
    )


def _cgpsinfo(named: Mapping[str, str]) -> Fix:
    lat, lon = named["lat"] + named["north"], named["lon"] + named["east"]
    return _fix_of_minutes(named, lat, lon, valid=True)


def _fix_of_minutes(named: Mapping[str, str], lat: str, lon: str, *, valid: bool) -> Fix:
    return _fix(
        named,
        lat_deg=_degrees(lat, "NS", 90.0),
        lon_deg=_degrees(lon, "EW", 180.0),
        valid=valid,
        utc_ns=_utc_ns_of(named["date"], named["time"]),
    )


def _fix(
    named: Mapping[str, str],
    *,
    lat_deg: float | None,
    lon_deg: float | None,
    valid: bool,
    utc_ns: int | None,
) -> Fix:
    """Without a complete position the fix is not valid."""
    if not valid or lat_deg is None or lon_deg is None:
        return Fix(valid=False, utc_ns=utc_ns, sats_used=decimal(named.get("used", ""), 0, 99))
    return Fix(
        valid=True,
        utc_ns=utc_ns,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=_number(named["alt"], -1000.0, 100_000.0),
        hdop=_number(named.get("hdop", ""), 0.0, 99.9) or None,  # 0.0 fills the field
        sats_used=decimal(named.get("used", ""), 0, 99),
        speed_mps=_speed_mps(named),
        course_deg=_number(named.get("course", ""), 0.0, 360.0),
    )


def _speed_mps(named: Mapping[str, str]) -> float | None:
    if "kmh" in named:
        speed, unit_mps = _number(named["kmh"], 0.0, 3600.0), MPS_PER_KMH
    else:
        speed, unit_mps = _number(named["knots"], 0.0, 2000.0), MPS_PER_KNOT
    return None if speed is None else speed * unit_mps


def _number(text: str, low: float, high: float) -> float | None:
    if not _NUMBER.fullmatch(text):
        return None
    return float(text) if low <= float(text) <= high else None


def _degrees(text: str, letters: str, limit_deg: float) -> float | None:
    found = _MINUTES.fullmatch(text)
    if not found:
        return _number(text, -limit_deg, limit_deg) if "." in text else None
    angle_deg = float(found[1]) + float(found[2]) / 60.0
    if found[3] not in letters or float(found[2]) >= 60.0 or angle_deg > limit_deg:
        return None
    return -angle_deg if found[3] == letters[1] else angle_deg


def _utc_ns_of(date: str, time: str) -> int | None:
    """Time of `ddmmyy` and `hhmmss.sss`; GPS began in 1980."""
    on, at = _DATE.fullmatch(date), _TIME.fullmatch(time)
    if not on or not at:
        return None
    day, month, year = on.groups()
    return _utc_ns(f"{'19' if year >= '80' else '20'}{year}", month, day, *at.groups())


def _utc_ns(
    year: str, month: str, day: str, hour: str, minute: str, second: str, fraction: str | None
) -> int | None:
    """None for an impossible time and for a leap second."""
    if int(year) < EARLIEST_YEAR:
        return None
    try:
        at = datetime(
            int(year), int(month), int(day), int(hour), int(minute), int(second), tzinfo=UTC
        )
    except ValueError:
        return None
    return int(at.timestamp()) * 10**9 + int(f"{fraction or '':0<9}")
