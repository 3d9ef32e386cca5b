"""The on-device estimate as a function of the records in their order: replay repeats it exactly.

Every cell that two scans have named has a locator and, once its position is close, an EKF
(`live_cell`). The target has the reference filter beside them (`LiveReference`). After each scan
only the cell that needs it most is searched again, which bounds the work.
"""

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from logger.core import ekf
from logger.core.answer import Answer
from logger.core.baseline import NO_BASELINE, Baseline
from logger.core.cell_names import REUSED_M, Identities, is_by_channel
from logger.core.errors import GeoError
from logger.core.fix_gate import FixGate
from logger.core.guidance.followed_cell import FollowedCell
from logger.core.guidance.pursuit import Pursuit
from logger.core.guidance.street_atlas import StreetAtlas, Streets
from logger.core.joined_names import RecentNames
from logger.core.latest import Latest, SampleHold
from logger.core.live_cell import LiveCell
from logger.core.live_settings import (
    FOLLOW,
    REFERENCE,
    STRONGEST,
    SUSPICIOUS,
    WITHIN,
    LiveSettings,
    within_of,
)
from logger.core.model.area import WalkArea
from logger.core.model.prior import Prior, prior_for
from logger.core.places import TIMING_S, Places, Utm, place_of_fix, smeared_sigma_m
from logger.core.readings import Readings, limit_of
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.suspicion.words import error_notes, finding_notes
from logger.core.types import CellReading, Fix, LiveEstimate, Note, Record, Scan
from logger.core.walker import LiveTrack

# The filter starts at the receiver, and again when the target changes. Its estimates are recorded
# with the stage `REFERENCE`.


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


# --- all cells ---

_LEAST_S = 1.0
"""Shorter intervals between fixes give no speed: times of arrival vary by as much."""
_MOST_ONCE = 100
"""Most cells seen once whose reading is stored: a real cell soon comes again."""
ADVICE = "advice"
"""Code of the Note that says where to walk next."""


class Receiver(NamedTuple):
    """The walker at a fix: where and when, and the speed."""

    place: Places
    speed_mps: float

    def at(self, t_ns: int) -> "Receiver":
        """The same at another time."""
        return self._replace(place=replace(self.place, t_ns=np.array([t_ns])))


class ReceiverTrack:
    """Fixes in their recorded order; `utm` is the zone of the first position, None before.

    `walk` has them smoothed.
    """

    def __init__(self, max_fix_age_s: float) -> None:
        self.utm: Utm | None = None
        self._fixes = SampleHold[Receiver](max_fix_age_s)
        self.walk = LiveTrack()
        self._gate = FixGate()
        self._warned: set[str] = set()

    @property
    def latest(self) -> Receiver | None:
        """The receiver at the latest fix, None if that had no position."""
        return self._fixes.last

    def add(self, t_ns: int, fix: Fix) -> list[Note]:
        """Take a fix; the first that cannot be true, or cannot be mapped, gives a warning."""
        if not self._gate.passes(t_ns, fix):
            return self._warn_once(
                "position-leap", "a position that the receiver cannot have reached"
            )
        receiver, warnings = None, []
        try:
            receiver = self._receiver(t_ns, fix)
        except GeoError as error:
            warnings = self._warn_once("unmapped", f"no live estimate: {error}")
        self._fixes.add(t_ns, receiver)
        if receiver is not None:
            self.walk.add(receiver.place, fix)
        return warnings

    def at_scan(self, t_ns: int, scan: Scan) -> Receiver | None:
        """The receiver at the middle of a scan that ended at `t_ns`, None if unknown.

        The way walked during the scan adds to its sigma. Its time is that of the middle.
        """
        end, middle_ns = self._fixes.at(t_ns), (scan.t_start_ns + t_ns) // 2
        if end is None or t_ns - scan.t_start_ns <= TIMING_S * 1e9:
            return end and end.at(middle_ns)
        begin, middle = self._fixes.at(scan.t_start_ns), self._fixes.at(middle_ns)
        if begin is None or middle is None:
            return None
        self.walk.add_scan(scan.t_start_ns, t_ns)
        smear_m = smeared_sigma_m(end.place.away_m(begin.place))
        return middle._replace(place=middle.place.less_sure(float(smear_m))).at(middle_ns)

    def _receiver(self, t_ns: int, fix: Fix) -> Receiver | None:
        place = place_of_fix(t_ns, fix, self.utm)
        if place is None:
            return None
        self.utm = place.utm
        speed_mps = fix.speed_mps
        if speed_mps is None:
            speed_mps = _speed_mps(self._fixes.last, place)
        return Receiver(place, speed_mps)

    def _warn_once(self, code: str, text: str) -> list[Note]:
        if code in self._warned:
            return []
        self._warned.add(code)
        return [Note("warning", code, text)]


def _speed_mps(before: Receiver | None, place: Places) -> float:
    if before is None:
        return 0.0
    since_ns = place.t_ns.item() - before.place.t_ns.item()
    if since_ns <= 0:
        return 0.0
    return place.away_m(before.place) / max(since_ns / 1e9, _LEAST_S)


class LiveTracker:
    """Follows the records of one run; `feed` them in recorded order.

    `baseline` has what earlier walks heard, `streets` those that may be walked. Cells are looked
    for in `walk_area`.
    """

    def __init__(
        self,
        settings: LiveSettings,
        baseline: Baseline = NO_BASELINE,
        streets: Streets | None = None,
    ) -> None:
        self.baseline = baseline
        self._streets = streets or StreetAtlas(())
        self._prior = live_prior(settings)
        self._track = ReceiverTrack(settings.max_fix_age_s)
        self._reference = LiveReference(settings)
        self._gives_up = settings.give_up_s > 0.0
        self._identities = Identities()
        self._names = RecentNames() if settings.by_channel else None
        self.walk_area = WalkArea(settings.within_walk_m)
        self._once: Latest[tuple[str, Readings]] = Latest(_MOST_ONCE)
        self._cells: Latest[LiveCell] = Latest(settings.most_cells)
        self.suspicion = SuspicionTracker(settings.max_fix_age_s, baseline)
        self.followed: FollowedCell | None = None

    @property
    def target(self) -> str | None:
        """The cell of the default view: strongest, most suspicious or configured."""
        return self._reference.target

    @property
    def answer(self) -> Answer | None:
        """The answer about the followed cell, with its word so far."""
        answer = None if self.followed is None else self.followed.answer
        if answer is None:
            return None
        return replace(answer, word=self.suspicion.assessment(answer.cell))

    @property
    def pursuit(self) -> Pursuit | None:
        """How the search for the target goes."""
        return self._reference.pursuit

    @property
    def offer(self) -> str | None:
        """The cell that a person may choose next: suspicious, else unusual, else the strongest."""
        return self._reference.offer(one.cell for one in self.suspicion.conspicuous())

    @property
    def latest(self) -> LiveEstimate | None:
        """The newest estimate of the target, without the reference filter's."""
        cell = None if self.target is None else self._cells.get(self.target)
        return None if cell is None else cell.latest

    def feed(self, seq: int, record: Record) -> list[Note | LiveEstimate]:
        """Take the next record; returns what it causes to be recorded."""
        notes = self._check_rules(record)
        match record.value:
            case Fix() as fix:
                notes += self._track.add(record.t_ns, fix)
                if self._track.latest is not None:
                    self.walk_area.add(self._track.latest.place)
                return [*notes, *self._guide(record.t_ns)]
            case Scan() as scan:
                return [*notes, *self._take_scan(seq, record, scan)]
            case Note(code=code, text=cell) if code == FOLLOW:
                conspicuous = {one.cell for one in self.suspicion.conspicuous()}
                self._reference.follow(cell, for_word=cell in conspicuous)
            case Note(code=code, text=metres) if code == WITHIN:
                self.walk_area.widen(within_of(metres))
        return [*notes]

    def _check_rules(self, record: Record) -> list[Note]:
        errors = self.suspicion.errors
        before = set(errors)
        findings = self.suspicion.feed(record)
        words = [self.suspicion.assessment(finding.cell) for finding in findings]
        new = [(name, text) for name, text in errors.items() if name not in before]
        return [*finding_notes(findings, words), *error_notes(new)]

    def _take_scan(self, seq: int, record: Record, scan: Scan) -> list[Note | LiveEstimate]:
        modem = record.source
        receiver = self._track.at_scan(record.t_ns, scan)
        if self._names is not None:
            place = None if receiver is None else receiver.place
            scan = self._names.take(record.t_ns, scan, place, self._identities)
        self._identities.add(scan)
        if receiver is None:
            return []
        results = self._step_reference(seq, record, scan, receiver.place)
        levels = _levels(scan)
        for name in levels:
            if name in self._cells:  # it gives way to none of its scan, but to the target
                self._cells.put(name, self._cells[name])
        for name, (reading, level_dbm) in levels.items():
            located = _at_receiver(name, receiver, level_dbm, reading)
            has_room = name == self.target or self._cells.has_room(name, levels)
            if name in self._identities and has_room:
                results += self._take_reading(seq, name, modem, located)
            elif not reading.identity_unsure:
                self._once.put(name, (modem, located))
        self._search()
        return results

    def _step_reference(
        self, seq: int, record: Record, scan: Scan, place: Places
    ) -> list[Note | LiveEstimate]:
        known = tuple(r for r in scan.readings if r.cell in self._identities)
        known_scan = replace(scan, readings=known)
        change = self._reference.choose(record, known_scan, place, self._suspects())
        estimate = self._reference.step(seq, record.source, known_scan, place)
        return [one for one in (change, estimate) if one]

    def _suspects(self) -> list[str]:
        """Cells that may become the target for their word, the worst first."""
        worst = self.suspicion.worst
        if worst is None:
            return []
        if not self._gives_up:  # as it was before there were pursuits: any word counted
            return [worst]
        if self.suspicion.assessment(worst).word != "suspicious":
            return []
        return [one.cell for one in self.suspicion.conspicuous() if one.word == "suspicious"]

    def _take_reading(
        self, seq: int, name: str, modem: str, located: Readings
    ) -> list[Note | LiveEstimate]:
        cell = self._cells.get(name)
        if cell is None or (is_by_channel(name) and cell.away_m(located.places) > REUSED_M):
            cell = LiveCell(self._prior, where=self.walk_area)
        self._cells.put(name, cell)
        first = self._once.pop(name, None)
        if first is not None:
            earlier, reading = first
            cell.take(reading, earlier)
        estimate = cell.take(located, modem, seq)
        notes = [Note("info", code, f"{name}: {text}") for code, text in cell.news]
        return [*notes] if estimate is None else [*notes, estimate]

    def _guide(self, t_ns: int) -> list[Note]:
        """New advice for the target, and the end of the search for it."""
        receiver, pursuit = self._track.latest, self.pursuit
        if receiver is None or pursuit is None or pursuit.cell not in self._cells:
            return []
        here, target, before_end = receiver.place, pursuit.cell, pursuit.over
        if self.followed is None or self.followed.cell != target:
            streets = self._streets.near(here)
            self.followed = FollowedCell(target, streets, self._track.walk)
        before = self.followed.way
        word = self.suspicion.assessment(target).word
        pursuit.walk(t_ns, here, is_suspicious=word == "suspicious")
        if self.followed.update(here, self._cells[target].locator) and self.followed.answer:
            pursuit.judge(self.followed.answer)
        notes = []
        way = self.followed.way
        if way is not None and way is not before and not pursuit.over:
            notes.append(Note("info", ADVICE, f"{target}: {way.text}"))
        if self._gives_up and pursuit.over not in {"", before_end}:
            notes.append(Note("info", "target-over", f"{target}: {pursuit.over}"))
        return notes

    def _search(self) -> None:
        cell = max(self._cells.values(), key=lambda cell: cell.stale, default=None)
        if cell is not None and cell.stale > 1.0:
            cell.search()


def live_prior(settings: LiveSettings) -> Prior:
    """The configured prior with the noise of the desktop program."""
    return prior_for(
        settings.environment,
        height_m=settings.height_m,
        antenna=settings.antenna,
        reach=settings.reach,
    )


def _levels(scan: Scan) -> dict[str, tuple[CellReading, float]]:
    """Of a cell that is listed twice the surer reading counts."""
    first: dict[str, tuple[CellReading, float]] = {}
    for reading in sorted(scan.readings, key=lambda reading: reading.identity_unsure):
        name, level_dbm = reading.cell, reading.level_dbm
        if name is not None and level_dbm is not None:
            first.setdefault(name, (reading, level_dbm))
    return first


def _at_receiver(cell: str, receiver: Receiver, level_dbm: float, reading: CellReading) -> Readings:
    place = receiver.place.less_sure(TIMING_S * receiver.speed_mps)
    return Readings.one(cell, reading.rat, place, level_dbm, limit_of(level_dbm, reading.rat))
