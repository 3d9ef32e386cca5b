"""The reference filter on the device: the specification's EKF on the target.

The filter starts at the receiver, and again when the target changes. Its estimates are recorded
with the stage `REFERENCE`.
"""

from collections.abc import Collection, Iterable
from dataclasses import replace

from logger.core import ekf
from logger.core.guidance.pursuit import Pursuit
from logger.core.live_settings import REFERENCE, STRONGEST, SUSPICIOUS, LiveSettings
from logger.core.places import Places
from logger.core.types import CellReading, LiveEstimate, Note, Record, Scan


class LiveReference:
    """The target, its filter, and the number `n` of its readings so far.

    `pursuit` is how the search for it goes, None before the first target.
    """

    def __init__(self, settings: LiveSettings) -> None:
        self._settings = settings
        self._wanted = settings.target
        self._is_free = self._for_word = False
        self._finished: set[str] = set()
        self._latest = Scan(0, ())
        self.pursuit: Pursuit | None = None
        self.n = 0
        self._received_ns = 0
        self._modem = ""
        self._state: ekf.EkfState | None = None

    @property
    def target(self) -> str | None:
        """The cell that was chosen last."""
        return None if self.pursuit is None else self.pursuit.cell

    def choose(
        self, record: Record, scan: Scan, place: Places, suspects: Collection[str] = ()
    ) -> Note | None:
        """Choose a target, or another one, from the known cells of a recorded scan.

        Its filter starts at the receiver and takes the levels of this modem only. `suspects` may be
        chosen for their word, the worst first.
        """
        t_ns, before = record.t_ns, self.pursuit
        self._latest = scan
        wanted = self._only_choice(suspects)
        best, level_dbm = _strongest(scan, wanted), level_of(scan, self.target)
        if before is not None and level_dbm is not None:
            self._received_ns = t_ns
            before.hear(t_ns)
        if best is None or best.cell is None or best.level_dbm is None:
            return None
        if before is not None and not self._is_free:
            is_held = wanted is None and not self._beats(best.level_dbm, level_dbm, t_ns)
            if is_held or best.cell == before.cell:
                return None
        self._is_free = False
        is_asked = self._wanted != SUSPICIOUS and not self._for_word
        self.pursuit = Pursuit(best.cell, t_ns, self._settings.give_up_s, is_asked=is_asked)
        if before is not None and before.cell == best.cell:
            return None
        if before is not None and before.over:
            self._finished.add(before.cell)
        self._received_ns, self._modem = t_ns, record.source
        self._state, self.n = ekf.start(place), 0
        text = f"target is {best.cell} at {best.level_dbm:.0f} dBm"
        if before is None:
            return Note("info", "target-locked", text)
        restart = "the reference filter starts again at the receiver"
        return Note("info", "target-changed", f"{text}, was {before.cell}; {restart}")

    def follow(self, wanted: str, *, for_word: bool) -> None:
        """Choose from now on as the setting `target` with this value would.

        A cell chosen `for_word` is searched for no longer than one that nobody chose.
        """
        self._wanted, self._for_word = wanted, for_word
        self._is_free = wanted != STRONGEST and self._settings.give_up_s > 0.0
        self._finished.discard(wanted)

    def offer(self, conspicuous: Iterable[str]) -> str | None:
        """The cell to search for next: the worst of these; else the strongest.

        An ordinary one is offered only where the search for the target is over.
        """
        done = {*self._finished, self.target}
        worst = next((cell for cell in conspicuous if cell not in done), None)
        if worst is not None or self.pursuit is None or not self.pursuit.over:
            return worst
        others = tuple(one for one in self._latest.readings if one.cell not in done)
        strongest = _strongest(replace(self._latest, readings=others), None)
        return None if strongest is None else strongest.cell

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

    def _only_choice(self, suspects: Collection[str]) -> str | None:
        if self._wanted != SUSPICIOUS:
            return None if self._wanted == STRONGEST else self._wanted
        if not self._settings.give_up_s:
            return next(iter(suspects), None)
        now = None if self._is_free else self.pursuit
        if now is not None and now.cell in suspects and not now.given_up:
            return now.cell
        heard = {reading.cell for reading in self._latest.readings} - self._finished
        fresh = (cell for cell in suspects if cell in heard and (not now or cell != now.cell))
        return next(fresh, None if now is None else now.cell)

    def _beats(self, level_dbm: float, target_dbm: float | None, t_ns: int) -> bool:
        if target_dbm is None:
            return t_ns - self._received_ns > self._settings.lost_s * 1e9
        return level_dbm > target_dbm + self._settings.hysteresis_db


def _strongest(scan: Scan, wanted: str | None) -> CellReading | None:
    """The strongest 2G cell, or the reading of the wanted cell."""
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
