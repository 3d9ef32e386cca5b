"""Contents of a run: counts, gaps, how it stopped, and whether it is complete."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from logger.core.document import Column, Document, Line, Table, Word, facts
from logger.core.errors import ConfigError
from logger.core.rows import levels_dbm, numbered_texts
from logger.core.runfile import Run, Sealing, read_sealed_run
from logger.core.suspicion.words import in_plain_words
from logger.core.timebase import fit_run, why_unknown
from logger.core.types import DEAD_RECKONING, UNKNOWN_ID, utc_text
from postproc.scan_counts import scans_of

GAP_S = 5.0
"""A silence of the receiver or the modem that is worth telling."""
MOST = 10
"""Of gaps and events that are printed without -v: they leave room for the rest on a screen."""
MOST_CELLS = 40
"""Of the cells with most readings; more than any city has within a walk."""
_WEIGHT = {"error": 0, "warning": 1}
_STYLES = {"error": "red", "warning": "yellow"}
_CELL_COLUMNS = (
    Column("cell"),
    Column("type"),
    Column("readings", "d"),
    Column("in scans", "d"),
    Column("strongest", ".0f", "dBm"),
)


@dataclass(frozen=True, slots=True)
class CellCount:
    """One cell of a run; `n_scans` are those in which it was identified without doubt."""

    cell: str
    rat: str | None
    n: int
    n_scans: int
    strongest_dbm: float | None


@dataclass(frozen=True, slots=True)
class Gap:
    """A stretch without a record of a kind, in seconds since the start of the run."""

    of: str
    start_s: float
    length_s: float


@dataclass(frozen=True, slots=True)
class Event:
    """A note, with its time since the start of the run."""

    t_s: float
    source: str
    level: str
    code: str
    text: str

    @property
    def in_short(self) -> str:
        """For readers."""
        return in_plain_words(self.text) or self.code


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFacts:
    """A run in single values; `started_utc` is None where it is unknown."""

    path: str
    form: str
    run_id: str
    origin: str
    program: str
    simulated: bool
    started_utc: str | None
    duration_s: float
    stopped: str | None
    missing_frames: int
    skipped_bytes: int
    meaningless_values: int
    digest: str
    n_fixes: int
    n_fixes_valid: int
    n_fixes_by_dead_reckoning: int
    n_scans: int
    n_readings: int
    n_readings_without_fix: int
    n_readings_without_identity: int
    n_live: int
    n_raw_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Info(RunFacts):
    """Summary of a run, with its cells, gaps and events.

    `no_utc` is why `started_utc` is unknown, empty where it is known.
    """

    no_utc: str
    cells: tuple[CellCount, ...]
    gaps: tuple[Gap, ...]
    events: tuple[Event, ...]


def document_of(info: Info, *, details: bool = False) -> Document:
    """A run on one screen; with `details` every gap and every event."""
    simulated = ", SIMULATED" if info.simulated else ""
    title = f"{info.path} ({info.form}), {info.origin}{simulated}"
    return Document(info, title, body=_parts(info, details=details))


def _parts(info: Info, *, details: bool) -> Iterator[Line | Table]:
    cells = info.cells if details else info.cells[:MOST_CELLS]
    most = max(len(info.gaps), len(info.events)) if details else MOST
    yield from facts(_facts(info))
    rows = [(one.cell, one.rat, one.n, one.n_scans, one.strongest_dbm) for one in cells]
    yield Table(_CELL_COLUMNS, rows)
    yield from _rest(len(info.cells) - len(cells), "cells")
    longest = longest_gaps(info.gaps, most)
    for gap in longest:
        yield Line(f"no {gap.of} for {gap.length_s:.0f} s at +{gap.start_s:.0f} s", bullet="gap  ")
    yield from _rest(len(info.gaps) - len(longest), "shorter gaps")
    gravest = gravest_events(info.events, most)
    for event in gravest:
        style = _STYLES.get(event.level, "dim")
        yield Line(f"{event.source}: {event.in_short}", style, bullet=f"+{event.t_s:.0f} s  ")
    yield from _rest(len(info.events) - len(gravest), "events")
    yield from facts([("digest", info.digest)], len("readings"))


def longest_gaps(gaps: Sequence[Gap], most: int) -> list[Gap]:
    """In the order of time."""
    longest = sorted(gaps, key=lambda gap: -gap.length_s)[:most]
    return sorted(longest, key=lambda gap: gap.start_s)


def gravest_events(events: Sequence[Event], most: int) -> list[Event]:
    """Errors first, then warnings; in the order of time."""
    gravest = sorted(events, key=lambda event: _WEIGHT.get(event.level, 2))[:most]
    return sorted(gravest, key=lambda event: event.t_s)


def _rest(n: int, what: str) -> Iterator[Line]:
    if n > 0:
        yield Line(f"... and {n} more {what} (-v lists all)", "dim")


def _facts(info: Info) -> Iterator[tuple[Word | str, Word | str]]:
    started = info.started_utc or f"at an unknown time ({info.no_utc})"
    yield "started", f"{started}, {info.duration_s:.0f} s"
    yield "stopped", info.stopped or "not: the plug was pulled, or it is still being recorded"
    if info.missing_frames or info.skipped_bytes or info.meaningless_values:
        damage = f"{info.missing_frames} frames missing, {info.skipped_bytes} bytes damaged"
        if info.meaningless_values:
            damage += f", {info.meaningless_values} values that no recorder writes left out"
        yield "damage", Word(damage, "red")
    n = info.n_fixes_by_dead_reckoning
    dead = f", {n} of these by dead reckoning, without satellites" if n else ""
    yield "fixes", f"{info.n_fixes}, {info.n_fixes_valid} with a position{dead}"
    without = (
        f"{info.n_readings_without_fix} without a fix, {info.n_readings_without_identity} of "
        "cells not decoded"
    )
    yield "readings", f"{info.n_readings} in {info.n_scans} scans, {without}"
    yield "live", f"{info.n_live} estimates; raw {info.n_raw_bytes} bytes"


def document_of_checks(checks: Sequence["Check"]) -> Document:
    """What `info --verify` says."""
    ok, fail = Word("ok"), Word("FAIL", "red")
    said = [(ok if check.holds else fail, f"{check.what}: {check.text}") for check in checks]
    return Document(checks, body=facts(said, len("FAIL")))


def describe(run: Run) -> Info:
    """Summary of a run in either form."""
    fixes, scans, readings = run.tables["fixes"], run.tables["scans"], run.tables["readings"]
    start_ns = run.meta.started_ns
    timebase = fit_run(run.meta.origin, fixes)
    stamps = [rows["t_ns"].max() for rows in run.tables.values() if len(rows)]
    end_ns = max([*map(int, stamps), run.end.t_ns if run.end else start_ns])
    return Info(
        path=str(run.path),
        form=run.form,
        run_id=run.meta.run_id,
        origin=run.meta.origin,
        program=run.meta.program,
        simulated=bool(run.meta.truth),
        no_utc="" if timebase else why_unknown(run.meta.origin, fixes, run.tables["notes"]),
        started_utc=utc_text(timebase.utc_ns(start_ns)) if timebase else None,
        duration_s=(end_ns - start_ns) / 1e9,
        stopped=run.end.reason if run.end else None,
        missing_frames=run.damage.missing_frames,
        skipped_bytes=run.damage.skipped_bytes,
        meaningless_values=run.damage.meaningless_values,
        digest=run.digest,
        n_fixes=len(fixes),
        n_fixes_valid=int(np.count_nonzero(fixes["valid"])),
        n_fixes_by_dead_reckoning=int(
            np.count_nonzero((fixes["valid"] == 1) & (fixes["quality"] == DEAD_RECKONING))
        ),
        n_scans=len(scans),
        n_readings=len(readings),
        n_readings_without_fix=int(np.count_nonzero(readings["fix_seq"] == UNKNOWN_ID)),
        n_readings_without_identity=int(np.count_nonzero(readings["cell"] == b"")),
        n_live=len(run.tables["live"]),
        n_raw_bytes=run.n_raw_bytes,
        cells=_cells(run),
        gaps=(
            *_gaps("fixes", fixes["t_ns"][fixes["valid"] == 1], start_ns),
            *_gaps("scans", scans["t_ns"], start_ns),
        ),
        events=_events(run),
    )


def _cells(run: Run) -> tuple[CellCount, ...]:
    readings = run.named_readings
    names, which = numbered_texts(readings["cell"])
    first = np.zeros(len(names), np.int64)
    first[which[::-1]] = np.arange(len(which))[::-1]
    levels, scans = levels_dbm(readings), scans_of([run])
    strongest_dbm = np.full(len(names), -np.inf)
    known = np.isfinite(levels)
    np.maximum.at(strongest_dbm, which[known], levels[known])
    counts = np.bincount(which, minlength=len(names))
    rows = zip(
        names.tolist(),
        readings["rat"][first].tolist(),
        counts.tolist(),
        strongest_dbm.tolist(),
        strict=True,
    )
    cells = [
        CellCount(
            name.decode(),
            rat.decode() or None,
            n,
            scans[name.decode()],
            most_dbm if np.isfinite(most_dbm) else None,
        )
        for name, rat, n, most_dbm in rows
        if name
    ]
    return tuple(sorted(cells, key=lambda cell: -cell.n))


def _gaps(of: str, t_ns: np.ndarray[tuple[int], np.dtype[np.int64]], start_ns: int) -> list[Gap]:
    times = np.sort(t_ns)
    lengths_s = np.diff(times) / 1e9
    return [
        Gap(of, float((times[i] - start_ns) / 1e9), float(lengths_s[i]))
        for i in np.flatnonzero(lengths_s > GAP_S)
    ]


def _events(run: Run) -> tuple[Event, ...]:
    return tuple(
        Event(
            (int(row["t_ns"]) - run.meta.started_ns) / 1e9,
            row["source"].decode(),
            row["level"].decode(),
            row["code"].decode(),
            row["text"].decode(),
        )
        for row in run.tables["notes"]
    )


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that a run promises, and whether it holds."""

    what: str
    holds: bool
    text: str


def verify(path: Path, noted: str | None = None) -> tuple[Check, ...]:
    """Check a run in either form by its file alone, and against the digest `noted` elsewhere.

    Raises `RunFileError` when it cannot be read at all.
    """
    run, sealing = read_sealed_run(path)
    stopped = run.end.reason if run.end else "no record of a stop: the run was cut"
    if not sealing.stop_is_sealed:
        stopped += " (recorded by an earlier version, which did not seal this)"
    return (
        Check(
            "checksums",
            not run.damage,
            str(run.damage) if run.damage else "every frame is there and undamaged",
        ),
        _counts(run),
        _time(run),
        Check("stop", run.end is not None, stopped),
        _chain(sealing),
        *(Check("content", False, f"altered: {difference}") for difference in sealing.differences),
        *([] if noted is None else [_check_noted_digest(sealing, noted)]),
    )


def noted_digest(text: str) -> str:
    """A digest as somebody has noted it; raises `ConfigError` for what is none."""
    digest = "".join(text.split()).lower()
    if not re.fullmatch("[0-9a-f]{64}", digest):
        raise ConfigError(f"--digest: {text[:80]!r} is no digest, which has 64 digits from 0 to f")
    return digest


_OF_SCANS = frozenset({"readings", "broadcasts"})
"""Tables whose rows belong to a scan and have its number."""


def _counts(run: Run) -> Check:
    """Row counts agree with the record numbers, the scans and the index of raw bytes."""
    seqs = np.concatenate(
        [rows["seq"] for table, rows in run.tables.items() if table not in _OF_SCANS]
    )
    n = run.end.n_records if run.end else int(seqs.max(initial=-1)) + 1
    wrong = []
    if len(np.unique(seqs)) != n or len(seqs) != n:
        wrong.append(f"{n} records were numbered and {len(np.unique(seqs))} are there")
    announced = int(run.tables["scans"]["n_readings"].sum())
    if announced != len(run.tables["readings"]):
        wrong.append(
            f"{announced} readings were announced and {len(run.tables['readings'])} are there"
        )
    n_bytes = int(run.tables["raw"]["length"].sum())
    if n_bytes != run.n_raw_bytes:
        wrong.append(f"{n_bytes} raw bytes were received and {run.n_raw_bytes} are there")
    return Check(
        "counts",
        not wrong,
        "; ".join(wrong) or f"{n} records, {announced} readings, {n_bytes} raw bytes",
    )


def _time(run: Run) -> Check:
    """Times of each source never decrease in a table; sources are in the order of arrival."""
    back = 0
    for table, rows in run.tables.items():
        if table == "live":
            continue
        order = np.argsort(rows["source"], kind="stable")
        source, t_ns = rows["source"][order], rows["t_ns"][order]
        back += int(np.count_nonzero((source[1:] == source[:-1]) & (t_ns[1:] < t_ns[:-1])))
    return Check("time", not back, f"goes back {back} times" if back else "never goes back")


def _chain(sealing: Sealing) -> Check:
    if sealing.broken_at is not None:
        text = f"broken: frame {sealing.broken_at} is missing"
    elif sealing.chain_alteration:
        text = f"altered: {sealing.chain_alteration}"
    elif sealing.end is None:
        text = f"not sealed, since the run is incomplete: digest so far {sealing.recomputed_digest}"
    else:
        text = (
            f"sealed with {sealing.recomputed_digest}; compare it with the digest that was noted "
            "at the stop (--digest): a valid chain alone proves no author"
        )
    return Check("chain", sealing.holds, text)


def _check_noted_digest(sealing: Sealing, noted: str) -> Check:
    """The only check that detects a forged chain."""
    if not sealing.holds:
        return Check(
            "digest", False, f"the chain does not hold, so it cannot be the run of {noted}"
        )
    if sealing.recomputed_digest != noted:
        return Check(
            "digest", False, f"this is not the run of {noted}, or it was changed and sealed anew"
        )
    return Check(
        "digest", True, "it is the one noted: nothing was changed, left out or added since"
    )
