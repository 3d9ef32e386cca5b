"""The on-device estimate as a function of the records in their order, so that the desk can repeat it to the bit.

The reference filter locks on the strongest GSM cell (or the configured one), is corrected by each of its levels at the
walker's current fix, and starts again at the receiver, with a Note, when the target changes.
"""

import msgspec

from logger.core import ekf
from logger.core.errors import GeoError
from logger.core.geo import Utm
from logger.core.types import CellReading, Fix, LiveEstimate, Note, Record, Scan

STRONGEST = "strongest"
STAGE = "reference-ekf"


class LiveSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the live estimate chooses its target and its fix.

    `target` is "strongest" or the name of a cell. The target changes when another cell is `hysteresis_db` stronger in
    the same scan, or strongest after the target was not heard for `lost_s`. A fix older than `max_fix_age_s` is none.
    `joseph` chooses the form of the covariance update.
    """

    target: str = STRONGEST
    hysteresis_db: float = 6.0
    lost_s: float = 30.0
    max_fix_age_s: float = 3.0
    joseph: bool = False


class LiveTracker:
    """Follows the records of one run; `feed` them in recorded order."""

    def __init__(self, settings: LiveSettings) -> None:
        self._settings = settings
        self._utm: Utm | None = None
        self._fix: tuple[int, int, float, float] | None = None
        self._unmapped = False
        self._target: str | None = None
        self._heard_ns = 0
        self._state: ekf.EkfState | None = None
        self._n = 0

    def current_fix(self, t_ns: int) -> tuple[int, float, float] | None:
        """Record number and UTM position of the fix that holds at a time, None without a fresh one."""
        if self._fix is None:
            return None
        seq, fix_ns, x_m, y_m = self._fix
        if t_ns - fix_ns > self._settings.max_fix_age_s * 1e9:
            return None
        return seq, x_m, y_m

    def feed(self, seq: int, record: Record) -> list[Note | LiveEstimate]:
        """Take the next record; returns what is to be recorded because of it."""
        match record.value:
            case Fix() as fix:
                return self._take_fix(seq, record.t_ns, fix)
            case Scan() as scan:
                return self._take_scan(seq, record.t_ns, scan)
        return []

    def _take_fix(self, seq: int, t_ns: int, fix: Fix) -> list[Note | LiveEstimate]:
        if not fix.valid or fix.lat_deg is None or fix.lon_deg is None:
            self._fix = None
            return []
        try:
            self._utm = self._utm or Utm.at(fix.lat_deg, fix.lon_deg)
            self._fix = (seq, t_ns, *self._utm.to_xy(fix.lat_deg, fix.lon_deg))
        except GeoError as error:
            self._fix = None
            if not self._unmapped:
                self._unmapped = True
                return [Note("warning", "unmapped", f"no live estimate: {error}")]
        return []

    def _take_scan(self, seq: int, t_ns: int, scan: Scan) -> list[Note | LiveEstimate]:
        place = self.current_fix(t_ns)
        if place is None or self._utm is None:
            return []
        _, x_m, y_m = place
        notes = self._choose(t_ns, scan, x_m, y_m)
        level_dbm = _level_of(scan, self._target)
        if level_dbm is None or self._state is None or self._target is None:
            return notes
        step = ekf.step(self._state, x_m, y_m, level_dbm, joseph=self._settings.joseph)
        self._state = step.state
        self._n += 1
        return [*notes, self._estimate(seq, self._target, self._utm, step)]

    def _choose(self, t_ns: int, scan: Scan, x_m: float, y_m: float) -> list[Note | LiveEstimate]:
        """Lock on a target, or change it; the filter of a new target starts at the receiver."""
        best = self._candidate(scan)
        held = _level_of(scan, self._target)
        if held is not None:
            self._heard_ns = t_ns
        if best is None or best.cell == self._target or best.level_dbm is None:
            return []
        if self._target is not None and not self._beats(best.level_dbm, held, t_ns):
            return []
        before, self._target = self._target, best.cell
        self._heard_ns = t_ns
        self._state, self._n = ekf.start(x_m, y_m), 0
        was = "" if before is None else f", was {before}; the filter starts again at the receiver"
        code = "target-locked" if before is None else "target-changed"
        return [Note("info", code, f"target is {best.cell} at {best.level_dbm:.0f} dBm{was}")]

    def _candidate(self, scan: Scan) -> CellReading | None:
        wanted = self._settings.target
        if wanted == STRONGEST:
            heard = [r for r in scan.readings if r.rat == "GSM" and r.cell is not None and r.level_dbm is not None]
        else:
            heard = [r for r in scan.readings if r.cell == wanted and r.level_dbm is not None]
        return max(heard, key=lambda r: r.level_dbm or 0.0, default=None)

    def _beats(self, level_dbm: float, held_dbm: float | None, t_ns: int) -> bool:
        if held_dbm is None:
            return t_ns - self._heard_ns > self._settings.lost_s * 1e9
        return level_dbm > held_dbm + self._settings.hysteresis_db

    def _estimate(self, seq: int, cell: str, utm: Utm, step: ekf.EkfStep) -> LiveEstimate:
        x_m, y_m, p0_dbm, eta, p = step.state
        return LiveEstimate(
            seq, STAGE, cell, self._n, utm.zone, x_m, y_m, p0_dbm, eta, *p, step.innovation_db, step.innovation_var_db2
        )


def _level_of(scan: Scan, cell: str | None) -> float | None:
    if cell is None:
        return None
    return next((r.level_dbm for r in scan.readings if r.cell == cell and r.level_dbm is not None), None)
