"""The live estimate in its own thread, so that reception never waits for it.

It gets the recorded fixes, scans and choices of a cell in their order, so that `postproc replay`
can repeat it. Its estimates go through the inbox and are recorded like all other records. Its
modules (numpy, the map) take seconds to import on a small board: its thread imports them while the
ports are recorded.
"""

import logging
import queue
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Self

from logger.core.live_settings import REFERENCE, LiveSettings
from logger.core.types import LiveEstimate, Note, Record
from logger.device.link import Inbox

if TYPE_CHECKING:
    from logger.core.baseline import Baseline
    from logger.core.guidance.followed_cell import FollowedCell, LivePosition
    from logger.core.guidance.next_way import NextWay
    from logger.core.guidance.street_atlas import Line
    from logger.core.live import LiveTracker
    from logger.core.suspicion.words import Assessment
    from logger.device.live_baseline import LiveBaseline
    from logger.device.status import PositionStatus

    Make = Callable[[Baseline, Sequence[Line]], LiveTracker]

log = logging.getLogger(__name__)

MOST_WAITING = 20_000
"""Records of half an hour; a processor that is so far behind leaves out what follows."""


def live_tracker(
    settings: LiveSettings, baseline: "Baseline", lines: "Sequence[Line]"
) -> "LiveTracker":
    """The tracker, whose modules are imported now."""
    from logger.core.live import LiveTracker  # noqa: PLC0415

    return LiveTracker(settings, baseline, lines)


def _rules_note() -> Note:
    """Which rules are applied; their modules are imported with the tracker."""
    from logger.core.suspicion.notes import start_note  # noqa: PLC0415

    return start_note()


class Estimator:
    """Feeds records to the tracker that `make` returns, until `finish`.

    `latest` is the newest estimate of the target, `suspicions` the words of cells with a finding,
    `next_way` and `position` the advice for the target and its posterior.

    `make` is called in the thread of the estimate, in which the files `baseline` and `streets` are
    read too.
    """

    def __init__(self, make: "Make", inbox: Inbox, baseline: str = "", streets: str = "") -> None:
        self._make = make
        self._baseline_name, self._streets_name = baseline, streets
        self._first_notes: list[Note] = []
        self._shown: LivePosition | None = None
        self._tracker: LiveTracker | None = None
        self._inbox = inbox
        self._waiting: queue.Queue[tuple[int, Record] | None] = queue.Queue(MOST_WAITING)
        self._behind = False
        self._last_ns = 0
        self._has_started = False
        self._thread = threading.Thread(target=self._run, name="estimate", daemon=True)
        self.latest: LiveEstimate | None = None
        self.suspicions: tuple[Assessment, ...] = ()
        self._n_changes = 0
        self.next_way: NextWay | None = None
        self.position: PositionStatus | None = None

    @classmethod
    def of(cls, settings: LiveSettings, inbox: Inbox) -> Self:
        """The live estimate as it is configured."""
        return cls(partial(live_tracker, settings), inbox, settings.baseline, settings.streets)

    @property
    def target(self) -> str | None:
        """The cell of the default view."""
        return None if self._tracker is None else self._tracker.target

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
        except queue.Full:
            return False
        self._thread.join(patience_s)
        return not self._thread.is_alive() and not self._behind

    def _run(self) -> None:
        try:
            baseline = self._open_baseline()
            self._tracker = self._make(baseline, self._read_streets())
            while (given := self._waiting.get()) is not None:
                self._estimate(self._tracker, baseline, *given)
        except Exception as error:  # a bug in the estimate must not end the recording
            log.exception("the live estimate has failed")
            self._behind = True
            self._inbox.put(
                Record(
                    self._last_ns,
                    "live",
                    Note("error", "internal", f"{type(error).__name__}: {error}"),
                )
            )

    def _open_baseline(self) -> "LiveBaseline":
        from logger.device.live_baseline import LiveBaseline  # noqa: PLC0415 (numpy)

        return LiveBaseline(self._baseline_name)

    def _read_streets(self) -> "list[Line]":
        from logger.device.live_streets import street_lines  # noqa: PLC0415 (numpy)

        lines, self._first_notes = street_lines(self._streets_name)
        return lines

    def _estimate(
        self, tracker: "LiveTracker", baseline: "LiveBaseline", seq: int, record: Record
    ) -> None:
        if not self._has_started:
            self._has_started = True
            for note in (_rules_note(), *self._first_notes):
                self._inbox.put(Record(record.t_ns, "live", note))
        self._last_ns = record.t_ns
        values = tracker.feed(seq, record)
        self._show(tracker.followed)
        if tracker.suspicion.n_changes != self._n_changes:
            self._n_changes = tracker.suspicion.n_changes
            found = [cell for cell in tracker.suspicion.assessments() if cell.findings]
            self.suspicions = tuple(found)
        for note in baseline.take_notes():
            self._inbox.put(Record(record.t_ns, "live", note))
        for value in values:
            self._inbox.put(Record(record.t_ns, "live", value))
            if isinstance(value, Note):
                log.info("live: %s", value.text)
            elif value.cell == tracker.target and value.stage != REFERENCE:
                self.latest = value

    def _show(self, followed: "FollowedCell | None") -> None:
        """Position and advice in degrees, where they are new."""
        if followed is None or followed.position is None or followed.position is self._shown:
            return
        from logger.core.guidance.map_form import next_way  # noqa: PLC0415 (numpy)
        from logger.device.guidance_status import position_status  # noqa: PLC0415

        self._shown = followed.position
        self.position = position_status(followed.cell, followed.utm, followed.position)
        self.next_way = next_way(followed.utm, followed.advice)
