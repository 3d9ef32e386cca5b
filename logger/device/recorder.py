"""The writer thread: takes records from the inbox, runs the live estimate, and makes both durable every second."""

import logging
import threading
import time
from collections import Counter
from dataclasses import replace

from logger.core.live import LiveTracker
from logger.core.live_reference import STAGE
from logger.core.runfile import RunWriter
from logger.core.types import Level, LiveEstimate, Note, Record, Scan
from logger.device.clock import Clock
from logger.device.link import Inbox

log = logging.getLogger(__name__)

TICK_S = 1.0
"""Real seconds between two flushes: what a pulled plug can cost."""


class Recorder:
    """The only user of a `RunWriter`; `run` until `finish` is called from another thread.

    When it fails for good it sets `ended`, and `error` says why: a logger that does not record must not go on.
    """

    def __init__(
        self, writer: RunWriter, tracker: LiveTracker, inbox: Inbox, clock: Clock, ended: threading.Event
    ) -> None:
        self._writer = writer
        self._tracker = tracker
        self._inbox = inbox
        self._clock = clock
        self._ended = ended
        self._stop_reason: str | None = None
        self.failing = ""
        self.error: Exception | None = None
        self.counts: Counter[str] = Counter()
        self.latest: LiveEstimate | None = None

    def finish(self, reason: str) -> None:
        """Ask for the end: what is in the inbox is still recorded."""
        self._stop_reason = reason

    def run(self) -> None:
        try:
            while self._stop_reason is None:
                self._take_until(time.monotonic() + TICK_S)
                self._flush()
            self._close(self._stop_reason)
        except Exception as error:
            log.exception("the recorder has failed")
            self.error = error
            self._ended.set()

    def _close(self, reason: str) -> None:
        while (record := self._inbox.get(0.0)) is not None:
            self._append(record)
        self._flush()
        self._append(self._note("info", "stop", reason))
        self._writer.close(self._clock.now_ns(), reason)

    def _take_until(self, end_s: float) -> None:
        while (record := self._inbox.get(end_s - time.monotonic())) is not None:
            self._append(record)
            if time.monotonic() >= end_s:
                return

    def _flush(self) -> None:
        if dropped := self._inbox.take_dropped():
            text = f"{dropped} records lost: the recorder could not keep up"
            log.error(text)
            self._append(self._note("error", "overflow", text))
        self._sync()

    def _append(self, record: Record) -> None:
        if isinstance(scan := record.value, Scan):
            begun, ended = self._tracker.fix_at(scan.t_start_ns), self._tracker.fix_at(record.t_ns)
            scan = replace(scan, fix_start_seq=begun and begun.seq, fix_seq=ended and ended.seq)
            record = replace(record, value=scan)
            self.counts["readings"] += len(scan.readings)
        self.counts[type(record.value).__name__] += 1
        seq = self._writer.append(record)
        for value in self._tracker.feed(seq, record):
            self._writer.append(Record(record.t_ns, "live", value))
            if isinstance(value, LiveEstimate):
                if value.cell == self._tracker.target and value.stage != STAGE:
                    self.latest = value
            elif isinstance(value, Note):
                log.info("live: %s", value.text)

    def _sync(self) -> None:
        """Flush; on a full or failing card the records wait in memory, and both turns of fate are told once."""
        try:
            self._writer.sync()
        except OSError as error:
            if not self.failing:
                self.failing = str(error)
                log.error("cannot write the run (%s); keeping records in memory", error)  # noqa: TRY400
                self._append(self._note("error", "write-failed", f"card: {error}"))
            return
        if self.failing:
            log.warning("the run can be written again")
            self.failing = ""

    def _note(self, level: Level, code: str, text: str) -> Record:
        return Record(self._clock.now_ns(), "logger", Note(level, code, text))
