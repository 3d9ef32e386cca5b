"""The live estimate in its own thread, so that reception never waits for it.

It gets the recorded fixes, scans and choices of a cell in their order, so that `postproc replay`
can repeat it. Its estimates go through the inbox like all other records. Its modules (numpy, the
map) take seconds to import on a small board: its thread imports them while the ports are recorded.

An exception in it is noted with the number of the record. After a pause a new tracker begins with
the record that a second note names: replay leaves out the same records.
"""

import logging
import queue
import threading
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from traceback import format_tb
from typing import TYPE_CHECKING, Self

from msgspec.structs import replace

from logger.core.errors import error_place
from logger.core.live_settings import FAILED, RESTARTED, LiveSettings
from logger.core.types import Level, Note, RawBytes, Record
from logger.device.link import Inbox
from logger.device.live_view import LiveView, live_view

if TYPE_CHECKING:
    from logger.core.live import LiveTracker
    from logger.device.live_files import LiveFiles

    Make = Callable[[LiveFiles], LiveTracker]

log = logging.getLogger(__name__)

MOST_WAITING = 20_000
"""Records of half an hour; a processor so far behind leaves out what follows."""
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 10.0, 600.0
"""Time of the records that a failed estimate waits: twice as long each time, since what fails at
each scan must not take the processor."""


def live_tracker(settings: LiveSettings, files: "LiveFiles") -> "LiveTracker":
    """The tracker, whose modules are imported now."""
    from logger.core.live import LiveTracker  # noqa: PLC0415

    return LiveTracker(settings, baseline=files, streets=files)


def _rules_note() -> Note:
    """Imports the rules only now, with the tracker."""
    from logger.core.suspicion.rules import rules_note  # noqa: PLC0415

    return rules_note()


def _in_plain_words(text: str) -> str:
    from logger.core.suspicion.words import in_plain_words  # noqa: PLC0415

    return in_plain_words(text)


def _log_place(error: Exception) -> None:
    """Without the message, which may have what is private."""
    log.error("live estimate: %s\n%s", error_place(error), "".join(format_tb(error.__traceback__)))


class Estimator:
    """Feeds records to the tracker that `make` returns, until `finish`.

    `make` is called in the thread of the estimate, where the files that `settings` name are read
    too; `folder` is that of the runs.
    """

    def __init__(
        self,
        make: "Make",
        inbox: Inbox,
        settings: LiveSettings = LiveSettings(),  # noqa: B008 (frozen)
        folder: Path = Path(),
    ) -> None:
        self._make = make
        self._settings, self._folder = settings, folder
        self._tracker: LiveTracker | None = None
        self._inbox = inbox
        self._waiting: queue.Queue[tuple[int, Record] | None] = queue.Queue(MOST_WAITING)
        self._behind = self._is_over = False
        self._has_started = False
        self._n_failures, self._again_ns = 0, 0
        self._failure = ""
        self._asked: dict[str, tuple[int, Record]] = {}
        self._thread = threading.Thread(target=self._run, name="estimate", daemon=True)
        self._left_out: tuple[str, ...] = ()
        self._view = LiveView()

    @classmethod
    def of(cls, settings: LiveSettings, inbox: Inbox, folder: Path = Path()) -> Self:
        """The live estimate as it is configured."""
        return cls(partial(live_tracker, settings), inbox, settings, folder)

    @property
    def view(self) -> LiveView:
        """What is known now."""
        trouble = "no live estimate: this processor is too slow for it"
        return replace(
            self._view,
            no_estimate=trouble if self._behind else self._failure,
            left_out=self._left_out,
        )

    def start(self) -> None:
        self._thread.start()

    def give(self, seq: int, record: Record) -> bool:
        """Take a recorded fix, scan or choice of a cell.

        False from the first one on for which there is no room.
        """
        if not self._behind:
            try:
                self._waiting.put_nowait((seq, record))
            except queue.Full:
                self._behind = True
        return not self._behind

    def finish(self, patience_s: float) -> bool:
        """Work off what waits; False where that has not been done in the time."""
        try:
            self._waiting.put(None, timeout=patience_s)
            self._thread.join(patience_s)
        except queue.Full:
            self._behind = True
        # what is left would only take the processor from what the stop has to do
        self._is_over = True
        return not self._thread.is_alive() and not self._behind

    def _run(self) -> None:
        try:
            with closing(self._open_files()) as files:
                self._tracker = self._made_ahead(files)
                while (given := self._waiting.get()) is not None and not self._is_over:
                    self._take(*given, files)
        except Exception:  # nothing is left to try
            log.exception("the live estimate has ended")
            self._behind = True

    def _open_files(self) -> "LiveFiles":
        from logger.device.live_files import LiveFiles  # noqa: PLC0415 (numpy)

        return LiveFiles(self._settings, self._folder)

    def _made_ahead(self, files: "LiveFiles") -> "LiveTracker | None":
        """The first tracker, before there is a record; what fails here is tried again with one."""
        try:
            return self._make(files)
        except Exception as error:  # noqa: BLE001
            _log_place(error)
            return None

    def _take(self, seq: int, record: Record, files: "LiveFiles") -> None:
        if isinstance(record.value, Note):
            self._asked[record.value.code] = seq, record
        if self._tracker is None and record.t_ns < self._again_ns:
            return
        try:
            if self._tracker is None:
                self._tracker = self._begin(seq, record, files)
            self._estimate(self._tracker, seq, record)
        except Exception as error:  # noqa: BLE001 (a bug must not end it, nor the recording)
            self._fail(seq, record, error)
        for note in files.take_notes():
            if note.level == "warning":
                self._left_out = (*self._left_out, note.text)
            self._inbox.put(Record(record.t_ns, "live", note))
        if lines := files.take_lines():
            self._inbox.put(Record(record.t_ns, "live", RawBytes(lines)))

    def _begin(self, seq: int, record: Record, files: "LiveFiles") -> "LiveTracker":
        tracker = self._make(files)
        if self._failure:
            for earlier in self._asked.values():
                if earlier[0] != seq:
                    tracker.feed(*earlier)
            self._note(seq, record, "info", RESTARTED, "the live estimate has started again")
            self._failure = ""
        return tracker

    def _fail(self, seq: int, record: Record, error: Exception) -> None:
        _log_place(error)
        self._tracker, self._view = None, LiveView()
        pause_s = min(_FIRST_PAUSE_S * 2.0**self._n_failures, _LONGEST_PAUSE_S)
        self._n_failures += 1
        self._again_ns = record.t_ns + round(pause_s * 1e9)
        where = error_place(error)
        self._failure = f"no live estimate: {where}; a new one begins after {pause_s:.0f} s"
        self._note(seq, record, "error", FAILED, f"{where}; a new one begins after {pause_s:.0f} s")

    def _note(self, seq: int, record: Record, level: Level, code: str, text: str) -> None:
        self._inbox.put(Record(record.t_ns, "live", Note(level, code, f"record {seq}: {text}")))

    def _estimate(self, tracker: "LiveTracker", seq: int, record: Record) -> None:
        """All of the estimate is recorded, or nothing."""
        if not self._has_started:
            self._has_started = True
            self._inbox.put(Record(record.t_ns, "live", _rules_note()))
        values = tracker.feed(seq, record)
        self._view = live_view(tracker)
        for value in values:
            self._inbox.put(Record(record.t_ns, "live", value))
            if isinstance(value, Note):
                log.info("live: %s", _in_plain_words(value.text))
