"""One row of a walk in, one answer out: position, verdict and the way to walk next."""

from collections.abc import Iterable, Mapping
from math import isfinite, pi

import msgspec

from logger.core.answer import NextWay, Position
from logger.core.errors import GeoError
from logger.core.guidance.followed_cell import FollowedCell
from logger.core.guidance.street_atlas import FARTHEST_M, Line, StreetAtlas
from logger.core.guidance.street_map import StreetMap
from logger.core.locator.online import OnlineLocator
from logger.core.model.prior import Prior
from logger.core.places import TIMING_S, Places, place_of_fix
from logger.core.readings import Readings, limit_of
from logger.core.spikes import SpikeFilter
from logger.core.types import Fix, range_dbm
from logger.core.walker import LiveTrack
from postproc.interop.sighting import LEVEL_RANGE_DBM, RATS

COLUMNS = ("t_s", "lat", "lon", "rssi_dbm")
"""Columns that the header has to name; `cell`, `acc_m` and `rat` may follow."""
SURPLUS = ""  # what a row has after its last column

_FEWEST_LEVELS = 5
"""With as many levels there is a best position, however unsure; before there is no answer."""
_FASTEST_MPS = 40.0
"""Faster than this two rows belong to different walks, or a time is wrong."""
_LATEST_S = 9e9  # in nanoseconds a later time has no place in 64 bits
_FARTHEST_M = 100_000.0
"""Nobody walks so far, and a position that is less accurate is none."""
_NO_FIX_DEG = (0.0, 0.0)
"""What receivers print without a fix; it is in the Gulf of Guinea, where nobody walks."""
_RAT = "GSM"
"""Technology of rows that name none: its scale ends at -110 and -47 dBm."""


class GuideLine(msgspec.Struct, frozen=True, omit_defaults=False):
    """What is known after a row, as a line of JSON; `text` is a sentence.

    `error` says why the row was not used, and is left out where it was.
    """

    t_s: float | None
    verdict: str = "cannot tell"
    best: Position | None = None
    area_m2: float | None = None
    next: NextWay | None = None
    text: str = ""
    error: str | msgspec.UnsetType = msgspec.UNSET


class GuideFilter:
    """Answers the rows of one walk in their order.

    `cell` is followed, by default the first that a row names: rows of others are positions only.
    `lines` are the streets. `locator` has the posterior behind the answers, from `levels` rows;
    `is_off_map` says that the streets are those of another town.
    """

    def __init__(self, prior: Prior, cell: str | None = None, lines: Iterable[Line] = ()) -> None:
        self._prior, self._cell, self._atlas = prior, cell, StreetAtlas(lines)
        self.locator = OnlineLocator(prior)
        self._spikes = SpikeFilter[Readings]()
        self._start: Places | None = None
        self._walk = LiveTrack()
        self._followed: FollowedCell | None = None
        self._last: tuple[float, Places] | None = None  # time in seconds
        self._strongest: Readings | None = None
        self.levels = 0
        self.is_off_map = False

    def line(self, row: Mapping[str, str | None]) -> str:
        """The answer to a row as one line of JSON."""
        return msgspec.json.encode(self.answer(row)).decode()

    def answer(self, row: Mapping[str, str | None]) -> GuideLine:
        """Take a row by column names; an empty value is unknown."""
        t_s = None
        try:
            t_s = _number(row, "t_s")
            _check_columns(row)
            level_dbm = _level_dbm(row)
            place = self._place(row, t_s)
            if place is not None:
                self._take(t_s, place, level_dbm, row)
        except (ValueError, GeoError) as error:
            return msgspec.structs.replace(self._answer_after_fix(t_s), error=str(error))
        return self._answer_after_fix(t_s)

    def _take(
        self,
        t_s: float | None,
        place: Places,
        level_dbm: float | None,
        row: Mapping[str, str | None],
    ) -> None:
        self._start = self._start or place
        away_m = place.away_m(self._start)
        if away_m > _FARTHEST_M:
            raise ValueError(f"the position is {away_m / 1000.0:.0f} km from the first one")
        followed = self._followed
        if followed is None:
            streets = self._atlas.near(place)
            self.is_off_map = streets is not None and not _is_within(streets, place)
            followed = self._followed = FollowedCell(self._cell or "", streets, self._walk)
        self._walk.add(place)
        timed = place.less_sure(TIMING_S * self._speed_mps(t_s, place))
        if level_dbm is not None and self._is_followed(row):
            self.levels += 1
            rat = _text(row, "rat") or _RAT
            limit = limit_of(level_dbm, rat)
            reading = Readings.one(self._cell or "", rat, timed, level_dbm, limit)
            if self._strongest is None or _rank(reading) > _rank(self._strongest):
                self._strongest = reading
            for one, spike_db in self._spikes.take(reading, timed, level_dbm, limit):
                if not spike_db:
                    self.locator.take(one)
            if self.locator.stale > 1.0:
                self.locator.search()
        followed.update(place, self.locator)

    def _is_followed(self, row: Mapping[str, str | None]) -> bool:
        name = _text(row, "cell")
        self._cell = self._cell or name or None
        # in a column of names a row without one is of any cell
        return (name or row.get("cell")) == self._cell

    def _place(self, row: Mapping[str, str | None], t_s: float | None) -> Places | None:
        """In the zone of the first row; None without a position."""
        lat_deg, lon_deg, acc_m = _number(row, "lat"), _number(row, "lon"), _acc_m(row)
        if (lat_deg, lon_deg) == _NO_FIX_DEG:
            raise ValueError("lat 0, lon 0 is no position: the receiver has no fix")
        fix = Fix(True, lat_deg=lat_deg, lon_deg=lon_deg, acc_m=acc_m)
        t_ns = 0 if t_s is None or abs(t_s) > _LATEST_S else round(t_s * 1e9)
        return place_of_fix(t_ns, fix, None if self._start is None else self._start.utm)

    def _speed_mps(self, t_s: float | None, place: Places) -> float:
        if t_s is None:
            return 0.0
        before, self._last = self._last, (t_s, place)
        if before is None or t_s <= before[0]:
            return 0.0
        speed_mps = place.away_m(before[1]) / max(t_s - before[0], 1.0)
        return min(speed_mps, _FASTEST_MPS)

    def _answer_after_fix(self, t_s: float | None) -> GuideLine:
        followed = self._followed
        if self.levels < _FEWEST_LEVELS:
            counts = f"{self.levels} of at least {_FEWEST_LEVELS} levels with a position"
            return GuideLine(t_s, text=f"cannot tell: {counts}")
        answer = None if followed is None else followed.answer
        if followed is None or answer is None or answer.place is None:
            return self._before_position(t_s)
        return GuideLine(
            t_s=t_s,
            verdict=answer.verdict,
            best=answer.place.in_short().position,
            area_m2=round(answer.place.area_m2),
            next=followed.way,
            text=answer.sentence,
        )

    def _before_position(self, t_s: float | None) -> GuideLine:
        """Before the first search: the strongest level, within the reach of the prior."""
        why = "cannot tell: the walk is too short yet"
        if self._strongest is None:
            return GuideLine(t_s, text=why)
        radius_m = self._prior.radius_m(0.95)
        at = self._strongest.places.on_map
        best = Position(
            lat=at.lat, lon=at.lon, r95_m=radius_m, r50_m=self._prior.radius_m(0.5)
        ).in_short()
        return GuideLine(t_s, best=best, area_m2=round(pi * radius_m**2), text=why)


def _rank(reading: Readings) -> list[float]:
    """By the level; of equal ones the one farther east, then farther north."""
    return [reading.level_dbm.item(), *reading.places.xy_m[:, 0].tolist()]


def _is_within(streets: StreetMap, place: Places) -> bool:
    nearest = streets.nearest(place)
    return nearest is not None and nearest.away_m <= FARTHEST_M


def _check_columns(row: Mapping[str, str | None]) -> None:
    if _text(row, SURPLUS):
        raise ValueError("more values than columns; decimals are written with a point")


def _level_dbm(row: Mapping[str, str | None]) -> float | None:
    level_dbm = _number(row, "rssi_dbm")
    rat = RATS.get(_text(row, "rat").upper())
    low_dbm, high_dbm = LEVEL_RANGE_DBM if rat is None else range_dbm(rat)
    if level_dbm is not None and not low_dbm <= level_dbm <= high_dbm:
        raise ValueError(f"rssi_dbm {level_dbm:g} is not from {low_dbm:g} to {high_dbm:g} dBm")
    return level_dbm


def _acc_m(row: Mapping[str, str | None]) -> float | None:
    acc_m = _number(row, "acc_m")
    if acc_m is not None and not 0.0 <= acc_m <= _FARTHEST_M:
        raise ValueError(f"acc_m {acc_m:g} is not from 0 to {_FARTHEST_M:g} m")
    return acc_m


def _text(row: Mapping[str, str | None], name: str) -> str:
    return (row.get(name) or "").strip()


def _number(row: Mapping[str, str | None], name: str) -> float | None:
    """A number, None where the column is empty; raises ValueError with a reason."""
    text = _text(row, name)
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{name} {text[:40]!r} is not a number") from None
    if not isfinite(value) or "_" in text:  # Python reads 1_0 as 10
        raise ValueError(f"{name} {text[:40]!r} is not a number")
    return value
