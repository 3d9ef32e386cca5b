"""The reference filter on the device: the specification's EKF on the strongest (or the configured)
cell.

It starts at the receiver, and again, with a note, when the target changes. It is recorded as the
reference it is.
"""

from logger.core import ekf
from logger.core.live_settings import STRONGEST, LiveSettings
from logger.core.types import CellReading, Scan


class LiveReference:
    """The target, and its filter."""

    def __init__(self, settings: LiveSettings) -> None:
        self._settings = settings
        self.target: str | None = None
        self.n = 0
        self._heard_ns = 0
        self._state: ekf.EkfState | None = None

    def choose(self, t_ns: int, scan: Scan, x_m: float, y_m: float) -> tuple[str, str] | None:
        """Lock on a target, or change it; the filter of a new target starts at the receiver.

        Returns code and text.
        """
        best = self._candidate(scan)
        held = level_of(scan, self.target)
        if held is not None:
            self._heard_ns = t_ns
        if best is None or best.cell == self.target or best.level_dbm is None:
            return None
        if self.target is not None and not self._beats(best.level_dbm, held, t_ns):
            return None
        before, self.target = self.target, best.cell
        self._heard_ns = t_ns
        self._state, self.n = ekf.start(x_m, y_m), 0
        was = (
            ""
            if before is None
            else f", was {before}; the reference filter starts again at the receiver"
        )
        code = "target-locked" if before is None else "target-changed"
        return code, f"target is {best.cell} at {best.level_dbm:.0f} dBm{was}"

    def step(self, scan: Scan, x_m: float, y_m: float) -> ekf.EkfStep | None:
        """Correct with the target's level in a scan; None where it has none."""
        level_dbm = level_of(scan, self.target)
        if level_dbm is None or self._state is None:
            return None
        correct = ekf.joseph_step if self._settings.joseph else ekf.step
        step = correct(self._state, x_m, y_m, level_dbm)
        self._state = step.state
        self.n += 1
        return step

    def _candidate(self, scan: Scan) -> CellReading | None:
        wanted = self._settings.target
        heard = [r for r in scan.readings if r.level_dbm is not None and not r.identity_unsure]
        if wanted == STRONGEST:
            heard = [r for r in heard if r.rat == "GSM" and r.cell is not None]
        else:
            heard = [r for r in heard if r.cell == wanted]
        return max(heard, key=lambda r: r.level_dbm or 0.0, default=None)

    def _beats(self, level_dbm: float, held_dbm: float | None, t_ns: int) -> bool:
        if held_dbm is None:
            return t_ns - self._heard_ns > self._settings.lost_s * 1e9
        return level_dbm > held_dbm + self._settings.hysteresis_db


def level_of(scan: Scan, cell: str | None) -> float | None:
    """Level of a cell in a scan, None where it was not heard or had none."""
    if cell is None:
        return None
    return next(
        (r.level_dbm for r in scan.readings if r.cell == cell and r.level_dbm is not None), None
    )
