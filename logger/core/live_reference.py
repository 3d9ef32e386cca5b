"""The reference filter on the device: the specification's EKF on the target.

The target is the strongest cell, the most suspicious one, or the configured one. The filter starts
at the receiver, and again when the target changes. Its estimates are recorded with the stage
`REFERENCE`.
"""

from logger.core import ekf
from logger.core.live_settings import REFERENCE, STRONGEST, SUSPICIOUS, LiveSettings
from logger.core.places import Places
from logger.core.types import CellReading, LiveEstimate, Note, Record, Scan


class LiveReference:
    """The target, its filter, and the number `n` of its readings so far."""

    def __init__(self, settings: LiveSettings) -> None:
        self._settings = settings
        self._wanted = settings.target
        self.target: str | None = None
        self.n = 0
        self._received_ns = 0
        self._modem = ""
        self._state: ekf.EkfState | None = None

    def choose(
        self, record: Record, scan: Scan, place: Places, suspect: str | None = None
    ) -> Note | None:
        """Choose a target, or another one, from the known cells of a recorded scan.

        Its filter starts at the receiver, and takes the levels of this modem only.

        `suspect` is the most suspicious cell so far, None if no cell is unusual.
        """
        t_ns = record.t_ns
        wanted = self._only_choice(suspect)
        best, level_dbm = _strongest(scan, wanted), level_of(scan, self.target)
        if level_dbm is not None:
            self._received_ns = t_ns
        if best is None or best.cell == self.target or best.level_dbm is None:
            return None
        is_held = self.target is not None and wanted is None
        if is_held and not self._beats(best.level_dbm, level_dbm, t_ns):
            return None
        before, self.target = self.target, best.cell
        self._received_ns, self._modem = t_ns, record.source
        self._state, self.n = ekf.start(place), 0
        text = f"target is {best.cell} at {best.level_dbm:.0f} dBm"
        if before is None:
            return Note("info", "target-locked", text)
        restart = "the reference filter starts again at the receiver"
        return Note("info", "target-changed", f"{text}, was {before}; {restart}")

    def follow(self, wanted: str) -> None:
        """Choose from now on as the setting `target` with this value would."""
        self._wanted = wanted

    def step(self, seq: int, modem: str, scan: Scan, place: Places) -> LiveEstimate | None:
        """Correct with the target's level in scan `seq` of a modem; None if it has none."""
        level_dbm = level_of(scan, self.target)
        if self.target is None or self._state is None:
            return None
        if level_dbm is None or modem != self._modem:
            return None
        step = ekf.correct(self._state, place, level_dbm, joseph=self._settings.joseph)
        self._state = step.state
        self.n += 1
        x_m, y_m, p0_dbm, eta, p = step.state
        source = self.target, self.n, place.utm.zone
        innovation = step.innovation_db, step.innovation_var_db2
        return LiveEstimate(seq, REFERENCE, *source, x_m, y_m, p0_dbm, eta, *p, *innovation, 1.0)

    def _only_choice(self, suspect: str | None) -> str | None:
        """The only cell that may become the target; None for the strongest one."""
        wanted = self._wanted
        return suspect if wanted == SUSPICIOUS else None if wanted == STRONGEST else wanted

    def _beats(self, level_dbm: float, target_dbm: float | None, t_ns: int) -> bool:
        if target_dbm is None:
            return t_ns - self._received_ns > self._settings.lost_s * 1e9
        return level_dbm > target_dbm + self._settings.hysteresis_db


def _strongest(scan: Scan, wanted: str | None) -> CellReading | None:
    """The strongest 2G cell of a scan, or the reading of a wanted cell."""
    sure = [r for r in scan.readings if r.level_dbm is not None and not r.identity_unsure]
    if wanted is None:
        candidates = [r for r in sure if r.rat == "GSM" and r.cell is not None]
    else:
        candidates = [r for r in sure if r.cell == wanted]
    return max(candidates, key=lambda r: r.level_dbm or 0.0, default=None)


def level_of(scan: Scan, cell: str | None) -> float | None:
    """Level of a cell in a scan, None if the scan has none."""
    if cell is None:
        return None
    levels_dbm = (r.level_dbm for r in scan.readings if r.cell == cell)
    return next((level_dbm for level_dbm in levels_dbm if level_dbm is not None), None)
