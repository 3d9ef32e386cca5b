"""NMEA 0183: bytes of a GNSS receiver in, sentences out, and GGA with RMC of one epoch joined to a fix.

pynmea2 names the fields of a sentence. Framing, positions and times are read here: pynmea2 loses the sentence after an
interrupted one, reads an empty position as 0/0 and lets 75 minutes pass (see firmware_notes/nmea.md).
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date
from functools import reduce
from operator import xor
from typing import Any

import pynmea2

from logger.core.types import Fix
from logger.drivers.garbage import Garbage

MAX_SENTENCE = 1024  # bytes; the standard has 82, real receivers print up to some 300

# GPS counts weeks modulo 1024: a receiver that has lost count prints a date 19.6 years early, and one without a fix the
# epoch of 1980. No run of this program is older than this day.
EARLIEST_UTC = date(2020, 1, 1)

MPS_PER_KNOT = 1852 / 3600

_POSITIONED = frozenset({1, 2, 3, 4, 5, 6})  # GGA quality; 0 no fix, 7 typed in by hand, 8 simulator
_NOT_MEASURED = frozenset({"N", "M", "S"})  # RMC mode: no fix, typed in by hand, simulator

_BODY = rb"[ -#%-)+-~]"  # printable without $ and *
_SENTENCE = re.compile(rb"\$([A-Z][A-Z0-9]{2}" + _BODY + rb"{0,%d}+)\*([0-9A-Fa-f]{2})" % MAX_SENTENCE)
_BEGINNING = re.compile(rb"\$" + _BODY + rb"{0,%d}+(?:\*[0-9A-Fa-f]?)?\Z" % (MAX_SENTENCE + 3))
_ANGLE = re.compile(r"(\d{1,3})(\d\d(?:\.\d*)?)")
_TIME = re.compile(r"([01]\d|2[0-3])([0-5]\d)([0-5]\d)(?:\.(\d{0,9}))?")


@dataclass(frozen=True, slots=True)
class Sentence:
    """One sentence with a right checksum, `$` to `*HH`; `message` is None for a type that pynmea2 does not know."""

    text: str
    message: Any = field(compare=False, repr=False, default=None)


class NmeaFramer:
    """Bytes of one receiver to sentences, also out of the middle of binary noise; never raises."""

    def __init__(self) -> None:
        self._tail = b""  # a sentence under way

    def feed(self, data: bytes) -> Iterator[Sentence | Garbage]:
        """Events completed by `data`; all of it is taken at the call, also if nobody looks at the events.

        A sentence is complete with its checksum: its line end need not have come. Noise is reported as it comes, one
        event for each stretch in one call, without line ends.
        """
        data = self._tail + data
        events: list[Sentence | Garbage] = []
        done = 0
        for match in _SENTENCE.finditer(data):
            sentence = _sentence(match)
            if sentence is not None:
                events += _noise(data[done : match.start()])
                events.append(sentence)
                done = match.end()
        start = data.rfind(b"$", done)
        beginning = _BEGINNING.match(data, start) if start >= 0 else None
        self._tail = beginning[0] if beginning else b""
        events += _noise(data[done : len(data) - len(self._tail)])
        return iter(events)


class FixAssembler:
    """Sentences of one receiver to fixes: one for each epoch, also where it has no position."""

    def __init__(self) -> None:
        self._pending: dict[type[Any], Any] = {}
        self._t_ns = 0

    def feed(self, sentence: Sentence, t_ns: int) -> Iterator[tuple[int, Fix]]:
        """Fixes completed by a sentence stamped `t_ns`; a fix has the stamp of its epoch's first sentence.

        GGA and RMC of one time of day are one epoch, complete with the second of them. A receiver that sends only one
        of the two has its epochs completed by the next one, or by `flush`.
        """
        message = sentence.message
        kind = type(message)
        if kind not in {pynmea2.GGA, pynmea2.RMC}:
            return iter(())
        fixes = list(self.flush()) if kind in self._pending or self._is_other_time(message) else []
        if not self._pending:
            self._t_ns = t_ns
        self._pending[kind] = message
        if len(self._pending) == 2:
            fixes += self.flush()
        return iter(fixes)

    def flush(self) -> Iterator[tuple[int, Fix]]:
        """The fix of what is pending, for a receiver that has fallen silent."""
        if not self._pending:
            return iter(())
        fix = _fix(self._pending.get(pynmea2.GGA), self._pending.get(pynmea2.RMC))
        self._pending = {}
        return iter([(self._t_ns, fix)])

    def _is_other_time(self, message: Any) -> bool:
        """True where both have a time of day and it differs; without one a sentence joins what is pending."""
        return len({_time_of_day(m) for m in (message, *self._pending.values()) if m.data[0]}) > 1


def _sentence(match: re.Match[bytes]) -> Sentence | None:
    body, checksum = match.groups()
    if reduce(xor, body) != int(checksum, 16):
        return None
    text = match[0].decode("ascii")
    try:
        return Sentence(text, pynmea2.parse(text, check=True))
    except Exception:  # noqa: BLE001  besides ParseError, pynmea2 1.19 lets IndexError and TypeError out
        return Sentence(text)


def _noise(data: bytes) -> list[Sentence | Garbage]:
    data = data.translate(None, b"\r\n")
    return [Garbage(data)] if data else []


def _fix(gga: Any, rmc: Any) -> Fix:
    """Fix of one epoch from its GGA, its RMC or both; where they disagree about validity there is none."""
    position = _position(gga) or _position(rmc) if _is_valid(gga, rmc) else None
    lat_deg, lon_deg = position or (None, None)
    speed_kn, course_deg = (_number(rmc.spd_over_grnd), _number(rmc.true_course)) if rmc and position else (None, None)
    return Fix(
        valid=position is not None,
        utc_ns=_utc_ns(gga, rmc),
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=_number(gga.altitude) if gga and position else None,
        hdop=_within(_number(gga.horizontal_dil), math.inf) or None if gga else None,  # 0.0 fills the field
        sats_used=int(gga.num_sats) if gga and re.fullmatch(r"\d{1,2}", gga.num_sats) else None,
        quality=gga.gps_qual if gga and gga.gps_qual in range(10) else None,
        speed_mps=_within(None if speed_kn is None else speed_kn * MPS_PER_KNOT, math.inf),
        course_deg=_within(course_deg, 360.0),
    )


def _is_valid(gga: Any, rmc: Any) -> bool:
    # pynmea2's own is_valid is False for every RMC of NMEA 4.1 with navigational status V, and for GGA quality 6.
    if gga and gga.gps_qual not in _POSITIONED:
        return False
    # by position: pynmea2 before 1.19 has no name for the mode
    return not rmc or (rmc.status == "A" and not _NOT_MEASURED.intersection(rmc.data[11:12]))


def _position(message: Any) -> tuple[float, float] | None:
    """Latitude and longitude in degrees; None unless both are printed in full."""
    if not message:
        return None
    lat_deg = _angle_deg(message.lat, message.lat_dir, "NS", 90.0)
    lon_deg = _angle_deg(message.lon, message.lon_dir, "EW", 180.0)
    return None if lat_deg is None or lon_deg is None else (lat_deg, lon_deg)


def _angle_deg(text: str, letter: str, letters: str, limit_deg: float) -> float | None:
    """Signed degrees of `dddmm.mmmm` and its hemisphere, the second of `letters` being the negative one."""
    match = _ANGLE.fullmatch(text)
    if not match or len(letter) != 1 or letter not in letters or float(match[2]) >= 60.0:
        return None
    angle_deg = float(match[1]) + float(match[2]) / 60.0
    if angle_deg > limit_deg:
        return None
    return -angle_deg if letter == letters[1] else angle_deg


def _utc_ns(gga: Any, rmc: Any) -> int | None:
    """Nanoseconds since 1970 from the RMC's date and the epoch's time of day; a leap second has no such number."""
    day = rmc.datestamp if rmc else None
    time_ns = next((ns for ns in map(_time_ns, (rmc, gga)) if ns is not None), None)
    if time_ns is None or not isinstance(day, date) or day < EARLIEST_UTC:
        return None
    return (day - date(1970, 1, 1)).days * 86_400 * 10**9 + time_ns


def _time_ns(message: Any) -> int | None:
    """Nanoseconds since midnight of the sentence's first field, `hhmmss.sss`, to the last digit."""
    match = _TIME.fullmatch(message.data[0]) if message else None
    if not match:
        return None
    hours, minutes, seconds, fraction = match.groups(default="")
    return ((int(hours) * 60 + int(minutes)) * 60 + int(seconds)) * 10**9 + int(f"{fraction:0<9}")


def _time_of_day(message: Any) -> int | str:
    """Time of day for comparing: "120000" equals "120000.00"; one that is no time (a leap second) equals its like."""
    time_ns = _time_ns(message)
    text: str = message.data[0]
    return text if time_ns is None else time_ns


def _number(value: object) -> float | None:
    """A finite number; pynmea2 hands on as text what it could not convert."""
    if not isinstance(value, (str, float)):
        return None
    try:
        number = float(value)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _within(value: float | None, limit: float) -> float | None:
    return value if value is not None and 0.0 <= value <= limit else None
