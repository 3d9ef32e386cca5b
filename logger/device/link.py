"""A source of records, its lines of `fieldlogger check`, and the thread that opens it again."""

import logging
import os
import queue
import stat
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Literal, Self, TypeVar

import msgspec

from logger.config import SourceSettings
from logger.core.errors import DeviceError, FieldLoggerError
from logger.core.types import Level, Note, RawBytes, Record, Value
from logger.device.clock import Clock
from logger.device.port import Port, check_url
from logger.device.scan_timeout import SilenceLimits
from logger.drivers.protocols.redaction import Redactor
from logger.drivers.reading.recognition import NumberHistory

NOT_THERE, NO_PORT = "is not there now", "is no serial port"
NO_EPOCHS = "no-epochs"
"""Code of the note that a receiver is at fault until its next fix record."""
DRIVER = ": driver "  # between the name of a modem and its driver in a note
_MEMORY_DEVICES = 1
"""Their major number: /dev/zero and /dev/null are no ports (Linux admin-guide/devices.txt)."""
State = Literal["ok", "warn", "fail"]
log = logging.getLogger(__name__)

RETRY_S = 1.0
LISTEN_S = 0.2
"""Longest time that a read of a silent port blocks its thread."""
NOTE_INTERVAL_S = 10.0
"""Interval of the notes on frequent events: the run shows the trend, and the log stays readable."""
MOST_CHUNKS_LEFT = 32
"""Serial buffers hold far less; a device that never stops sending must not delay the stop."""


@dataclass(frozen=True, slots=True)
class Line:
    """One thing checked: `warn` may still come right by itself, `fail` will not."""

    state: State
    what: str
    text: str


def port_line(name: str, url: str) -> Line:
    """Whether a port that may be plugged in later is there, and may be used."""
    if "://" in url:
        return Line("ok", name, f"{url} is a network port, not looked at")
    path = Path(url)
    try:
        status = path.stat()
        is_device = stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) != _MEMORY_DEVICES
    except FileNotFoundError:
        return Line("warn", name, f"{url} {NOT_THERE}; it is picked up when it is plugged in")
    except OSError as error:
        return Line("fail", name, f"{url}: {error.strerror}")
    if not is_device:
        return Line("fail", name, f"{url} {NO_PORT}")
    if not os.access(path, os.R_OK | os.W_OK):
        return Line("fail", name, f"no permission for {url}; add this user to the group dialout")
    return Line("ok", name, url)


class Inbox:
    """The bounded queue between the ports and the recorder.

    A full queue drops and counts records; it never blocks a reader.
    """

    def __init__(self, size: int = 20_000) -> None:
        self._queue: queue.Queue[Record] = queue.Queue(size)
        self._lock = threading.Lock()
        self._dropped = 0

    def put(self, record: Record) -> bool:
        """Pass a record on; False where it was dropped."""
        try:
            self._queue.put_nowait(record)
        except queue.Full:
            with self._lock:
                self._dropped += 1
            return False
        return True

    def get(self, timeout_s: float) -> Record | None:
        try:
            return self._queue.get(timeout=timeout_s) if timeout_s > 0 else self._queue.get_nowait()
        except queue.Empty:
            return None

    def take_dropped(self) -> int:
        """Records dropped since the last call."""
        with self._lock:
            dropped, self._dropped = self._dropped, 0
        return dropped


class Tally:
    """A count of events too frequent for a note each."""

    def __init__(self, what: str, least: int) -> None:
        self.what = what
        self._least = least
        self._n = 0
        self._since_ns = 0

    def add(self, n: int, now_ns: int) -> None:
        self._since_ns = self._since_ns if self._n else now_ns
        self._n += n

    def take(self, now_ns: int | None = None) -> str | None:
        """Text of a note due at `now_ns`, or (None) at the end of the connection."""
        if not self._n or (now_ns is not None and now_ns - self._since_ns < NOTE_INTERVAL_S * 1e9):
            return None
        n, self._n = self._n, 0
        return f"{n} {self.what}" if n >= self._least else None


Settings = TypeVar("Settings", bound=SourceSettings)


@dataclass(frozen=True, slots=True)
class Device:
    """What a probe has found at a port: kind of device, driver, and what it says of itself.

    `receiver` is whether a modem has a receiver of its own, None where unknown.
    """

    kind: str
    text: str
    driver: str | None = None
    receiver: bool | None = None


class Source(ABC, Generic[Settings]):
    """Where records come from; a kind of source is one file with a class derived from this.

    `patience_s` is the time without a scan after which it has failed, None if it receives no cells.
    A port of a source that `may_be_swapped` may be another device's.
    """

    may_be_swapped = False

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    @property
    def name(self) -> str:
        """Source of its records."""
        return self.settings.name

    @property
    def port(self) -> str:
        """What it is behind, as the status shows it."""
        return self.settings.port

    @property
    def patience_s(self) -> float | None:
        return None

    def at(self, port: str) -> Self:
        """The same source at another port."""
        return type(self)(msgspec.structs.replace(self.settings, port=port))

    @abstractmethod
    def open(self, read_timeout_s: float) -> Port:
        """The bytes; raises `DeviceError` when it cannot be opened now."""

    def redactor(self) -> Redactor:
        """What masks private numbers in its bytes before anything is recorded or read."""
        return Redactor()

    @abstractmethod
    def session(self, link: "Link", folder: Path) -> None:
        """Read the open link and emit values until it is stopped; raises `DeviceError`.

        What must survive a power cut may be stored in `folder`, that of the runs.
        """

    def validate(self) -> None:
        """Raise `ConfigError` for what can never work; nothing is opened."""
        check_url(self.port)

    def check(self) -> Iterator[Line]:
        """What can be known without opening it."""
        yield port_line(self.name, self.port)

    def examine(self) -> Iterator[Line]:
        """What `fieldlogger doctor` asks it before a trial."""
        yield from ()

    @classmethod
    def probe(cls, port: Port) -> Device | None:
        """What has answered at an open serial port, None if no source of this kind."""
        del port
        return None


class Link:
    """A session's access to its source, the clock and the recorder.

    Private numbers are redacted before anything is recorded or read. `silence_limits`, learned from
    the device, and `known`, the numbers that it has sent, outlive a session.
    """

    def __init__(
        self,
        source: Source[Any],
        clock: Clock,
        inbox: Inbox,
        stop: threading.Event,
    ) -> None:
        self.source = source
        self.clock = clock
        self.stop = stop
        self.silence_limits = SilenceLimits()
        self.known = NumberHistory()
        # of the latest fix, and when the first fix had it
        self.latest_time: tuple[object, int] = None, 0
        self._inbox = inbox
        self._redactor = source.redactor()
        self._port: Port | None = None
        self._open_source = source
        self._tallies: dict[str, Tally] = {}
        self.has_heard = False
        """Whether the last read got bytes, which redaction may hold back until their line ends."""

    @property
    def name(self) -> str:
        """Source of the records."""
        return self.source.name

    @property
    def is_within_line(self) -> bool:
        """Whether a line has begun that is held back."""
        return self._redactor.is_within_line

    def run(self, folder: Path) -> None:
        """Open the source and run its session, again after each loss, until stopped.

        `folder` is that of the runs.
        """
        complaint = ""
        while not self.stop.is_set():
            source = self._open_source = self.source
            try:
                with source.open(self.clock.real_s(LISTEN_S)) as self._port:
                    complaint = ""
                    self.note("info", "port-opened", f"{source.port} opened")
                    try:
                        source.session(self, folder)
                    finally:
                        self._take_rest(self._port)
                        self._note_tallies()  # before the loss, which the status shows
            except FieldLoggerError as error:
                # a missing device is reported once, not every second
                if str(error) != complaint:
                    complaint = str(error)
                    self.note("warning", "port-lost", complaint)
            except Exception as error:  # a bug in one link must not end the recording of the other
                log.exception("%s: unexpected", self.name)
                self.note("error", "internal", f"{type(error).__name__}: {error}")
            if pending := self._redactor.flush():
                self.emit(RawBytes(pending), self.clock.now_ns())
            self.clock.wait(self.stop, RETRY_S)

    def move(self, url: str) -> None:
        """Leave the port and continue at another."""
        self.source = self.source.at(url)

    @property
    def is_leaving(self) -> bool:
        """Whether the open port was left."""
        return self.source is not self._open_source

    def read(self) -> tuple[int, bytes]:
        """Time and bytes of the next chunk, which is recorded raw before it is interpreted."""
        if self._port is None:
            raise DeviceError(f"{self.name}: port is closed")
        if self.is_leaving:
            raise DeviceError(f"port {self._open_source.port}: left for {self.source.port}")
        self._note_tallies(self.clock.now_ns())
        return self._take(self._port.read())

    def write(self, data: bytes) -> None:
        if self._port is None:
            raise DeviceError(f"{self.name}: port is closed")
        self.emit(RawBytes(data, sent=True), self.clock.now_ns())
        self._redactor.send(data)
        self._port.write(data)

    def emit(self, value: Value, t_ns: int, source: str | None = None) -> None:
        self._inbox.put(Record(t_ns, source or self.name, value))

    def note(self, level: Level, code: str, text: str) -> None:
        """Record an event, and log it."""
        log.log(logging.getLevelNamesMapping()[level.upper()], "%s: %s", self.name, text)
        self.emit(Note(level, code, text), self.clock.now_ns())

    def count(self, code: str, n: int, what: str, least: int = 1) -> None:
        """Count an event; a note with the number follows ten seconds after the first.

        Fewer than `least` events give no note.
        """
        tally = self._tallies.setdefault(code, Tally(what, least))
        tally.what = what
        tally.add(n, self.clock.now_ns())

    def count_garbage(self, n_bytes: int) -> None:
        """Count bytes that no framer could read."""
        self.count("garbage", n_bytes, "unreadable bytes")

    def _take(self, data: bytes) -> tuple[int, bytes]:
        """Returns their time and what redaction leaves of them."""
        t_ns = self.clock.now_ns()
        self.has_heard = bool(data)
        data = self._redactor.feed(data)
        if data:
            self.emit(RawBytes(data), t_ns)
        return t_ns, data

    def _take_rest(self, port: Port) -> None:
        """Closing the port would discard it."""
        with suppress(DeviceError):
            for _ in range(MOST_CHUNKS_LEFT):
                data = port.rest()
                if not data:
                    return
                self._take(data)

    def _note_tallies(self, now_ns: int | None = None) -> None:
        for code, tally in self._tallies.items():
            if text := tally.take(now_ns):
                self.note("warning", code, text)
