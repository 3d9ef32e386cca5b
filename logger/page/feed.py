"""What all phones are sent: the status, the walk and the machine as one JSON text."""

import asyncio
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from logger.core.runfile.run_names import JOURNAL
from logger.device.machine import Machine, machine
from logger.device.status import SILENT_S, Status, read_status
from logger.page.walk import TABLES, JournalTail, Walk

LOOK_S = 0.1
BEAT_S = 1.0
"""Without anything new the phone hears this often that the page is there."""
MACHINE_S = 5.0
_JOURNAL = re.compile(rf"[\w.-]+{re.escape(JOURNAL)}", re.ASCII)


class State(msgspec.Struct, frozen=True):
    """One message to the phones.

    `silent_s` is for how long the recorder has said nothing; `status` is then its last one, None
    without any. `kept` is the number of readings of a run that was closed in order, else None.
    `minute` has age and level of the followed cell's readings.
    """

    silent_s: float
    status: Status | None
    minute: list[tuple[float, float]]
    n_marks: int
    machine: Machine
    cell: str | None
    has_map: bool
    kept: int | None


class Feed:
    """`text` is renewed when the recorder writes, and at least each second; `changed` says so."""

    def __init__(self, status: Path, runs: Path, *, has_map: bool = False) -> None:
        self._folder, self._runs, self._has_map = status, runs, has_map
        self._status: Status | None = None
        self._stamp = self._beat_s = self._machine_s = -1.0
        self._heard_s = time.monotonic()
        self._machine = Machine()
        self._tail: JournalTail | None = None
        self._is_behind = False
        self._changed = asyncio.Event()
        self.walk = Walk()
        self.text = b""

    @property
    def cell(self) -> str | None:
        """The cell of the finder and the plan: the one followed, else the recorder's target."""
        status = self._status
        if status is None:
            return None
        return status.followed or (status.target.cell if status.target else None)

    @property
    def is_silent(self) -> bool:
        """Whether no recorder writes its status."""
        return self._status is None or time.monotonic() - self._heard_s > SILENT_S

    async def has_recorded(self, request: str, patience_s: float) -> bool:
        """Wait until the recorder names a request as recorded; False where it does not in time."""
        end_s = time.monotonic() + patience_s
        while self._status is None or request not in self._status.recorded:
            left_s = end_s - time.monotonic()
            if left_s <= 0.0:
                return False
            with suppress(TimeoutError):
                await asyncio.wait_for(self.changed(), left_s)
        return True

    async def changed(self) -> None:
        """Wait for the next text."""
        await self._changed.wait()

    async def run(self) -> None:
        """Look for news until cancelled."""
        while True:
            self.look()
            await asyncio.sleep(LOOK_S)

    def look(self) -> None:
        """Renew the text where there is anything new, or a second has passed."""
        now_s = time.monotonic()
        has_news, is_due = self._read_status(now_s), now_s - self._beat_s >= BEAT_S
        if has_news or self._is_behind or is_due:  # a run is closed after its last status
            self._read_journal()
        if not has_news and not is_due:
            return
        self._beat_s = now_s
        if now_s - self._machine_s > MACHINE_S or not self.text:
            self._machine, self._machine_s = machine(self._runs), now_s
        self.text = msgspec.json.encode(self._state(now_s))
        self._changed.set()
        self._changed = asyncio.Event()

    def _read_journal(self) -> None:
        """Take the next portion; an old walk is read in many, between which phones are answered."""
        self._is_behind = False
        for table, row in self._tail.rows() if self._tail else ():
            self._is_behind = True
            self.walk.take(table, row)

    def _read_status(self, now_s: float) -> bool:
        """Read status.json where it is another; a status with the old time is no news."""
        try:
            stamp = (self._folder / "status.json").stat().st_mtime_ns
        except OSError:
            stamp = 0
        if stamp == self._stamp:
            return False
        self._stamp = stamp
        try:
            status = read_status(self._folder)
        except OSError:
            status = None
        if status is None:
            return False
        self._heard_s, self._status = now_s, status
        self._follow_run(Path(status.run))
        return True

    def _follow_run(self, journal: Path) -> None:
        """Begin with the journal of another run; a status names no file outside the runs."""
        journal = self._runs / journal.name
        is_one = _JOURNAL.fullmatch(journal.name) is not None
        if is_one and (self._tail is None or self._tail.journal != journal):
            self._tail, self.walk = JournalTail(journal, TABLES), Walk()

    def _state(self, now_s: float) -> State:
        status = self._status
        silent_s = now_s - self._heard_s
        now_ns = status.now_ns if status else 0
        return State(
            silent_s=round(silent_s, 1) if silent_s > SILENT_S else 0.0,
            status=status,
            minute=self.walk.minute(self.cell, now_ns),
            n_marks=self.walk.n_marks,
            machine=self._machine,
            cell=self.cell,
            has_map=self._has_map,
            kept=self.walk.n_readings if self._tail and self._tail.is_sealed else None,
        )

    def track(self, from_point: int, from_level: int) -> dict[str, Any]:
        """What the plan draws, from the numbers of points and levels that it has."""
        cell = self.cell or ""
        run = self._tail.journal.stem if self._tail else ""
        return {"run": run, "cell": cell, **self.walk.track(cell, from_point, from_level)}
