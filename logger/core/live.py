"""The on-device estimate as a function of the records in their order, so that the desk can repeat
it to the bit.

Every cell that two scans have named has a locator and, once its place is close, an EKF
(`live_cell`); the target has the reference filter beside them (`live_reference`). After each scan
the one cell that needs it most has its places searched anew: a bounded amount of work, however many
cells are heard.
"""

from dataclasses import replace
from math import hypot
from typing import NamedTuple

from logger.core.censoring import limit_of
from logger.core.errors import GeoError
from logger.core.geo import Utm
from logger.core.identities import Identities
from logger.core.live_cell import CellEstimate, LiveCell
from logger.core.live_reference import LiveReference
from logger.core.live_settings import REFERENCE, LiveSettings
from logger.core.locator.online import Heard
from logger.core.model.prior import Prior, prior_for
from logger.core.observations import TIMING_S, fix_sigma_m, smeared_sigma_m
from logger.core.sample_hold import SampleHold
from logger.core.types import CellReading, Fix, LiveEstimate, Note, Record, Scan

LIVE_DECORRELATION_M = (12.0, 40.0, 200.0)
LIVE_WHITE_SHARES = (0.05, 0.4)


_MOST_FIRSTS = 100
"""A cell that is there is heard again soon."""


class Receiver(NamedTuple):
    """Where the walker is: record number and time of the fix, UTM place, standard deviation per
    axis, speed.
    """

    seq: int
    t_ns: int
    x_m: float
    y_m: float
    sigma_m: float
    speed_mps: float


class LiveTracker:
    """Follows the records of one run; `feed` them in recorded order."""

    def __init__(self, settings: LiveSettings) -> None:
        self.settings = settings
        self._prior = live_prior(settings)
        self._utm: Utm | None = None
        self._fixes = SampleHold[Receiver](settings.max_fix_age_s)
        self._unmapped = False
        self._reference = LiveReference(settings)
        self._identities = Identities()
        self._firsts: dict[str, Heard] = {}  # of cells heard once, the one heard longest ago first
        self._cells: dict[str, LiveCell] = {}  # the one not heard for longest first

    @property
    def target(self) -> str | None:
        """The cell of the default view: the strongest, or the configured one."""
        return self._reference.target

    def feed(self, seq: int, record: Record) -> list[Note | LiveEstimate]:
        """Take the next record; returns what is to be recorded because of it."""
        match record.value:
            case Fix() as fix:
                return self._take_fix(seq, record.t_ns, fix)
            case Scan() as scan:
                return self._take_scan(seq, record.t_ns, scan)
        return []

    def _take_fix(self, seq: int, t_ns: int, fix: Fix) -> list[Note | LiveEstimate]:
        before = self._fixes.last
        if not fix.valid or fix.lat_deg is None or fix.lon_deg is None:
            self._fixes.add(t_ns, None)
            return []
        try:
            self._utm = self._utm or Utm.at(fix.lat_deg, fix.lon_deg)
            x_m, y_m = self._utm.to_xy(fix.lat_deg, fix.lon_deg)
        except GeoError as error:
            self._fixes.add(t_ns, None)
            if not self._unmapped:
                self._unmapped = True
                return [Note("warning", "unmapped", f"no live estimate: {error}")]
            return []
        sigma_m = fix_sigma_m(fix.acc_m, fix.hdop, fix.quality)
        speed_mps = _speed_mps(fix, before, t_ns, x_m, y_m)
        self._fixes.add(t_ns, Receiver(seq, t_ns, x_m, y_m, sigma_m, speed_mps))
        return []

    def _heard_from(self, scan: Scan, t_ns: int) -> Receiver | None:
        """Where a scan was heard: at its middle, smeared over the way walked meanwhile."""
        held = self._fixes.at(t_ns)
        if held is None or t_ns - scan.t_start_ns <= TIMING_S * 1e9:
            return held
        begun, middle = (
            self._fixes.at(scan.t_start_ns),
            self._fixes.at((scan.t_start_ns + t_ns) // 2),
        )
        if begun is None or middle is None:
            return None
        smear_m = smeared_sigma_m(hypot(held.x_m - begun.x_m, held.y_m - begun.y_m))
        return middle._replace(sigma_m=hypot(middle.sigma_m, smear_m))

    def _take_scan(self, seq: int, t_ns: int, scan: Scan) -> list[Note | LiveEstimate]:
        self._identities.hear(scan)
        at = self._heard_from(scan, t_ns)
        if at is None or self._utm is None:
            return []
        found: list[Note | LiveEstimate] = []
        known = replace(
            scan, readings=tuple(r for r in scan.readings if r.cell in self._identities)
        )
        chosen = self._reference.choose(t_ns, known, at.x_m, at.y_m)
        if chosen is not None:
            found.append(Note("info", *chosen))
        step = self._reference.step(known, at.x_m, at.y_m)
        if step is not None and self._reference.target is not None:
            x_m, y_m, p0_dbm, eta, p = step.state
            estimate = CellEstimate(
                REFERENCE,
                1.0,
                (x_m, y_m, p0_dbm, eta),
                p,
                step.innovation_db,
                step.innovation_var_db2,
            )
            found.append(
                _recorded(seq, self._reference.target, self._reference.n, self._utm, estimate)
            )
        for name, reading in _first_of_each(scan).items():
            found += self._take_reading(seq, name, reading, at, self._utm)
        self._search()
        return found

    def _take_reading(
        self, seq: int, name: str, reading: CellReading, at: Receiver, utm: Utm
    ) -> list[Note | LiveEstimate]:
        level_dbm = reading.level_dbm
        if level_dbm is None:
            return []
        sigma_m = hypot(at.sigma_m, TIMING_S * at.speed_mps)
        heard = Heard(at.x_m, at.y_m, sigma_m, level_dbm, limit_of(level_dbm, reading.rat))
        if name not in self._identities:
            self._wait(name, reading, heard)
            return []
        first = self._firsts.pop(name, None)
        cell = self._cells.pop(name, None) or LiveCell(self._prior)
        self._cells[name] = cell
        if len(self._cells) > self.settings.most_cells:
            del self._cells[next(iter(self._cells))]
        if first is not None:
            cell.take(first)
        estimate = cell.take(heard)
        news: list[Note | LiveEstimate] = [
            Note("info", code, f"{name}: {text}") for code, text in cell.news
        ]
        return news if estimate is None else [*news, _recorded(seq, name, cell.n, utm, estimate)]

    def _wait(self, name: str, reading: CellReading, heard: Heard) -> None:
        """Keep the reading of a cell heard once until a second scan names it."""
        if reading.identity_unsure:
            return
        self._firsts.pop(name, None)
        self._firsts[name] = heard
        if len(self._firsts) > _MOST_FIRSTS:
            del self._firsts[next(iter(self._firsts))]

    def _search(self) -> None:
        if self._cells:
            neediest = max(self._cells.values(), key=lambda cell: cell.stale)
            if neediest.stale > 1.0:
                neediest.search()


def live_prior(settings: LiveSettings) -> Prior:
    """The configured prior with fewer hypotheses of the noise than at the desk."""
    prior = prior_for(settings.environment, height_m=settings.height_m)
    return replace(prior, decorrelation_m=LIVE_DECORRELATION_M, white_shares=LIVE_WHITE_SHARES)


def _speed_mps(fix: Fix, before: Receiver | None, t_ns: int, x_m: float, y_m: float) -> float:
    """Speed as the receiver tells it, or from the fix before."""
    if fix.speed_mps is not None:
        return fix.speed_mps
    if before is None or t_ns <= before.t_ns:
        return 0.0
    return hypot(x_m - before.x_m, y_m - before.y_m) / max((t_ns - before.t_ns) / 1e9, 1.0)


def _first_of_each(scan: Scan) -> dict[str, CellReading]:
    """Readings of a scan by cell; of a cell that is listed twice the first of which the identity is
    sure.
    """
    found: dict[str, CellReading] = {}
    for reading in sorted(scan.readings, key=lambda reading: reading.identity_unsure):
        if reading.cell is not None and reading.level_dbm is not None:
            found.setdefault(reading.cell, reading)
    return found


def _recorded(seq: int, cell: str, n: int, utm: Utm, found: CellEstimate) -> LiveEstimate:
    return LiveEstimate(
        seq,
        found.stage,
        cell,
        n,
        utm.zone,
        *found.state,
        *found.p,
        found.innovation_db,
        found.innovation_var_db2,
        found.probability,
    )
