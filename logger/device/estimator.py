"""The live estimate in a thread of its own: what is received must never wait for it, however slow the processor.

It is given the recorded fixes and scans in their order, so that the desk can repeat it; what it finds goes back through
the inbox and is recorded like everything else.
"""

import logging
import queue
import threading

from logger.core.live import LiveTracker
from logger.core.live_reference import STAGE
from logger.core.types import LiveEstimate, Note, Record
from logger.device.link import Inbox

log = logging.getLogger(__name__)

MOST_WAITING = 20_000
"""Records of half an hour; a processor that is so far behind leaves out what follows."""


class Estimator:
    """Feeds a tracker until `finish`; `latest` is the newest estimate of its target."""

    def __init__(self, tracker: LiveTracker, inbox: Inbox) -> None:
        self._tracker = tracker
        self._inbox = inbox
        self._waiting: queue.Queue[tuple[int, Record] | None] = queue.Queue(MOST_WAITING)
        self._behind = False
        self._last_ns = 0
        self._thread = threading.Thread(target=self._run, name="estimate", daemon=True)
        self.latest: LiveEstimate | None = None

    def start(self) -> None:
        self._thread.start()

    def give(self, seq: int, record: Record) -> bool:
        """Take a recorded fix or scan; False from the first one on for which there is no room."""
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
        except queue.Full:
            return False
        self._thread.join(patience_s)
        return not self._thread.is_alive() and not self._behind

    def _run(self) -> None:
        try:
            while (given := self._waiting.get()) is not None:
                self._estimate(*given)
        except Exception as error:  # a bug in the estimate must not end the recording
            log.exception("the live estimate has failed")
            self._behind = True
            self._inbox.put(
                Record(self._last_ns, "live", Note("error", "internal", f"{type(error).__name__}: {error}"))
            )

    def _estimate(self, seq: int, record: Record) -> None:
        self._last_ns = record.t_ns
        for value in self._tracker.feed(seq, record):
            self._inbox.put(Record(record.t_ns, "live", value))
            if isinstance(value, Note):
                log.info("live: %s", value.text)
            elif value.cell == self._tracker.target and value.stage != STAGE:
                self.latest = value
