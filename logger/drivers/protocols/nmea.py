"""NMEA 0183: bytes of a receiver in, sentences out, and those of one epoch joined to a fix.

pynmea2 names the fields of a sentence. Framing is done here: pynmea2 loses the sentence after an
interrupted one (see firmware_notes/nmea.md).
"""

import math
import re
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import date, timedelta
from functools import reduce
from operator import or_, xor
from typing import Any, TypeVar

import pynmea2

from logger.core.types import EARLIEST_UTC_NS, Fix
from logger.drivers.protocols.line_noise import Garbage
from logger.drivers.reading.row_language import MPS_PER_KNOT

# Values are read from the text of the fields: pynmea2 takes an empty position for 0/0 and lets 75
# minutes pass (see firmware_notes/nmea.md).

# GPS counts weeks modulo 1024: a receiver that has lost count prints a date 19.6 years early, and
# one without a fix the epoch of 1980. No run of this program is older than this day.
EARLIEST_UTC = date(1970, 1, 1) + timedelta(seconds=EARLIEST_UTC_NS // 10**9)

DAY_NS = 86_400 * 10**9

_POSITIONED = frozenset(
    {1, 2, 3, 4, 5, 6}
)  # GGA quality; 0 no fix, 7 typed in by hand, 8 simulator
_NOT_MEASURED = frozenset({"N", "M", "S"})  # RMC mode: no fix, typed in by hand, simulator
_ESTIMATED = frozenset({"E"})  # dead reckoning
_QUALITY_OF_MODE = {letter: quality for quality, letter in enumerate("NADPRFEMS")}
_BEST_FIRST = "RFPDAEMS"

T = TypeVar("T")

_ANGLE = re.compile(r"(\d{1,3})(\d\d(?:\.\d*)?)")
_TIME = re.compile(r"([01]\d|2[0-3])([0-5]\d)([0-5]\d)(?:\.(\d{0,9}))?")


def fix_of(epoch: Mapping[type[Any], Any]) -> Fix:
    """Fix of an epoch's messages by type; none where GGA (or GNS) and RMC disagree.

    A GLL counts where it is alone.
    """
    gga, rmc = epoch.get(pynmea2.GGA) or epoch.get(pynmea2.GNS), epoch.get(pynmea2.RMC)
    state = rmc or epoch.get(pynmea2.GLL)
    quality = _worse(_quality(gga), state)
    position = (_position(gga) or _position(state)) if _is_valid(gga, quality, state) else None
    gsa = epoch.get(pynmea2.GSA)
    lat_deg, lon_deg = position or (None, None)
    speed_mps, course_deg = _motion(rmc, epoch.get(pynmea2.VTG)) if position else (None, None)
    return Fix(
        valid=position is not None,
        utc_ns=_first(map(_utc_ns, (rmc, epoch.get(pynmea2.ZDA)))),
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=number(gga.altitude) if gga and position and nav_mode(gsa) != 2 else None,
        acc_m=_accuracy_m(epoch.get(pynmea2.GST)) if position else None,
        hdop=_hdop(gga, gsa),
        sats_used=int(gga.num_sats) if gga and re.fullmatch(r"\d{1,2}", gga.num_sats) else None,
        quality=quality,
        speed_mps=speed_mps,
        course_deg=course_deg,
    )


def time_of_day_ns(message: Any) -> int | None:
    """Nanoseconds since midnight of its field `hhmmss.sss`; None for a leap second."""
    match = _TIME.fullmatch(_time_text(message)) if message else None
    if not match:
        return None
    hours, minutes, seconds, fraction = match.groups(default="")
    return ((int(hours) * 60 + int(minutes)) * 60 + int(seconds)) * 10**9 + int(f"{fraction:0<9}")


def _time_text(message: Any) -> str:
    return _field(message, 4 if isinstance(message, pynmea2.GLL) else 0)


def _field(message: Any, index: int) -> str:
    texts: list[str] = message.data[index : index + 1]
    return texts[0] if texts else ""


def nav_mode(gsa: Any) -> int | None:
    """1 no fix, 2 position without height, 3 with it; None without a statement of the GSA."""
    text = gsa.data[1] if gsa and len(gsa.data) > 1 else ""
    return int(text) if text in {"1", "2", "3"} else None


def radius68_m(sigma_lat_m: float, sigma_lon_m: float) -> float:
    """Radius that holds 68 % of normal errors with these standard deviations."""
    # exact for a round ellipse (Rayleigh), too large by 4 % at 2:1 and by 7 % for a line
    return math.sqrt(-math.log(1.0 - 0.68) * (sigma_lat_m**2 + sigma_lon_m**2))


def _is_valid(gga: Any, quality: int | None, state: Any) -> bool:
    # pynmea2's own is_valid is False for every RMC of NMEA 4.1 with navigational status V, and for
    # GGA quality 6.
    if gga and quality not in _POSITIONED:
        return False
    return not state or (state.status == "A" and _mode(state) not in _NOT_MEASURED)


def _mode(state: Any) -> str:
    # by position: pynmea2 before 1.19 has no name for that of an RMC
    return _field(state, 6 if isinstance(state, pynmea2.GLL) else 11)


def _quality(gga: Any) -> int | None:
    if isinstance(gga, pynmea2.GNS):
        letter = _first(letter if letter in gga.mode_indicator else None for letter in _BEST_FIRST)
        return _QUALITY_OF_MODE[letter or "N"]
    return gga.gps_qual if gga and gga.gps_qual in range(10) else None


def _worse(quality: int | None, state: Any) -> int | None:
    """The quality, or that of an RMC or GLL whose position was not measured."""
    letter = _mode(state) if state else ""
    return (
        _QUALITY_OF_MODE[letter]
        if letter and letter in _ESTIMATED | _NOT_MEASURED - {"N"}
        else quality
    )


def _position(message: Any) -> tuple[float, float] | None:
    if not message:
        return None
    lat_deg = _angle_deg(message.lat, message.lat_dir, "NS", 90.0)
    lon_deg = _angle_deg(message.lon, message.lon_dir, "EW", 180.0)
    if lat_deg is None or lon_deg is None or lat_deg == lon_deg == 0.0:  # what some start with
        return None
    return lat_deg, lon_deg


def _angle_deg(text: str, letter: str, letters: str, limit_deg: float) -> float | None:
    """Signed degrees of `dddmm.mmmm`; the second of `letters` is negative."""
    match = _ANGLE.fullmatch(text)
    if not match or len(letter) != 1 or letter not in letters or float(match[2]) >= 60.0:
        return None
    angle_deg = float(match[1]) + float(match[2]) / 60.0
    if angle_deg > limit_deg:
        return None
    return -angle_deg if letter == letters[1] else angle_deg


def _motion(rmc: Any, vtg: Any) -> tuple[float | None, float | None]:
    """Speed in m/s and course in degrees of an RMC, else of a VTG, each by itself."""
    pairs = [(rmc.spd_over_grnd, rmc.true_course)] if rmc else []
    if (
        vtg and vtg.data[1:2] == ["T"] and vtg.data[5:6] == ["N"]
    ):  # before NMEA 2.0 the numbers stood elsewhere
        pairs.append((vtg.data[4], vtg.data[0]))
    speed_kn = _first(_within(number(speed), math.inf) for speed, _ in pairs)
    course_deg = _first(_within(number(course), 360.0) for _, course in pairs)
    return None if speed_kn is None else speed_kn * MPS_PER_KNOT, course_deg


def _accuracy_m(gst: Any) -> float | None:
    if not gst:
        return None
    sigmas_m = [
        _within(number(text), math.inf) for text in (gst.std_dev_latitude, gst.std_dev_longitude)
    ]
    if sigmas_m[0] is None or sigmas_m[1] is None:
        return None
    return radius68_m(sigmas_m[0], sigmas_m[1]) or None  # 0.0 fills the field


def _hdop(gga: Any, gsa: Any) -> float | None:
    texts = [gga.hdop if isinstance(gga, pynmea2.GNS) else gga.horizontal_dil] if gga else []
    if gsa:
        texts.append(gsa.hdop)
    return _first(_within(number(text), math.inf) or None for text in texts)  # 0.0 fills the field


def _utc_ns(message: Any) -> int | None:
    """Nanoseconds since 1970 of one RMC or ZDA: two sentences may lie on two days."""
    time_ns = time_of_day_ns(message)
    day = None if time_ns is None else _date(message)
    if time_ns is None or day is None or day < EARLIEST_UTC:
        return None
    utc_ns = (day - date(1970, 1, 1)).days * DAY_NS + time_ns
    return utc_ns if utc_ns < 1 << 63 else None  # from the year 2262 on no column holds it


def _date(message: Any) -> date | None:
    if isinstance(message, pynmea2.RMC):
        return message.datestamp if isinstance(message.datestamp, date) else None
    day_month_year = message.data[1:4]
    if (
        not all(re.fullmatch(r"\d{1,4}", text) for text in day_month_year)
        or len(day_month_year) < 3
    ):
        return None
    try:
        return date(*map(int, reversed(day_month_year)))
    except ValueError:
        return None


def number(value: object) -> float | None:
    """A finite number; pynmea2 passes unconverted fields on as text."""
    try:
        found = float(value) if value is not None else math.nan  # type: ignore[arg-type]
    except (ValueError, TypeError):
        return None
    return found if math.isfinite(found) else None


def _within(value: float | None, limit: float) -> float | None:
    return value if value is not None and 0.0 <= value <= limit else None


def _first(values: Iterable[T | None]) -> T | None:
    return next((value for value in values if value is not None), None)


MAX_SENTENCE = 1024  # bytes; the standard has 82, real receivers print up to some 300
REMEMBERED_EPOCHS = 4
"""A sentence missing in fewer epochs than these was damaged on the way, not switched off."""

_HEADS = frozenset({pynmea2.GGA, pynmea2.RMC, pynmea2.GNS})
"""Sentences that make an epoch; the others only add to one."""
_LONE_HEADS = _HEADS | {pynmea2.GLL}
_MOST_GLL = 4  # a receiver that has sent more of them and none of the others sends none
_TIMED = frozenset({pynmea2.GST, pynmea2.ZDA})
_UNTIMED = frozenset({pynmea2.GSA, pynmea2.VTG})

_LONGEST_DUE_NS = 60 * 10**9
"""Between epochs; a longer time is a step of the receiver's clock."""

_BODY = rb"[ -#%-)+-~]"  # printable without $ and *
_SENTENCE = re.compile(
    rb"\$([A-Z][A-Z0-9]{2}" + _BODY + rb"{0,%d}+)\*([0-9A-Fa-f]{2})" % MAX_SENTENCE
)
_BEGINNING = re.compile(rb"\$" + _BODY + rb"{0,%d}+(?:\*[0-9A-Fa-f]?)?\Z" % (MAX_SENTENCE + 3))


@dataclass(frozen=True, slots=True)
class Sentence:
    """One sentence with a right checksum; `message` is None for a type unknown to pynmea2."""

    text: str
    message: Any = field(compare=False, repr=False, default=None)


class NmeaFramer:
    """Bytes of one receiver to sentences, also out of the middle of binary noise; never raises."""

    def __init__(self) -> None:
        self._tail = b""  # a sentence under way

    def feed(self, data: bytes) -> Iterator[Sentence | Garbage]:
        """Events completed by `data`, all of which is consumed at the call.

        A sentence is complete with its checksum, before its line end. Noise is reported as it
        comes, one event for each stretch in one call, without line ends.
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


@dataclass(slots=True)
class _Epoch:
    """Messages of one time of day by type: the first of each, of GSA the most informative.

    It came `due_ns` after the one before, was read at `read_ns`, and that was `late_ns` late.
    """

    t_ns: int
    time: int | str
    read_ns: int = 0
    due_ns: int = 0
    late_ns: int = 0
    messages: dict[type[Any], Any] = field(default_factory=dict)
    received: Counter[str] = field(default_factory=Counter)
    reported: bool = False

    def add(self, address: str, message: Any) -> None:
        kind = type(message)
        self.received[address] += 1
        if self.time == "" and kind not in _UNTIMED:
            self.time = _time_of_day(message)
        before = self.messages.setdefault(kind, message)
        if kind is pynmea2.GSA and (nav_mode(message) or 0) > (nav_mode(before) or 0):
            self.messages[kind] = message  # of several constellations one may be blind

    def take(self) -> Iterator[tuple[int, Fix]]:
        """The fix, unless it has been taken."""
        if not self.reported:
            self.reported = True
            yield self.t_ns, fix_of(self.messages)


class FixAssembler:
    """Sentences of one receiver to fixes: one for each epoch, also where it has no position."""

    def __init__(self) -> None:
        self._epoch: _Epoch | None = None
        self._early: dict[type[Any], tuple[str, Any]] = {}
        self._recent: deque[Counter[str]] = deque(maxlen=REMEMBERED_EPOCHS)
        self._expected: Counter[str] | None = None
        self._heads = _HEADS
        self._n_gll: int | None = 0  # None once a better sentence has come

    def feed(self, sentence: Sentence, t_ns: int) -> Iterator[tuple[int, Fix]]:
        """Fixes completed by a sentence, with the stamp of the first of its heads, or its due time.

        An epoch is complete when it has all that the last few had, whatever the receiver prints in
        whatever order. It ends without that when the next one begins, or by `flush`; what comes
        later joins no other epoch.
        """
        message, address = sentence.message, sentence.text[1:6]
        kind = type(message)
        fixes: list[tuple[int, Fix]] = []
        self._choose_heads(kind)
        if kind in self._heads and self._begins_epoch(address, message):
            fixes += self._begin(t_ns, message)
        epoch = self._epoch
        if kind in _TIMED and (epoch is None or _time_of_day(message) != epoch.time):
            self._early[kind] = address, message
        elif epoch and kind in self._heads | _TIMED | _UNTIMED:
            epoch.add(address, message)
            if self._expected is not None and epoch.received >= self._expected:
                fixes += epoch.take()
        return iter(fixes)

    def _choose_heads(self, kind: type[Any]) -> None:
        if kind in _HEADS:
            self._heads, self._n_gll = _HEADS, None
        elif kind is pynmea2.GLL and self._n_gll is not None:
            self._n_gll += 1
            self._heads = _LONE_HEADS if self._n_gll > _MOST_GLL else _HEADS

    def flush(self) -> Iterator[tuple[int, Fix]]:
        """The fix of what is pending, for a receiver that has fallen silent."""
        return iter(list(self._epoch.take()) if self._epoch else [])

    @property
    def time(self) -> int | str | None:
        """Time of day of the latest epoch, if any."""
        return None if self._epoch is None or self._epoch.time == "" else self._epoch.time

    @property
    def impossible_date(self) -> date | None:
        """Date of the latest position if that is too early to be true."""
        messages = self._epoch.messages if self._epoch else {}
        dated = (messages.get(kind) for kind in (pynmea2.RMC, pynmea2.ZDA))
        day = _first(_date(message) for message in dated if message)
        is_early = day is not None and day < EARLIEST_UTC
        return day if is_early and fix_of(messages).valid else None

    def _begins_epoch(self, address: str, message: Any) -> bool:
        if self._epoch is None or address in self._epoch.received:
            return True
        return (
            "" not in (self._epoch.time, time := _time_of_day(message)) and time != self._epoch.time
        )

    def _begin(self, t_ns: int, message: Any) -> Iterator[tuple[int, Fix]]:
        if self._epoch:
            yield from self._epoch.take()
            self._recent.append(self._epoch.received)
            self._expected = reduce(or_, self._recent)
        self._epoch = _next_epoch(self._epoch, t_ns, _time_of_day(message))
        for address, early in self._early.values():
            if _time_of_day(early) == self._epoch.time:
                self._epoch.add(address, early)
        self._early = {}


def _next_epoch(before: _Epoch | None, t_ns: int, time: int | str) -> _Epoch:
    """The epoch read at `t_ns`; of several read at once each has its due time."""
    epoch = _Epoch(t_ns, time, t_ns)
    if before is None or not isinstance(time, int) or not isinstance(before.time, int):
        return epoch
    came_ns, due_ns = t_ns - before.read_ns, (time - before.time) % DAY_NS
    if not 0 < due_ns < _LONGEST_DUE_NS:
        return epoch
    epoch.due_ns = due_ns
    is_in_time = due_ns < 2 * came_ns < 3 * due_ns
    # a pause longer than between the epochs before: else the receiver has set its clock back
    is_pause = 0 < 3 * before.due_ns < 2 * came_ns
    if not is_in_time and (before.late_ns or is_pause):
        epoch.late_ns = max(before.late_ns + came_ns - due_ns, 0)
        epoch.t_ns = max(t_ns - epoch.late_ns, before.t_ns + 1)
    return epoch


def _sentence(match: re.Match[bytes]) -> Sentence | None:
    body, checksum = match.groups()
    if reduce(xor, body) != int(checksum, 16):
        return None
    text = match[0].decode("ascii")
    try:
        return Sentence(text, pynmea2.parse(text, check=True))
    except Exception:  # noqa: BLE001 (pynmea2 1.19 also raises IndexError and TypeError)
        return Sentence(text)


def _noise(data: bytes) -> list[Sentence | Garbage]:
    data = data.translate(None, b"\r\n")
    return [Garbage(data)] if data else []


def _time_of_day(message: Any) -> int | str:
    """For comparison: "120000" equals "120000.00"."""
    time_ns = time_of_day_ns(message)
    text = _time_text(message)
    return text if time_ns is None else time_ns
