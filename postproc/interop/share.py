"""A copy of a run for publication: without the ends of the walk and without the machine.

What lies inside a circle around the first fix, or around the last, is left out, at whatever time
the walker was there. The centre of a circle would reveal the home, so each is moved at random and
made wider by as much. First fixes are often wrong, so the median of a minute is protected as well.

Texts may name the owner, a folder or a machine: only those whose form is known here are kept.
"""

import re
import secrets
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import cos, pi, sin, sqrt
from pathlib import Path
from typing import Literal, get_args, get_origin

import msgspec
import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from logger.core.arrays import FloatArray, IntArray
from logger.core.document import number_of
from logger.core.errors import ConfigError
from logger.core.live import LiveTracker
from logger.core.live_settings import BEHIND, FOLLOW, MARK, STRONGEST, SUSPICIOUS, LiveSettings
from logger.core.places import MAX_GAP_S, Track, track_of
from logger.core.runfile import Run
from logger.core.runfile.meta import SHARED, origin_of_copy
from logger.core.schema import TABLES
from logger.core.types import CellReading, Fix, LiveEstimate, Note, Rat, Record, Role, Scan
from postproc.interop.importing import Append, meta_of, spare, write_run
from postproc.interop.sighting import DEFAULT_CELL

BLUR_M = 200.0
_SHIFT = 0.5
"""Farthest shift of a circle's centre, as a share of the requested radius."""
_END_S = 60.0
_CHOICES = (STRONGEST, SUSPICIOUS)
_CELL_NAME = re.compile(
    rf"(?:\d{{1,3}}|\?)-(?:\d{{1,3}}|\?)-(?:\d{{1,10}}|\?)-(?:\d{{1,11}}|\?)"
    rf"|[0-9A-Fa-f]{{2}}(?::[0-9A-Fa-f]{{2}}){{5}}|{DEFAULT_CELL}",
    re.ASCII,
)
"""An identity, also with unknown parts, the address of a transmitter, or the only cell of a log."""
_BAND_WORDS = "GSM|EGSM|PGSM|RGSM|DCS|PCS|CELLULAR|WCDMA|UMTS|IMT|AWS|LTE|EUTRAN|NR5G|BAND|MODE"
_FORMS = {
    "role": re.compile("|".join(get_args(Role))),
    "rat": re.compile("|".join(map(re.escape, get_args(Rat)))),
    "mcc": re.compile(r"\d{1,3}", re.ASCII),
    "mnc": re.compile(r"\d{1,3}", re.ASCII),
    "band": re.compile(rf"(?:(?:{_BAND_WORDS}|[BbNn]?\d{{1,4}})(?:[-_ ]|$))+", re.ASCII),
}
"""Of the texts of a reading besides the name of its cell."""
_TEXTS = tuple(
    column.name
    for column in TABLES["readings"]
    if column.dtype.startswith("S") and column.name not in {"source", "cell"}
)
EVENTS = frozenset(
    {
        *(BEHIND, FOLLOW, MARK, "battery-low", "full-scan", "mode-gsm", "mode-left", "mode-set"),
        *("modem-ready", "modem-restarted", "new-file", "overflow", "port-lost", "port-opened"),
        *("ports-exchanged", "position-leap", "scan-refused", "stop", "unmapped"),
        *("write-failed", "write-resumed"),
    }
)
"""Codes of the notes that a copy has: those that say something without their text."""


@dataclass(frozen=True, slots=True)
class Shared:
    """What a copy contains, and what was left out."""

    path: Path
    blur_m: float
    n_fixes: int
    n_scans: int
    n_readings: int
    removed: tuple[str, ...]
    kept: tuple[str, ...]


def share(run: Run, target: Path, blur_m: float = BLUR_M) -> Shared:
    """Write the copy.

    Raises `ConfigError` where nothing would be left, `EstimationError` without a fix.
    """
    if not 0.0 < blur_m < 1e6:
        raise ConfigError("--blur-m is a radius in metres, more than 0")
    spare(target, SHARED, "copy")
    track = track_of(run.tables["fixes"])
    shown = _Shown.of(track.t_ns, _outside_of_ends(track, blur_m))
    if not len(shown.starts):
        raise ConfigError(
            f"the walk is nowhere far from its ends: nothing is left with --blur-m {blur_m:g}"
        )
    start_ns = int(shown.starts[0])
    names = _CellNames()
    live = _settings_to_share(run.meta.live, names)
    truth = tuple(msgspec.structs.replace(one, cell=names.of(one.cell)) for one in run.meta.truth)
    meta = meta_of(origin_of_copy(run.meta.origin), live=live, truth=truth)
    counts: Counter[str] = Counter()

    def fill(append: Append) -> int:
        with threadpool_limits(1):  # the estimate as `postproc replay` repeats it
            tracker = LiveTracker(meta.live) if len(run.tables["live"]) else None
            counts.update(_append(append, _records_to_share(run, shown, start_ns, names), tracker))
        return int(shown.ends[-1]) - start_ns

    write_run(target, meta, fill, SHARED)
    return Shared(
        target,
        blur_m,
        counts["Fix"],
        counts["Scan"],
        counts["CellReading"],
        _removal_notes(run, counts, names, blur_m),
        _remaining_notes(run),
    )


@dataclass(frozen=True, slots=True)
class _Shown:
    """Intervals in which the walker may be shown: between near fixes outside of the circles.

    Arrays of shape (n,), in time order; `hidden_ns` are the times of the fixes inside.
    """

    starts: IntArray
    ends: IntArray
    hidden_ns: IntArray

    @classmethod
    def of(cls, t_ns: IntArray, outside: npt.NDArray[np.bool_]) -> "_Shown":
        following = np.append(t_ns[1:], t_ns[-1])
        whole = np.append(outside[1:], False) & (following - t_ns <= MAX_GAP_S * 1e9)
        return cls(t_ns[outside], np.where(whole, following, t_ns)[outside], t_ns[~outside])

    def shows(self, begun_ns: int, ended_ns: int) -> bool:
        """Whether the walker was certainly outside of the circles from one time to another."""
        passed = np.searchsorted(self.hidden_ns, ended_ns, "right") - np.searchsorted(
            self.hidden_ns, begun_ns, "left"
        )
        return not passed and self._knows(begun_ns) and self._knows(ended_ns)

    def _knows(self, t_ns: int) -> bool:
        last = int(np.searchsorted(self.starts, t_ns, "right")) - 1
        return last >= 0 and t_ns <= self.ends[last]


def _outside_of_ends(track: Track, blur_m: float) -> npt.NDArray[np.bool_]:
    xy_m = np.column_stack([track.x_m, track.y_m])
    outside = np.ones(len(xy_m), bool)
    minute_ns = round(_END_S * 1e9)
    ends = {
        0: track.t_ns <= track.t_ns[0] + minute_ns,
        -1: track.t_ns >= track.t_ns[-1] - minute_ns,
    }
    for end, around in ends.items():
        shift_m = _random_shift_m(_SHIFT * blur_m)
        for centre in (xy_m[end], np.median(xy_m[around], axis=0)):
            outside &= np.hypot(*(xy_m - centre - shift_m).T) > (1.0 + _SHIFT) * blur_m
    return outside


def _random_shift_m(most_m: float) -> FloatArray:
    """East and north, uniform in a circle."""
    random = secrets.SystemRandom()
    angle, away_m = random.uniform(0.0, 2.0 * pi), most_m * sqrt(random.random())
    return np.array([away_m * cos(angle), away_m * sin(angle)])


class _CellNames:
    """Names of cells as a copy has them: those that are no identity are numbered."""

    def __init__(self) -> None:
        self.numbered: dict[str, str] = {}

    def of(self, name: str) -> str:
        if _CELL_NAME.fullmatch(name):
            return name
        return self.numbered.setdefault(name, f"cell-{len(self.numbered) + 1}")

    def of_target(self, target: str) -> str:
        return target if target in _CHOICES else self.of(target)


def _settings_to_share(live: LiveSettings, names: _CellNames) -> LiveSettings:
    """Numbers and choices of a few words; of the texts the target alone."""
    kept = {
        field.name: getattr(live, field.name)
        for field in msgspec.structs.fields(LiveSettings)
        if field.type in {int, float, bool, float | None} or get_origin(field.type) is Literal
    }
    return LiveSettings(**kept, target=names.of_target(live.target))


def _reading_to_share(reading: CellReading, names: _CellNames) -> CellReading:
    unknown = {
        name: None
        for name in _TEXTS
        if (text := getattr(reading, name)) is not None
        and not (name in _FORMS and _FORMS[name].fullmatch(str(text)))
    }
    kept = replace(reading, label=None, **unknown)  # type: ignore[arg-type]
    cell = reading.cell and names.of(reading.cell)
    return kept if kept.cell == cell else replace(kept, label=cell)


def _records_to_share(
    run: Run, shown: _Shown, start_ns: int, names: _CellNames
) -> Iterator[tuple[int, Record]]:
    """Fixes, scans and notes to be shown, with their record numbers, from time 0 on."""
    sources: dict[tuple[str, str], str] = {}
    for seq, record in run.records("fixes", "scans", "notes"):
        kept: Fix | Scan | Note
        value = record.value
        begun_ns = value.t_start_ns if isinstance(value, Scan) else record.t_ns
        if not shown.shows(begun_ns, record.t_ns):
            continue
        match value:
            case Fix():
                kind = "gnss"
                kept = value if value.valid else replace(value, lat_deg=None, lon_deg=None)
            case Scan():
                readings = tuple(_reading_to_share(reading, names) for reading in value.readings)
                kept = replace(value, t_start_ns=begun_ns - start_ns, readings=readings)
                kind = "modem"
            case Note() if value.code in EVENTS:
                text = names.of_target(value.text) if value.code == FOLLOW else ""
                kind, kept = "logger", replace(value, text=text)
            case _:
                continue
        # ports have names of the owner's choosing
        same_kind = sum(named == kind for named, _ in sources)
        source = sources.setdefault(
            (kind, record.source), f"{kind}-{same_kind + 1}" if same_kind else kind
        )
        yield seq, Record(record.t_ns - start_ns, source, kept)


def _append(
    append: Append, kept: Iterator[tuple[int, Record]], tracker: LiveTracker | None
) -> Counter[str]:
    """Write records and, after each, the live estimate recomputed; counts the records by kind."""
    numbers: dict[int | None, int] = {}
    counts: Counter[str] = Counter()
    for old, shown in kept:
        record, value = shown, shown.value
        if isinstance(value, Scan):
            start, end = numbers.get(value.fix_start_seq), numbers.get(value.fix_seq)
            record = replace(shown, value=replace(value, fix_start_seq=start, fix_seq=end))
            counts["CellReading"] += len(value.readings)
        seq = append(record)
        counts[type(value).__name__] += 1
        if isinstance(value, Fix):
            numbers[old] = seq
        if tracker is not None and not (isinstance(value, Note) and value.code != FOLLOW):
            for estimate in tracker.feed(seq, record):
                if isinstance(estimate, LiveEstimate):
                    append(Record(record.t_ns, "live", estimate))
    return counts


def _removal_notes(
    run: Run, counts: Counter[str], names: _CellNames, blur_m: float
) -> tuple[str, ...]:
    meta, tables = run.meta, run.tables
    counts_left_out = ", ".join(
        f"{len(tables[table]) - counts[kind]} {table}" for table, kind in _TABLES.items()
    )
    where = (
        f"recorded within {blur_m:g} m or somewhat more of the start or the end, or "
        "without a known position"
    )
    removed = [
        f"{counts_left_out}: {where}",
        f"{len(run.raw_bytes)} raw bytes of the ports" if len(run.raw_bytes) else "",
        f"the configuration ({len(meta.config_text)} characters)" if meta.config_text else "",
        number_of(len(tables["notes"]) - counts["Note"], "note")
        + (f", and the texts of the other {counts['Note']}" if counts["Note"] else "")
        if len(tables["notes"])
        else "",
        f"names of cells that are no identity ({len(names.numbered)}); they are numbered"
        if names.numbered
        else "",
        "the number of the boot, the time since boot, and the names of ports and files",
        f"versions of {len(meta.versions)} programs of the recorder" if meta.versions else "",
        f"{len(tables['live'])} live estimates; they are recomputed from the remaining records"
        if len(tables["live"])
        else "",
        "the run's number and its hash chain, which are new",
    ]
    return tuple(text for text in removed if text)


_TABLES = {"fixes": "Fix", "scans": "Scan", "readings": "CellReading"}


def _remaining_notes(run: Run) -> tuple[str, ...]:
    simulated = ("the true positions of the simulated transmitters",) if run.meta.truth else ()
    return (
        "the track elsewhere, with the time of day",
        "identities and levels of the cells",
        *simulated,
    )
