"""Levels of the cells of late, as the walker sees them: average, peak, warmer or colder."""

import threading
from collections import deque
from collections.abc import Iterable

from logger.core.latest import Latest
from logger.core.live_settings import REFERENCE
from logger.core.types import CellReading, LiveEstimate, Record, Scan
from logger.device.status import CellStatus, SuspicionStatus

MOST_CELLS = 64
MOST_SHOWN = 24
"""Cells in `status.json`; more do not fit on a phone."""
AVERAGE_NS = 2 * 10**9
WARMER_NS = 4 * 10**9
"""The newest levels for `trend_db`: a walker takes five steps in this time."""
TREND_NS = 12 * 10**9
"""The levels before, back to this age, are what they are compared with."""
TA_STEP_M = 553.5
"""Half of what light travels in a bit of GSM (3GPP TS 45.010, 5.2)."""
_MOST_LEVELS = 256


class CellTable:
    """Fed with every record; `rows` are the cells, the serving one first, then by level."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._cells: Latest[_Cell] = Latest(MOST_CELLS)
        self._serving: dict[str, str] = {}

    def feed(self, record: Record) -> None:
        """Take a record; scans and live estimates count."""
        match record.value:
            case Scan() as scan:
                with self._lock:
                    self._take(record.t_ns, scan, record.source)
            case LiveEstimate() as estimate if estimate.stage != REFERENCE:
                with self._lock:
                    if cell := self._cells.get(estimate.cell):
                        cell.estimate = estimate

    def rows(self, suspicions: Iterable[SuspicionStatus] = ()) -> tuple[CellStatus, ...]:
        """Cells by importance, with their words of suspicion."""
        words = {one.cell: one for one in suspicions}
        with self._lock:
            serving = set(self._serving.values())
            rows = [
                cell.row(name, words.get(name), is_serving=name in serving)
                for name, cell in self._cells.items()
            ]
        rows.sort(key=_importance)
        return tuple(rows[:MOST_SHOWN])

    def _take(self, t_ns: int, scan: Scan, modem: str) -> None:
        for reading in scan.readings:
            name = reading.cell
            if name is None or reading.identity_unsure or reading.level_dbm is None:
                continue
            if reading.role == "serving":
                self._serving[modem] = name
            cell = self._cells.get(name) or _Cell(reading)
            cell.take(t_ns, reading, reading.level_dbm, modem)
            self._cells.put(name, cell)


class _Cell:
    """What was heard of a cell.

    `levels` are those of late of each modem. The first is shown, until it hears the cell no more:
    another one reads higher or lower.
    """

    def __init__(self, reading: CellReading) -> None:
        self.reading = reading
        self.estimate: LiveEstimate | None = None
        self.n = 0
        self.ta: int | None = None
        self.peaks_dbm: dict[str, float] = {}
        self.levels: dict[str, deque[tuple[int, float]]] = {}

    def take(self, t_ns: int, reading: CellReading, level_dbm: float, modem: str) -> None:
        self.reading = reading
        self.n += 1
        self.ta = self.ta if reading.ta is None else reading.ta
        self.peaks_dbm[modem] = max(self.peaks_dbm.get(modem, level_dbm), level_dbm)
        self.levels.setdefault(modem, deque(maxlen=_MOST_LEVELS)).append((t_ns, level_dbm))
        for name, levels in tuple(self.levels.items()):
            while levels and levels[0][0] < t_ns - TREND_NS:
                levels.popleft()
            if not levels:
                del self.levels[name]

    def row(self, name: str, word: SuspicionStatus | None, *, is_serving: bool) -> CellStatus:
        modem, levels = next(iter(self.levels.items()))
        heard_ns, level_dbm = levels[-1]
        channel = self.reading.arfcn  # with its digits where a driver reads it (NumberText)
        return CellStatus(
            cell=name,
            rat=self.reading.rat,
            channel=None if channel is None else int(channel),
            is_serving=is_serving,
            level_dbm=level_dbm,
            average_dbm=_mean(levels, heard_ns - AVERAGE_NS, heard_ns),
            peak_dbm=self.peaks_dbm[modem],
            trend_db=_trend(levels, heard_ns),
            heard_ns=heard_ns,
            n=self.n,
            ta_m=None if self.ta is None else self.ta * TA_STEP_M,
            word=None if word is None else word.word,
            reasons=() if word is None else word.reasons,
            verdict=None if self.estimate is None else _verdict(self.estimate),
            modem=modem,
        )


def _trend(levels: Iterable[tuple[int, float]], now_ns: int) -> float | None:
    late = _mean(levels, now_ns - WARMER_NS, now_ns)
    early = _mean(levels, now_ns - TREND_NS, now_ns - WARMER_NS)
    return None if late is None or early is None else round(late - early, 1)


def _mean(levels: Iterable[tuple[int, float]], after_ns: int, until_ns: int) -> float | None:
    some = [level_dbm for t_ns, level_dbm in levels if after_ns < t_ns <= until_ns]
    return round(sum(some) / len(some), 1) if some else None


def _verdict(estimate: LiveEstimate) -> str:
    # an estimate has been made, so numpy is there
    from logger.device.target import estimate_verdict  # noqa: PLC0415

    return estimate_verdict(estimate)


def _importance(row: CellStatus) -> tuple[bool, float]:
    return not row.is_serving, -(row.level_dbm or 0.0)
