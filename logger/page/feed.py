"""What all phones are sent: status, walk (track, levels, marks) and machine as one JSON text."""

import asyncio
import math
import os
import re
import time
from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from logger.core.fix_gate import METRES_PER_DEG
from logger.core.foreign import open_regular
from logger.core.latest import Latest
from logger.core.live_settings import MARK
from logger.core.runfile.frames import Frame, Kind, payload_of, scan
from logger.core.runfile.run_names import JOURNAL, part_path
from logger.core.schema import SCHEMA_VERSION, columns_of, packing_of
from logger.core.types import CellReading
from logger.device.machine import Machine, machine
from logger.device.status import SILENT_S, Status, read_status

_CRC_BYTES = 4
_PORTION = 1 << 16
_LARGEST_PORTION = 1 << 22
"""Frames of a second are far smaller; only a flush after a full card makes larger ones."""
_OLDEST = 3
"""Version of the rows that are read; before it `identity_unsure` is missing."""
_PACKING = {version: packing_of(version) for version in range(_OLDEST, SCHEMA_VERSION + 1)}
_NAMES = {
    version: {table: [name for name, _ in of] for table, of in columns_of(version).items()}
    for version in _PACKING
}

Row = dict[str, Any]
LOOK_S = 0.1
BEAT_S = 1.0
"""Without anything new the phone hears this often that the page is there."""
MACHINE_S = 5.0
_JOURNAL = re.compile(rf"[\w.-]+{re.escape(JOURNAL)}", re.ASCII)


class JournalTail:
    """Follows the files of one journal; `rows` are those that are new.

    `is_sealed` says that the recorder has closed it in order.
    """

    def __init__(self, journal: Path, tables: frozenset[str]) -> None:
        self.journal = journal
        self._tables = tables
        self._part = 1
        self._position = 0
        self._portion = _PORTION
        self.is_sealed = False

    def rows(self) -> Iterator[tuple[str, Row]]:
        """Rows of the next portion with the names of their tables; values as they are stored."""
        data = self._read()
        end = 0
        for frame in scan(data):
            if isinstance(frame, Frame):
                end = frame.start + frame.length + _CRC_BYTES
                self.is_sealed |= frame.kind == Kind.END
                yield from self._rows_in(frame, data)
        self._position += end
        if end:
            self._portion = _PORTION
        elif data.strip(b"\0"):
            self._portion = min(2 * self._portion, _LARGEST_PORTION)
        elif part_path(self.journal, self._part + 1).exists():
            self._part, self._position = self._part + 1, 0

    def _read(self) -> bytes:
        try:
            with open_regular(part_path(self.journal, self._part), follow_links=False) as file:
                return os.pread(file.fileno(), self._portion, self._position)
        except OSError:
            return b""

    def _rows_in(self, frame: Frame, data: bytes) -> Iterator[tuple[str, Row]]:
        if frame.kind != Kind.ROWS or frame.schema not in _PACKING:
            return
        packing, names = _PACKING[frame.schema], _NAMES[frame.schema]
        payload = payload_of(data[frame.start : frame.start + frame.length], frame.version)
        if not payload:
            return
        table = payload[1 : 1 + payload[0]].decode("ascii", "replace")
        body = payload[1 + payload[0] :]
        if table not in self._tables or len(body) % packing[table].size:
            return
        for values in packing[table].iter_unpack(body):
            yield table, dict(zip(names[table], values, strict=True))


TABLES = frozenset({"fixes", "readings", "notes"})
STEP_M = 4.0
"""Distance of points of the track: less is not seen on a phone."""
MOST_POINTS = 20_000
"""Of the track: 80 km."""
MOST_LEVELS = 20_000
"""Of each cell: eleven hours of scans."""
MOST_MARKS = 500
MOST_CELLS = 64
MOST_COUNTED = 20_000  # names take 2 MB: a drive through a country
MINUTE_NS = 60 * 10**9


class Walk:
    """One run so far; `take` its rows in order.

    `n_marks` grows with each mark on the card, `n_readings` with each reading.
    """

    def __init__(self) -> None:
        self._t_ns, self._lat, self._lon = array("q"), array("d"), array("d")
        self._cells: Latest[_Levels] = Latest(MOST_CELLS)
        self._names: set[bytes] = set()
        self._marks: deque[tuple[float, float, str]] = deque(maxlen=MOST_MARKS)
        self._here: tuple[float, float] | None = None
        self.n_marks = self.n_readings = 0

    def take(self, table: str, row: Row) -> None:
        """Take a row of the run."""
        if table == "fixes" and row["valid"]:
            self._add_point(row["t_ns"], row["lat_deg"], row["lon_deg"])
        elif table == "readings":
            self.n_readings += 1
            if row["cell"] and not row["identity_unsure"]:
                if len(self._names) < MOST_COUNTED:
                    self._names.add(row["cell"])
                self._add_level(row)
        elif table == "notes" and _text(row["code"]) == MARK:
            self.n_marks += 1
            if self._here is not None:
                self._marks.append((*self._here, _text(row["text"])))

    @property
    def n_cells(self) -> int:
        return len(self._names)

    def minute(self, cell: str | None, now_ns: int) -> list[tuple[float, float]]:
        """Age in seconds and level of the readings of a cell in the last minute."""
        levels = self._cells.get(cell or "")
        if levels is None:
            return []
        recent = ((t_ns, level) for t_ns, level in levels.recent if t_ns > now_ns - MINUTE_NS)
        return [(round((now_ns - t_ns) / 1e9, 1), level) for t_ns, level in recent]

    def track(self, cell: str, from_point: int = 0, from_level: int = 0) -> dict[str, Any]:
        """Points from a number on, and levels of a cell, each with the number of its point."""
        points = zip(self._lat[from_point:], self._lon[from_point:], strict=True)
        levels = self._cells.get(cell)
        at = [] if levels is None else levels.point[from_level:]
        dbm = [] if levels is None else levels.dbm[from_level:]
        return {
            "points": [(round(lat, 6), round(lon, 6)) for lat, lon in points],
            "levels": [(i, round(level, 1)) for i, level in zip(at, dbm, strict=True)],
            "marks": list(self._marks),
        }

    def _add_point(self, t_ns: int, lat_deg: float, lon_deg: float) -> None:
        self._here = lat_deg, lon_deg
        if len(self._lat) >= MOST_POINTS or not math.isfinite(lat_deg + lon_deg):
            return
        if self._lat:
            north_m = (lat_deg - self._lat[-1]) * METRES_PER_DEG
            east_m = (lon_deg - self._lon[-1]) * METRES_PER_DEG * math.cos(math.radians(lat_deg))
            if math.hypot(north_m, east_m) < STEP_M:
                return
        self._t_ns.append(t_ns)
        self._lat.append(lat_deg)
        self._lon.append(lon_deg)

    def _add_level(self, row: Row) -> None:
        level_dbm = _level_dbm(row)
        if level_dbm is None:
            return
        name = _text(row["cell"])
        levels = self._cells.get(name) or _Levels()
        self._cells.put(name, levels)
        levels.recent.append((row["t_ns"], level_dbm))
        if self._lat and len(levels.dbm) < MOST_LEVELS:
            # a flush writes its fixes together, those after the reading too
            levels.point.append(max(bisect_right(self._t_ns, row["t_ns"]) - 1, 0))
            levels.dbm.append(level_dbm)


class _Levels:
    def __init__(self) -> None:
        self.point, self.dbm = array("I"), array("f")
        self.recent: deque[tuple[int, float]] = deque(maxlen=120)


def _level_dbm(row: Row) -> float | None:
    known = {
        name: value
        for name in ("rsrp_dbm", "rscp_dbm", "rssi_dbm")
        if math.isfinite(value := row[name])
    }
    index = row["rxlev_raw"] if row["rxlev_raw"] >= 0 else None
    return CellReading("scan", rxlev_raw=index, **known).level_dbm


def _text(stored: bytes) -> str:
    return stored.rstrip(b"\0").decode("utf-8", "replace")


class State(msgspec.Struct, frozen=True):
    """One message to the phones.

    `silent_s` is for how long the recorder has said nothing; `status` is its last one, None without
    any. `kept` is the number of readings of a run that was closed in order, else None. `minute` has
    age and level of the followed cell's readings.
    """

    silent_s: float
    status: Status | None
    minute: list[tuple[float, float]]
    n_marks: int
    n_cells: int
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
        """Wait until the recorder names a request as recorded; False if not in time."""
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
        """An old walk is read in many portions, between which phones are answered."""
        self._is_behind = False
        for table, row in self._tail.rows() if self._tail else ():
            self._is_behind = True
            self.walk.take(table, row)

    def _read_status(self, now_s: float) -> bool:
        """A status with the old time is no news."""
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
        """A status names no file outside the runs."""
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
            n_cells=self.walk.n_cells,
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
