"""What all outputs show of the walk, as one value, made of the tracker and of the latest scans.

`LiveView` is part of `status.json`, which the page sends to the phones; the light, the feed and
`fieldlogger status` use it too. A new item on the phone is a field of `LiveView` with its value in
`live_view` (what the tracker knows) or `CellTable.fill` (what the modem hears), and a line in
`logger/page/assets`.
"""

import threading
from collections import deque
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta, Struct
from msgspec.structs import asdict, replace

from logger.core.answer import Answer, MultiPolygon, NextWay, Place
from logger.core.cell_names import channel_name
from logger.core.certainty import DEGREE_DECIMALS, Ellipse, OnMap, ellipse95, radii_text, radius_m
from logger.core.latest import Latest
from logger.core.live_settings import EKF, ONE_MODE, REFERENCE
from logger.core.types import CellReading, LiveEstimate, Record, Scan, Verdict

if TYPE_CHECKING:  # the status is written before numpy is imported
    from logger.core.live import LiveTracker

MOST_CELLS = 64
MOST_SHOWN = 24
"""Cells in `status.json`; more do not fit on a phone."""
PASSED_NS = 180 * 10**9  # a scan of all networks takes up to 3 min
AVERAGE_NS = 2 * 10**9
WARMER_NS = 4 * 10**9
"""The newest levels for `trend_db`: a walker takes five steps in this time."""
TREND_NS = 12 * 10**9
"""The levels before, back to this age, are what they are compared with."""
TA_STEP_M = 553.5
"""Half of what light travels in a bit of GSM (3GPP TS 45.010, 5.2)."""
_MOST_LEVELS = 256
_MOST_SUSPICIONS = 10
"""More is a list that nobody reads on a walk."""

Whole = Annotated[int, Meta(ge=-(1 << 63), le=(1 << 63) - 1)]
"""JSON has integers that no float and no column holds."""


class TargetStatus(Struct, frozen=True):
    """The target and its best position so far, with the 95 % ellipse and its azimuth.

    `r50_m` and `r95_m` are the radii that hold half and 95 % of all probability under the
    `supposition`; null where the position has less. `verdict` is that of the answer where there is
    one, else "one close place", "several places" or "cannot tell". `over` is why nothing leads to
    it any more: "located", or why it was given up; empty during the search.
    """

    cell: str
    verdict: str
    n: Whole = 0
    probability: float | None = None
    lat_deg: float | None = None
    lon_deg: float | None = None
    semi_major_m: float | None = None
    semi_minor_m: float | None = None
    azimuth_deg: float | None = None
    r50_m: float | None = None
    r95_m: float | None = None
    over: str = ""
    supposition: str = ""

    def __str__(self) -> str:
        if self.lat_deg is None:
            return f"target {self.cell}: {self.verdict}"
        position = f"{self.lat_deg:.5f} {self.lon_deg:.5f}"
        radii = radii_text(self.r50_m, self.r95_m)
        parts = [f"target {self.cell}: {self.verdict}", position, radii, self.supposition]
        return ", ".join(filter(None, parts))


class SuspicionStatus(Struct, frozen=True):
    """A cell that is unusual or suspicious, with the reasons as sentences."""

    cell: str
    word: str
    score_nats: float
    reasons: tuple[str, ...]


class CellStatus(Struct, frozen=True):
    """What was last heard of a cell.

    `average_dbm` is over the last 2 s before its latest reading, `trend_db` the change of the level
    in a few seconds: positive is "warmer". `heard_ns` is the time of the latest of `n` readings,
    `ta_m` its timing advance as a distance. `word` and `reasons` are its suspicion, `verdict` that
    of its live estimate. Levels are those of one `modem`.
    """

    cell: str = ""
    rat: str | None = None
    channel: Whole | None = None
    is_serving: bool = False
    level_dbm: float | None = None
    average_dbm: float | None = None
    peak_dbm: float | None = None
    trend_db: float | None = None
    heard_ns: Whole = 0
    n: Whole = 0
    ta_m: float | None = None
    word: str | None = None
    reasons: tuple[str, ...] = ()
    verdict: str | None = None
    modem: str = ""


class PositionStatus(Place, frozen=True, kw_only=True, omit_defaults=False):
    """The answer about the cell that is followed: its place, 95 % region in squares, and word.

    `text` is the answer in a sentence.
    """

    cell: str
    verdict: Verdict
    region: MultiPolygon
    word: str = ""
    text: str = ""


class LiveView(Struct, frozen=True, kw_only=True):
    """What is known while walking.

    `target` is the cell that is searched for, `offer` the one that a person may choose next.
    `suspicions` has the most suspicious cell first. `next`, None once the search is over, and
    `position` are of the target; `cells` has the serving cell first, then others by level, passed
    ones last. `no_estimate` is why there is no live estimate now, empty while it is made.
    `left_out` says which files it does not use, and why, `unnoticed` what the rules of suspicion
    cannot see. Cells are looked for `within_walk_m` of the walk, None: anywhere.
    """

    target: TargetStatus | None = None
    suspicions: tuple[SuspicionStatus, ...] = ()
    next: NextWay | None = None
    position: PositionStatus | None = None
    cells: tuple[CellStatus, ...] = ()
    no_estimate: str = ""
    left_out: tuple[str, ...] = ()
    offer: str | None = None
    within_walk_m: float | None = None
    unnoticed: str = ""

    @property
    def goal(self) -> OnMap | None:
        """What the arrow points at: the place found, else the end of the next way."""
        if self.position is not None and self.position.verdict == "located":
            return self.position
        return None if self.next is None else OnMap(lat=self.next.lat, lon=self.next.lon)


def live_view(tracker: "LiveTracker") -> LiveView:
    """What the tracker knows after its latest record."""
    followed, pursuit = tracker.followed, tracker.pursuit
    if followed is not None and followed.cell != tracker.target:
        followed = None  # it was until this scan
    position = None if followed is None else _position(tracker.answer, followed.region)
    over = "" if pursuit is None else pursuit.over
    return LiveView(
        target=target_status(tracker.target, tracker.latest, position, over),
        suspicions=tuple(
            SuspicionStatus(
                one.cell,
                one.word,
                round(one.score_nats, 2),
                tuple(finding.text for finding in one.findings),
            )
            for one in tracker.suspicion.conspicuous()[:_MOST_SUSPICIONS]
        ),
        next=None if followed is None or over else followed.way,
        position=position,
        offer=tracker.offer,
        within_walk_m=tracker.walk_area.within_m,
        unnoticed=tracker.suspicion.unnoticed_text,
    )


def target_status(
    cell: str | None,
    latest: LiveEstimate | None,
    position: PositionStatus | None = None,
    over: str = "",
) -> TargetStatus | None:
    """The target with its latest estimate, as sure of its place as the answer."""
    status = _of_estimate(cell, latest)
    if status is None or position is None:
        return status
    return replace(
        status,
        verdict=position.verdict,
        lat_deg=position.lat,
        lon_deg=position.lon,
        r50_m=position.r50_m,
        r95_m=position.r95_m,
        over=over,
        supposition=position.supposition,
    )


@lru_cache(maxsize=1)  # fixes come ten times a second, estimates once
def _of_estimate(cell: str | None, latest: LiveEstimate | None) -> TargetStatus | None:
    if cell is None:
        return None
    if latest is None:
        return TargetStatus(cell, "cannot tell")
    # an estimate has been made, so the map is there
    from logger.core.places import Utm  # noqa: PLC0415

    lat_deg, lon_deg = Utm(latest.utm_zone).to_latlon(latest.x_m, latest.y_m)
    ellipse = ellipse95(latest.p_xx, latest.p_xy, latest.p_yy)
    r50_m, r95_m = (_radius_m(ellipse, level, latest.probability) for level in (0.5, 0.95))
    return TargetStatus(
        cell,
        _certainty(latest),
        latest.n,
        round(latest.probability, 3),
        round(lat_deg, DEGREE_DECIMALS),
        round(lon_deg, DEGREE_DECIMALS),
        round(ellipse.semi_major_m, 1),
        round(ellipse.semi_minor_m, 1),
        round(ellipse.azimuth_deg, 1),
        r50_m,
        r95_m,
    )


def _radius_m(ellipse: Ellipse, level: float, probability: float) -> float | None:
    within_m = radius_m(ellipse, level / probability) if probability > level else None
    return None if within_m is None else round(within_m, 1)


def _certainty(latest: LiveEstimate) -> str:
    """Certainty of the mode alone, not of the whole region."""
    if latest.stage == EKF:
        return "one close place"
    return "cannot tell" if latest.probability >= ONE_MODE else "several places"


def _position(answer: Answer | None, region: MultiPolygon | None) -> PositionStatus | None:
    if answer is None or answer.place is None or region is None:
        return None
    return PositionStatus(
        cell=answer.cell,
        verdict=answer.verdict,
        region=region,
        word="" if answer.word is None else answer.word.word,
        text=answer.sentence,
        **asdict(answer.place.in_short()),
    )


class CellTable:
    """What the modem hears; fed with every record."""

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

    def fill(self, view: LiveView) -> LiveView:
        """The view with the cells that the modem heard of late, and the words of the view."""
        words = {one.cell: one for one in view.suspicions}
        named = {*words, view.offer, view.target.cell if view.target else None}
        with self._lock:
            serving = set(self._serving.values())
            rows = [
                cell.row(name, words.get(name), is_serving=name in serving)
                for name, cell in self._cells.items()
            ]
        position = view.position
        if position is not None:  # of the walk so far, which says more than the latest estimate
            rows = [
                replace(row, verdict=position.verdict) if row.cell == position.cell else row
                for row in rows
            ]
        # of what the view speaks there is a row, however long ago it was heard
        rows.sort(key=lambda row: (row.is_serving or row.cell in named, row.heard_ns), reverse=True)
        passed_ns = max((row.heard_ns for row in rows), default=0) - PASSED_NS
        rows = rows[:MOST_SHOWN]
        rows.sort(key=lambda row: -(row.level_dbm or 0.0))
        rows.sort(key=lambda row: (not row.is_serving, row.heard_ns < passed_ns))
        return replace(view, cells=tuple(rows))

    def _take(self, t_ns: int, scan: Scan, modem: str) -> None:
        for reading in scan.readings:
            name = reading.cell or channel_name(reading)
            if name is None or reading.identity_unsure or reading.level_dbm is None:
                continue
            if reading.role == "serving":
                self._serving[modem] = name
            cell = self._cells.get(name) or _Cell(reading)
            cell.take(t_ns, reading, reading.level_dbm, modem)
            self._cells.put(name, cell)


class _Cell:
    """`levels` are those of late of each modem.

    The first modem is shown until it hears the cell no more: another one reads higher or lower.
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
            verdict=None if self.estimate is None else _certainty(self.estimate),
            modem=modem,
        )


def _trend(levels: Iterable[tuple[int, float]], now_ns: int) -> float | None:
    late = _mean(levels, now_ns - WARMER_NS, now_ns)
    early = _mean(levels, now_ns - TREND_NS, now_ns - WARMER_NS)
    return None if late is None or early is None else round(late - early, 1)


def _mean(levels: Iterable[tuple[int, float]], after_ns: int, until_ns: int) -> float | None:
    some = [level_dbm for t_ns, level_dbm in levels if after_ns < t_ns <= until_ns]
    return round(sum(some) / len(some), 1) if some else None
