"""A run in the format of another program.

The file does not identify the walker or the hardware: no configuration, names or notes.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from logger.core.answer import Answer
from logger.core.arrays import IntArray
from logger.core.document import number_of
from logger.core.errors import ConfigError, RunFileError
from logger.core.locator.region import HALF, LEVEL
from logger.core.places import MAX_GAP_S, SIGMA_OF_RADIUS68
from logger.core.readings import Observations, observe
from logger.core.rows import levels_dbm, values_of
from logger.core.runfile import Run
from logger.core.runfile.run import reading_of
from logger.core.suspicion.words import strongest_reasons
from logger.core.timebase import utc_clock, why_unknown
from logger.core.types import Fix
from postproc.atomic_write import whole_file
from postproc.cell_work import Failure, attempt
from postproc.interop import writers
from postproc.interop.sighting import Sighting
from postproc.outlines import Rings, polygons
from postproc.result import ESTIMATORS, CellResult, Result, answer_table, region_of

_DEGREE_DECIMALS = 8
"""A millimetre."""

Regions = Mapping[int, list[Rings]]
"""Outlines of the regions of a cell by their percentage."""
Answered = tuple[Answer, Regions]
_LEVELS = {95: LEVEL, 50: HALF}

Clock = Callable[[int], int | None]
Stretch = tuple[tuple[int, Fix], ...]


@dataclass(frozen=True, slots=True)
class ExportWalk:
    """Levels in time order, and the track, divided where the receiver was silent for long.

    `n_without_..` count readings that are left out. Seconds count from `start_ns`, the time of the
    first level. `no_utc` is why UTC is unknown, empty where it is known.
    """

    sightings: tuple[Sighting, ...]
    track: tuple[Stretch, ...]
    start_ns: int
    no_utc: str = ""
    n_without_identity: int = 0
    n_without_level: int = 0
    n_without_position: int = 0

    @property
    def has_utc(self) -> bool:
        """Whether levels and track have times in UTC."""
        return not self.no_utc


def walk_of_run(run: Run, only: Sequence[str] | None = None) -> ExportWalk:
    """Levels of all cells of a run, or of those named; raises `EstimationError` without a fix."""
    readings, fixes = run.named_readings, run.tables["fixes"]
    observed = observe(fixes, run.tables["scans"], readings)
    clock = utc_clock(run.meta.origin, fixes)
    track = _track(run, clock)
    named = readings["cell"] != b""
    if only is not None:
        named &= np.isin(readings["cell"], [name.encode() for name in only])
    wanted = named & np.isfinite(levels_dbm(readings))
    sightings = _sightings(
        run, observed, wanted, [entry for stretch in track for entry in stretch], clock
    )
    return ExportWalk(
        sightings=tuple(sightings),
        track=track,
        start_ns=sightings[0].t_ns if sightings else track[0][0][0],
        no_utc=why_unknown(run.meta.origin, fixes, run.tables["notes"])
        if track[0][0][1].utc_ns is None
        else "",
        n_without_identity=int(np.count_nonzero(readings["cell"] == b"")) if only is None else 0,
        n_without_level=int(np.count_nonzero(named & ~wanted)),
        n_without_position=int(np.count_nonzero(wanted)) - len(sightings),
    )


def _track(run: Run, clock: Clock) -> tuple[Stretch, ...]:
    stretches: list[list[tuple[int, Fix]]] = []
    last_ns: int | None = None
    fixes = [
        (r.t_ns, r.value)
        for _, r in run.records("fixes")
        if isinstance(r.value, Fix) and _has_position(r.value)
    ]
    for t_ns, fix in sorted(fixes, key=lambda entry: entry[0]):
        if last_ns is None or t_ns - last_ns > MAX_GAP_S * 1e9:
            stretches.append([])
        stretches[-1].append((t_ns, replace(fix, utc_ns=clock(t_ns))))
        last_ns = t_ns
    return tuple(map(tuple, stretches))


def _has_position(fix: Fix) -> bool:
    return fix.valid and fix.lat_deg is not None and fix.lon_deg is not None


def _sightings(
    run: Run, observed: Observations, wanted: npt.NDArray[np.bool_],
    track: Sequence[tuple[int, Fix]], clock: Clock,
) -> list[Sighting]:  # fmt: skip
    seq = _all(observed, "scan_seq")
    scans, first = np.unique(seq, return_index=True)
    t_ns = _all(observed, "t_ns")[first]
    x_m, y_m, sigma_m = (_all(observed, name)[first] for name in ("x_m", "y_m", "position_sigma_m"))
    lat_deg, lon_deg = (
        np.round(v, _DEGREE_DECIMALS) for v in observed.track.utm.to_latlon_arrays(x_m, y_m)
    )
    near = _nearest(np.array([t for t, _ in track]), t_ns)
    fixes: dict[int, tuple[int, Fix]] = {}
    for i, scan in enumerate(scans.tolist()):
        nearest, at_ns = track[near[i]][1], int(t_ns[i])
        accurate = nearest.acc_m is not None or nearest.hdop is not None
        fixes[scan] = (
            at_ns,
            Fix(
                valid=True,
                utc_ns=clock(at_ns),
                lat_deg=float(lat_deg[i]),
                lon_deg=float(lon_deg[i]),
                alt_m=nearest.alt_m,
                acc_m=round(float(sigma_m[i]) / SIGMA_OF_RADIUS68, 3) if accurate else None,
                speed_mps=nearest.speed_mps,
                course_deg=nearest.course_deg,
            ),
        )
    rows = run.named_readings
    chosen = wanted & np.isin(rows["seq"], scans)
    in_scan = (np.arange(len(rows)) - np.searchsorted(rows["seq"], rows["seq"]))[chosen].tolist()
    broadcasts = run.broadcasts()
    sightings = [
        Sighting(row["seq"], *fixes[row["seq"]], reading_of(row, broadcasts.get((row["seq"], i))))
        for row, i in zip(values_of("readings", rows[chosen]), in_scan, strict=True)
    ]
    return sorted(sightings, key=lambda sighting: sighting.t_ns)


def _all(observed: Observations, name: str) -> npt.NDArray[Any]:
    arrays = [getattr(cell, name) for cell in observed.cells]
    return np.concatenate(arrays) if arrays else np.empty(0, np.int64)


def _nearest(fix_ns: IntArray, t_ns: IntArray) -> IntArray:
    after = np.clip(np.searchsorted(fix_ns, t_ns), 1, max(len(fix_ns) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(fix_ns) - 1)
    return np.where(t_ns - fix_ns[before] <= fix_ns[after] - t_ns, before, after)


@dataclass(frozen=True, slots=True)
class Exported:
    """What an export did; `left_out` lists what the file does not contain."""

    path: Path
    format: str
    n_levels: int
    n_fixes: int
    n_estimates: int
    has_utc: bool
    left_out: tuple[str, ...]


def writer(name: str) -> ModuleType:
    """The module of a format."""
    return import_module(f"{writers.__name__}.{name.replace('-', '_')}")


def has_answers(name: str) -> bool:
    """Whether a format has a place for cells."""
    return hasattr(writer(name), "write_answers")


def formats_with_answers() -> list[str]:
    found = []
    for name in writers.names():
        with suppress(ModuleNotFoundError):  # parquet: pyarrow comes with rerun, or is missing
            if has_answers(name):
                found.append(name)
    return found


def format_of(name: str | None, target: Path, *, with_estimates: bool = False) -> str:
    """Name of the format, by default that of the suffix.

    Raises `ConfigError` for an unknown one, and for one without estimates if those are wanted.
    """
    known = writers.names()
    if name is None:
        name = target.suffix[1:].lower()
        if name not in known:
            raise ConfigError(
                f"{target}: name a format with --format ({', '.join(known)}), or end in one of them"
            )
    if name not in known:
        raise ConfigError(f"format {name!r} is unknown: one of {', '.join(known)}")
    if with_estimates and not has_answers(name):
        able = ", ".join(formats_with_answers())
        raise ConfigError(f"{name} contains measurements only; {able} can contain estimates")
    return name


def write_walk(walk: ExportWalk, target: Path, name: str) -> Exported:
    """Write levels and track, complete or not at all.

    Raises `RunFileError` where the format can represent none of the levels.
    """
    form = writer(name)
    writable = getattr(form, "writable", None)
    sightings = [s for s in walk.sightings if writable is None or writable(s)]
    if writable is not None and not sightings:
        why = ": no level has the complete identity of a cell" if walk.sightings else ""
        if walk.no_utc:
            why = f": the format needs UTC, and {walk.no_utc}"
        raise RunFileError(f"nothing in the run can be written as {name}{why}")
    with whole_file(target) as part:
        form.write(replace(walk, sightings=tuple(sightings)), part)
    has_levels = getattr(form, "HAS_LEVELS", True)
    n_levels, n_fixes = len(sightings) * has_levels, sum(map(len, walk.track))
    left_out = _omissions(walk, n_levels) if has_levels else [f"all levels: {name} has none"]
    left_out += [f"times in UTC: {walk.no_utc}"] if walk.no_utc else []
    return Exported(target, name, n_levels, n_fixes, 0, walk.has_utc, tuple(left_out))


def write_answers(
    results: Sequence[Result], target: Path, name: str, *, every: bool = False
) -> tuple[Exported, list[Answer]]:
    """Write a row or feature for each cell, complete or not at all; returns what was written.

    `every` adds columns with the positions of the other estimators.
    """
    form = writer(name)
    has_regions = getattr(form, "HAS_REGIONS", False)
    exported = [
        _as_exported(result, cell, has_regions) for result in results for cell in result.cells
    ]
    answers = [answer for answer, _ in exported]
    with whole_file(target) as part:
        form.write_answers(exported, answer_table(answers, every=every), part)
    left_out = [
        f"the answer about {answer.cell}: {answer.reasons[0]}"
        for answer in answers
        if answer.provenance.error
    ]
    left_out += [
        f"{estimator.name} of {answer.cell}: it did not converge"
        for answer in answers
        for estimator in ESTIMATORS
        if every and answer.paths and estimator.key in answer.paths.failed
    ]
    has_utc = any(answer.provenance.first_utc_ns is not None for answer in answers)
    return Exported(target, name, 0, 0, len(answers), has_utc, tuple(left_out)), answers


def _as_exported(result: Result, cell: CellResult, has_regions: bool) -> Answered:
    def with_regions() -> Answered:
        regions = {}
        for percent, level in _LEVELS.items() if has_regions else ():
            if outline := region_of(cell, level).geojson:
                regions[percent] = polygons(outline.coordinates)
        return result.answer(cell), regions

    found = attempt(cell.cell, "its export", with_regions)
    return (result.answer(cell.after(found)), {}) if isinstance(found, Failure) else found


def title_of(answer: Answer) -> str:
    """The cell, and its word where it is conspicuous."""
    if answer.word is None or not answer.is_conspicuous:
        return answer.cell
    return f"{answer.cell}: {answer.word.word}"


def says_of(answer: Answer) -> str:
    """The answer in a sentence, and why the cell is conspicuous."""
    why = strongest_reasons(answer.word) if answer.word and answer.is_conspicuous else []
    return "; ".join([answer.sentence, *why])


def _omissions(walk: ExportWalk, n_written: int) -> list[str]:
    counts = {
        "without a complete identity, which the format needs": len(walk.sightings) - n_written,
        "of cells without an identity": walk.n_without_identity,
        "without a level": walk.n_without_level,
        "without a fix near in time": walk.n_without_position,
    }
    return [f"{number_of(n, 'reading')} {what}" for what, n in counts.items() if n]
