"""The live estimate once more, from recorded fixes, scans and what the walker asked for."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from importlib.metadata import version

import numpy as np
from threadpoolctl import threadpool_limits

from logger.core.baseline import baseline_of, has_whole_baseline
from logger.core.errors import EstimationError, error_place
from logger.core.live import ADVICE, LiveTracker
from logger.core.live_settings import BEHIND, FAILED, FOLLOW, RESTARTED, SUSPICIOUS, WITHIN
from logger.core.runfile import Run
from logger.core.runfile.meta import is_import
from logger.core.suspicion.rules import RULES_CODE, rules_note
from logger.core.suspicion.words import FINDING_CODE
from logger.core.types import LiveEstimate, Note, Record, Scan


@dataclass(frozen=True, slots=True)
class Replay:
    """Live estimates as recorded and as recomputed; equal means equal to the last bit.

    That holds on one kind of machine: between a Pi and a laptop log10 and BLAS may differ in the
    last bit, which moves the position by `largest_m`. Another version of the program may differ by
    more: `recorded_by` and `replayed_by` name both. Findings of `other_rules` are not compared.
    Nothing is replayed of an import, which has no live estimates.
    """

    n_recorded: int
    n_replayed: int
    n_equal: int
    first_difference: int | None
    largest_m: float
    recorded_by: str
    replayed_by: str
    n_findings: int = 0
    findings_differ: bool = False
    advice_differs: bool = False
    other_rules: bool = False
    is_import: bool = False

    @property
    def equal(self) -> bool:
        """Whether every estimate, finding and piece of advice is there and equal.

        Findings of other rules need not be.
        """
        is_estimate_equal = self.n_equal == self.n_recorded == self.n_replayed
        return is_estimate_equal and not self.findings_differ and not self.advice_differs

    @property
    def text(self) -> str:
        """The result in a sentence."""
        if self.is_import:
            return "the run has no live estimates to compare with: another program recorded it"
        if not self.n_recorded and not self.n_replayed:
            return "the run contains no live estimate: no 2G cell was decoded while there was a fix"
        if self.equal:
            words = "; words by other rules" if self.other_rules else ""
            return f"replay equals live: {self.n_equal} estimates, to the last bit{words}"
        if self.findings_differ:
            return "replay differs from live: the findings of the rules are not the recorded ones"
        if self.advice_differs and self.n_equal == self.n_recorded == self.n_replayed:
            return "replay differs from live: the advice where to walk is not the recorded one"
        largest = f", largest {self.largest_m:.3g} m" if self.largest_m else ""
        programs = f"recorded by {self.recorded_by}, replayed by {self.replayed_by}"
        if self.recorded_by == self.replayed_by:
            programs = f"both by {self.replayed_by}, with other code or on another machine"
        return (
            f"replay differs from live: {self.n_recorded} recorded, {self.n_replayed} replayed, "
            f"{self.n_equal} equal; first difference at record {self.first_difference}{largest}; "
            f"{programs}"
        )


def live_values(run: Run) -> Iterator[LiveEstimate | Note]:
    """Live estimates and events computed from the run's records, in their order.

    Where the estimate failed on the device and began anew, it does so here. Raises
    `EstimationError` where it fails only here.
    """
    failed, restarted = _numbers(run, FAILED), _numbers(run, RESTARTED)
    targets = _targets(run)
    tracker: LiveTracker | None = _tracker(run, targets)
    asked: dict[str, tuple[int, Record]] = {}
    with threadpool_limits(1):  # as on the device: several threads of BLAS add in another order
        for seq, record in run.records("fixes", "scans", "notes"):
            if isinstance(record.value, Note):
                if record.value.code not in {FOLLOW, WITHIN}:
                    continue
                asked[record.value.code] = seq, record
            if seq in failed:
                tracker = None
            elif tracker is None and seq in restarted:
                tracker = _tracker(run, targets)
                _ask_again(tracker, [one for one in asked.values() if one[0] != seq], targets)
            if tracker is None or _is_replaced(record, targets):
                continue
            try:
                if targets and isinstance(record.value, Scan) and record.t_ns in targets:
                    tracker.feed(seq, targets[record.t_ns])
                values = tracker.feed(seq, record)
            except Exception as error:
                text = f"{run.path}: the live estimate fails at record {seq}: {error_place(error)}"
                raise EstimationError(text) from error
            yield from values


def _ask_again(
    tracker: LiveTracker,
    asked: Iterable[tuple[int, Record]],
    targets: Mapping[int, Record] | None,
) -> None:
    for seq, record in asked:
        if not _is_replaced(record, targets):
            tracker.feed(seq, record)


def _is_replaced(record: Record, targets: Mapping[int, Record] | None) -> bool:
    """Whether a record is a choice of a cell, and the targets are those of the run."""
    is_choice = isinstance(record.value, Note) and record.value.code == FOLLOW
    return targets is not None and is_choice


def _tracker(run: Run, targets: Mapping[int, Record] | None) -> LiveTracker:
    tracker = LiveTracker(run.meta.live, baseline_of(run))
    if targets is not None:
        tracker.feed(0, Record(0, "replay", Note("info", FOLLOW, "")))  # no cell before the first
    return tracker


def _targets(run: Run) -> dict[int, Record] | None:
    """Targets as the run has them, by the time of their scan; None where they are chosen anew.

    The target may be the most suspicious cell, and words by other rules cannot be repeated.
    """
    notes = [record for _, record in run.records("notes")]
    wanted = {run.meta.live.target, *_texts((record.value for record in notes), FOLLOW)}
    if SUSPICIOUS not in wanted or _has_same_words(run):
        return None
    chosen = ((record.t_ns, _TARGET.match(getattr(record.value, "text", ""))) for record in notes)
    return {
        t_ns: Record(t_ns, "replay", Note("info", FOLLOW, cell[1])) for t_ns, cell in chosen if cell
    }


_TARGET = re.compile(r"target is (.*) at -?\d+ dBm")


def _numbers(run: Run, code: str) -> frozenset[int]:
    named = (re.match(r"record (\d+):", text) for text in _texts(_values(run, "notes"), code))
    return frozenset(int(number[1]) for number in named if number)


def replay(run: Run) -> Replay:
    """Repeat the live estimate and compare.

    After a power cut, or on a slow device, the end of the recorded estimates may be missing.
    """
    recorded = [value for value in _values(run, "live") if isinstance(value, LiveEstimate)]
    programs = run.meta.program, f"cellwalk {version('cellwalk')}"
    if is_import(run.meta.origin) and not recorded:
        return Replay(0, 0, 0, None, 0.0, *programs, is_import=True)
    values_replayed = list(live_values(run))
    replayed = [value for value in values_replayed if isinstance(value, LiveEstimate)]
    findings = _findings(_values(run, "notes"))
    findings_replayed = _findings([rules_note(), *values_replayed])
    if _is_cut(run):
        common = min(len(recorded), len(replayed))
        recorded, replayed = recorded[:common], replayed[:common]
    pairs = list(zip(recorded, replayed, strict=False))
    different = [(a, b) for a, b in pairs if not _are_equal(a, b)]
    alone = [*recorded[len(pairs) :], *replayed[len(pairs) :]]
    first = next(iter([*(a for a, _ in different), *alone]), None)
    offsets_m = [abs(off) for a, b in different for off in (a.x_m - b.x_m, a.y_m - b.y_m)]
    return Replay(
        len(recorded),
        len(replayed),
        len(pairs) - len(different),
        first.scan_seq if first else None,
        max([0.0, *offsets_m]),  # NaN compares false and is passed over
        *programs,
        n_findings=len(findings),
        findings_differ=_findings_differ(run, findings, findings_replayed),
        advice_differs=_advice_differs(run, values_replayed),
        other_rules=_are_of_others(findings),
    )


def _is_cut(run: Run) -> bool:
    """Whether the last records may have no estimate."""
    return run.end is None or bool(np.any(run.tables["notes"]["code"] == BEHIND.encode()))


def _findings(values: Iterable[object]) -> list[str]:
    """Findings as recorded, after the event that names the rules."""
    return _texts(values, RULES_CODE, FINDING_CODE)


def _texts(values: Iterable[object], *codes: str) -> list[str]:
    return [value.text for value in values if isinstance(value, Note) and value.code in codes]


def _findings_differ(run: Run, recorded: list[str], replayed: list[str]) -> bool:
    if not recorded or not _has_same_words(run):
        return False
    shorter = min(len(recorded), len(replayed)) if _is_cut(run) else None
    return recorded[:shorter] != replayed[:shorter]


def _has_same_words(run: Run) -> bool:
    """Whether a run has the words of these rules, with all they used of earlier walks, or none."""
    return has_whole_baseline(run) and not _are_of_others(_findings(_values(run, "notes")))


def _are_of_others(findings: Sequence[str]) -> bool:
    return bool(findings) and findings[0] != rules_note().text


def _values(run: Run, table: str) -> Iterator[object]:
    return (record.value for _, record in run.records(table))


def _advice_differs(run: Run, replayed: Iterable[object]) -> bool:
    """False also where advice cannot be repeated: with a street map, or other targets."""
    advice = _texts(_values(run, "notes"), ADVICE)
    has_streets = np.any(run.tables["notes"]["code"] == b"streets")
    if not advice or has_streets or _targets(run) is not None:
        return False
    again = _texts(replayed, ADVICE)
    return advice != (again[: len(advice)] if _is_cut(run) else again)


def _are_equal(a: LiveEstimate, b: LiveEstimate) -> bool:
    """Equal in every field; NaN equals NaN, since a diverged filter must diverge again."""
    fields = zip(astuple(a), astuple(b), strict=True)
    return all(x == y or (x != x and y != y) for x, y in fields)  # noqa: PLR0124
