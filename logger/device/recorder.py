"""The writer thread: records from the inbox to the run file, durable every second.

It also passes fixes, scans and the walker's choice of a cell to the live estimate.
"""

import errno
import logging
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from logger.core.errors import FieldLoggerError, RunFileError, why_not_written
from logger.core.latest import SampleHold
from logger.core.live_settings import BEHIND, FOLLOW, WITHIN, LiveSettings
from logger.core.runfile import FLOOR_BYTES, RunWriter, free_bytes, make_room, remove_oldest_runs
from logger.core.types import Fix, Level, Note, Record, Scan
from logger.device.clock import Clock
from logger.device.estimator import Estimator
from logger.device.link import Inbox

log = logging.getLogger(__name__)

TICK_S = 1.0
"""Real seconds between two flushes: what a pulled plug can cost."""

STOP_PATIENCE_TICKS = 10
"""Tries of a stop to get what waits in memory onto a full or failing card."""

ESTIMATE_PATIENCE_S = 20.0
"""Time that a stop waits for the live estimate; systemd allows 90 s for the stop."""
LOOK_EVERY_S = 30.0


class Recorder:
    """The only user of a `RunWriter`; `run` until `finish` is called from another thread.

    `durable` is called after each flush that reached the card: the watchdog is fed there. Below
    `floor_bytes` of free space, old journals with a verified HDF5 file are deleted, and with
    `delete_oldest` the oldest runs as well (`RoomKeeper`).
    After a permanent failure it sets `ended`, and `error` is the reason: a logger that does not
    record must not go on.
    """

    def __init__(
        self,
        writer: RunWriter,
        settings: LiveSettings,
        inbox: Inbox,
        clock: Clock,
        ended: threading.Event,
        *,
        durable: Callable[[], None] = lambda: None,
        floor_bytes: int = FLOOR_BYTES,
        delete_oldest: bool = False,
    ) -> None:
        self._writer = writer
        self.estimator = Estimator.of(settings, inbox, writer.path.parent)
        self._fixes = SampleHold[int](settings.max_fix_age_s)
        self._behind = False
        self._inbox = inbox
        self._clock = clock
        self._ended = ended
        self._durable = durable
        self._room = RoomKeeper(
            writer.path.parent, floor_bytes, self._note_from_thread, delete_oldest=delete_oldest
        )
        self._file = writer.file
        self._stop_reason: str | None = None
        self.failing = ""
        self.error: Exception | None = None
        self.counts: Counter[str] = Counter()

    @property
    def state(self) -> str:
        """State of the recording as text for a status line."""
        if self.error is not None:
            return f"failed: {self.error}"
        return f"waiting for the card: {self.failing}" if self.failing else "recording"

    def finish(self, reason: str) -> None:
        """Ask for the end: what is in the inbox is still recorded."""
        self._stop_reason = reason

    def run(self) -> None:
        try:
            self.estimator.start()
            while self._stop_reason is None:
                self._take_until(time.monotonic() + TICK_S)
                self._flush()
            self._close(self._stop_reason)
        except Exception as error:
            if not isinstance(error, FieldLoggerError):
                log.exception("the recorder has failed")
            self.error = error
            self._ended.set()

    def _close(self, reason: str) -> None:
        self._room.finish()
        self._empty_inbox()
        self._flush()
        if not self.estimator.finish(ESTIMATE_PATIENCE_S):
            self._note_behind()
        self._empty_inbox()
        self._flush()
        for _ in range(STOP_PATIENCE_TICKS):
            if not self.failing:
                break
            time.sleep(TICK_S)
            self._flush()
        self._append(self._note("info", "stop", reason))
        try:
            digest = self._writer.close(self._clock.now_ns(), reason)
        except OSError as error:
            text = f"{_refusal(error, self._writer.path.parent)}; what waited in memory is lost"
            raise RunFileError(text) from error
        log.info("%s is sealed with digest %s", self._writer.path, digest)

    def _empty_inbox(self) -> None:
        while (record := self._inbox.get(0.0)) is not None:
            self._append(record)

    def _take_until(self, end_s: float) -> None:
        while (record := self._inbox.get(end_s - time.monotonic())) is not None:
            self._append(record)
            if time.monotonic() >= end_s:
                return

    def _flush(self) -> None:
        self._note_dropped(self._inbox.take_dropped(), "the recorder could not keep up")
        self._sync()
        self._room.look()

    def _append(self, record: Record) -> None:
        if isinstance(scan := record.value, Scan):
            scan = replace(
                scan,
                fix_start_seq=self._fixes.at(scan.t_start_ns),
                fix_seq=self._fixes.at(record.t_ns),
            )
            record = replace(record, value=scan)
            self.counts["readings"] += len(scan.readings)
        self.counts[type(record.value).__name__] += 1
        self.counts[record.source] += 1
        try:
            seq = self._writer.append(record)
        except OverflowError as error:  # one impossible number must not end the run
            self._append(self._note("error", "unrecordable", f"{record.source}: {error}"))
            return
        if isinstance(record.value, Fix):
            self._fixes.add(record.t_ns, seq if record.value.valid else None)
        if _is_for_estimate(record) and not self.estimator.give(seq, record):
            self._note_behind()

    def _note_behind(self) -> None:
        if not self._behind:
            self._behind = True
            self._append(
                self._note(
                    "warning",
                    BEHIND,
                    "the live estimate is too slow; the desktop program computes the rest",
                )
            )

    def _sync(self) -> None:
        """If the card fails, keep the records in memory and note that once."""
        try:
            self._writer.sync()
        except OSError as error:
            what = error.strerror or str(error)
            if what != self.failing:
                self.failing = what
                message = "cannot write the run: %s; keeping records in memory"
                log.error(message, _refusal(error, self._writer.path.parent))  # noqa: TRY400
                self._append(self._note("error", "write-failed", f"card: {what}"))
            return
        if self.failing:
            self.failing = ""
            log.warning("the run can be written again")
            self._append(self._note("info", "write-resumed", "the card takes records again"))
            self._note_dropped(self._writer.take_dropped(), "the card took nothing for too long")
        if self._file != self._writer.file:
            self._file = self._writer.file
            self._append(
                self._note(
                    "warning",
                    "new-file",
                    f"the file has failed or is gone; going on in {self._file.name}",
                )
            )
        self._durable()

    def _note_dropped(self, n: int, why: str) -> None:
        if n:
            log.error("%d records lost: %s", n, why)
            self._append(self._note("error", "overflow", f"{n} records lost: {why}"))

    def _note_from_thread(self, level: Level, code: str, text: str) -> None:
        log.log(logging.getLevelNamesMapping()[level.upper()], "%s", text)
        self._inbox.put(self._note(level, code, text))

    def _note(self, level: Level, code: str, text: str) -> Record:
        return Record(self._clock.now_ns(), "logger", Note(level, code, text))


def _refusal(error: OSError, folder: Path) -> str:
    text = why_not_written(error)
    if error.errno == errno.EROFS:
        text = f"{text}: make {folder} writable, or set another [run] directory"
    return text


def _is_for_estimate(record: Record) -> bool:
    match record.value:
        case Fix() | Scan():
            return True
        case Note(code=code):
            return code in {FOLLOW, WITHIN}
    return False


class RoomKeeper:
    """Removes spare journals while the free space is below the floor.

    With `delete_oldest` whole runs follow, the oldest first. `note` (level, code, text) is called
    from its thread: reading runs again takes a Pi minutes.
    """

    def __init__(
        self,
        folder: Path,
        floor_bytes: int,
        note: Callable[[Level, str, str], None],
        *,
        delete_oldest: bool = False,
    ) -> None:
        self._folder = folder
        self._floor_bytes = floor_bytes
        self._note = note
        self._delete_oldest = delete_oldest
        self._thread: threading.Thread | None = None
        self._next_s = 0.0
        self._complaint = ""

    def look(self) -> None:
        """Start to make room where it is needed; returns at once."""
        if time.monotonic() < self._next_s or (
            self._thread is not None and self._thread.is_alive()
        ):
            return
        self._next_s = time.monotonic() + LOOK_EVERY_S
        with suppress(OSError):
            if free_bytes(self._folder) >= self._floor_bytes:
                self._complaint = ""
                return
        self._thread = threading.Thread(target=self._make_room, name="room", daemon=True)
        self._thread.start()

    def finish(self) -> None:
        """Begin nothing more."""
        self._next_s = float("inf")

    def _make_room(self) -> None:
        try:
            for journal in make_room(self._folder, self._floor_bytes):
                self._note(
                    "info",
                    "journal-removed",
                    f"{journal.name} made room: its HDF5 file holds the same",
                )
            for run in remove_oldest_runs(self._folder, self._floor_bytes, self._delete_oldest):
                self._note("warning", "run-removed", f"{run} made room on the card (delete_oldest)")
            left = free_bytes(self._folder)
            complaint = "the card is nearly full" if left < self._floor_bytes else ""
        except OSError as error:
            complaint = f"cannot make room: {error}"
        if complaint and complaint != self._complaint:
            self._note("warning", "card-nearly-full", complaint)
        self._complaint = complaint
