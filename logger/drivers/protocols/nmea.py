"""NMEA 0183: bytes of a receiver in, sentences out, and those of one epoch joined to a fix.

pynmea2 names the fields of a sentence. Framing is done here: pynmea2 loses the sentence after an
interrupted one (see firmware_notes/nmea.md).
"""

import re
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import reduce
from operator import or_, xor
from typing import Any

import pynmea2

from logger.core.types import Fix
from logger.drivers.protocols.garbage import Garbage
from logger.drivers.protocols.nmea_fix import fix_of, nav_mode, time_of_day_ns

MAX_SENTENCE = 1024  # bytes; the standard has 82, real receivers print up to some 300
REMEMBERED_EPOCHS = 4
"""A sentence missing in fewer epochs than these was damaged on the way, not switched off."""

_HEADS = frozenset({pynmea2.GGA, pynmea2.RMC, pynmea2.GNS})
"""Sentences that make an epoch; the others only add to one."""
_TIMED = frozenset({pynmea2.GST, pynmea2.ZDA})
_UNTIMED = frozenset({pynmea2.GSA, pynmea2.VTG})

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

        A sentence is complete with its checksum: its line end need not have come. Noise is reported
        as it comes, one event for each stretch in one call, without line ends.
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
    """Messages of one time of day by type: the first of each, of GSA the most informative."""

    t_ns: int
    time: int | str
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

    def feed(self, sentence: Sentence, t_ns: int) -> Iterator[tuple[int, Fix]]:
        """Fixes completed by a sentence, with the stamp of the first GGA, GNS or RMC.

        An epoch is complete when it has all that the last few had, so a receiver may print what it
        likes in the order it likes. It ends without that when the next one begins, or by `flush`;
        what comes later joins no other epoch.
        """
        message, address = sentence.message, sentence.text[1:6]
        kind = type(message)
        fixes: list[tuple[int, Fix]] = []
        if kind in _HEADS and self._begins_epoch(address, message):
            fixes += self._begin(t_ns, message)
        epoch = self._epoch
        if kind in _TIMED and (epoch is None or _time_of_day(message) != epoch.time):
            self._early[kind] = address, message
        elif epoch and kind in _HEADS | _TIMED | _UNTIMED:
            epoch.add(address, message)
            if self._expected is not None and epoch.received >= self._expected:
                fixes += epoch.take()
        return iter(fixes)

    def flush(self) -> Iterator[tuple[int, Fix]]:
        """The fix of what is pending, for a receiver that has fallen silent."""
        return iter(list(self._epoch.take()) if self._epoch else [])

    def _begins_epoch(self, address: str, message: Any) -> bool:
        """True for another time of day, or for a sentence that the epoch has already."""
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
        self._epoch = _Epoch(t_ns, _time_of_day(message))
        for address, early in self._early.values():
            if _time_of_day(early) == self._epoch.time:
                self._epoch.add(address, early)
        self._early = {}


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
    """Time of day for comparison: "120000" equals "120000.00"."""
    time_ns = time_of_day_ns(message)
    text: str = message.data[0]
    return text if time_ns is None else time_ns
