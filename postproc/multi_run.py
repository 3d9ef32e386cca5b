"""Several runs as one walk: one UTM zone, one series of readings per cell, an offset per modem.

Each track is smoothed alone and put into the UTM zone of the first. The difference between the
levels of two modems is unknown (`logger.core.locator.offsets`), unless two runs name the same
modem.
"""

import tomllib
from collections import Counter
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations
from math import inf
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from logger.baseline_store import is_same_walk, marks_of, walk_digest
from logger.core.arrays import IntArray
from logger.core.errors import ConfigError
from logger.core.locator.posterior import Posterior
from logger.core.locator.preparation import MOST_MODEMS, of_most_heard_modems
from logger.core.places import Utm, join_places
from logger.core.readings import Observations, Readings
from logger.core.rows import Rows, levels_dbm
from logger.core.runfile import Run
from logger.core.runfile.meta import is_import, may_be_copy
from logger.core.source_tables import MODEM, source_tables
from logger.core.timebase import fit_run
from postproc.ground import check_one_place
from postproc.result import ObservedRun, RunShare

Parts = Mapping[int, Readings]
"""Readings of one cell by index of the run."""


def named_apart(runs: Sequence[Run]) -> list[Run]:
    """The runs; files of one name are named with their folders.

    Raises `ConfigError` where two of the files are one run.
    """
    check_different(runs)
    parts = [run.path.absolute().parts for run in runs]
    depth = [1] * len(runs)
    while True:
        names = ["/".join(own[-n:]) for own, n in zip(parts, depth, strict=True)]
        counts = Counter(names)
        longer = [
            n + (counts[name] > 1 and n < len(own))
            for name, own, n in zip(names, parts, depth, strict=True)
        ]
        if longer == depth:
            apart = zip(runs, names, depth, strict=True)
            return [replace(run, shown_as=name) if n > 1 else run for run, name, n in apart]
        depth = longer


def check_different(runs: Sequence[Run]) -> None:
    """Raise `ConfigError` where two files are one run, imports of one log, or a copy."""
    known: dict[str, Run] = {}
    for run in runs:
        names = [run.meta.run_id]
        if is_import(run.meta.origin) and len(run.tables["readings"]):
            names.append(walk_digest(run))
        if same := [known[name] for name in names if name in known]:
            raise ConfigError(f"{same[0].path} and {run.path} are the same run: each counts once")
        known |= dict.fromkeys(names, run)
    marks = cache(lambda k: marks_of(runs[k]))
    for (i, run), (k, other) in combinations(enumerate(runs), 2):
        is_copy = may_be_copy(run.meta.origin) or may_be_copy(other.meta.origin)
        is_same = is_copy and is_same_walk(marks(i), marks(k))
        if is_same or _n_common(run, other) >= _FEWEST_COMMON:
            raise ConfigError(
                f"{run.path} and {other.path} are of one walk, and each reading counts once: "
                "leave out one of them"
            )


_FEWEST_COMMON = 10  # readings: fewer that count twice make no region noticeably smaller


def _n_common(run: Run, other: Run) -> int:
    """Readings that are in both, if most are where fixes are in both."""
    # a copy to share, or an import of a part, has another number and zero of time, and the same
    # fixes by UTC and position; modems that share a receiver have few levels in common
    fixes, others = (
        of.tables["fixes"][np.isfinite(of.tables["fixes"]["lat_deg"])] for of in (run, other)
    )
    if not len(fixes) or not len(others):
        return 0
    utc_ns, others_ns = fixes["utc_ns"], others["utc_ns"]
    if np.max(utc_ns) < np.min(others_ns) or np.max(others_ns) < np.min(utc_ns):
        return 0
    at, at_others = (
        _bits(one["utc_ns"], one["lat_deg"], one["lon_deg"]) for one in (fixes, others)
    )
    _, here, there = np.intersect1d(at, at_others, return_indices=True)
    if not len(here):
        return 0
    common_ns = fixes["t_ns"][here]
    later_ns, counts = np.unique(others["t_ns"][there] - common_ns, return_counts=True)
    own, of_other = (
        _heard(one.tables["readings"], by_ns, int(np.min(common_ns)), int(np.max(common_ns)))
        for one, by_ns in ((run, 0), (other, int(later_ns[np.argmax(counts)])))
    )
    n = len(np.intersect1d(own, of_other))
    return n if n > 0.5 * min(len(own), len(of_other)) else 0


def _heard(readings: Rows, later_ns: int, first_ns: int, last_ns: int) -> npt.NDArray[np.void]:
    """Time, level, channel and cell of each, by a clock that is so much later."""
    t_ns, level_dbm = readings["t_ns"] - later_ns, levels_dbm(readings)
    is_between = (t_ns >= first_ns) & (t_ns <= last_ns) & np.isfinite(level_dbm)
    return np.unique(_bits(t_ns, level_dbm, readings["arfcn"], readings["cid"])[is_between])


def _bits(*columns: npt.NDArray[Any]) -> npt.NDArray[np.void]:
    """Equal where all columns are."""
    whole = [
        np.ascontiguousarray(one).view(np.int64) if one.dtype.kind == "f" else one.astype(np.int64)
        for one in columns
    ]
    return np.column_stack(whole).view(f"V{8 * len(whole)}").ravel()


def in_one_zone(runs: Sequence[ObservedRun]) -> tuple[ObservedRun, ...]:
    """The runs in the UTM zone of the one that began first.

    Raises `GeoError` for runs of several places.
    """
    check_one_place([run.run for run in runs])
    placed = [(run.run, run.observations) for run in runs if run.observations]
    if not placed:
        return tuple(runs)
    _, first = min(placed, key=lambda one: (_began_utc_ns(one[0]) or inf, one[0].digest))
    utm = first.track.utm
    return tuple(
        replace(run, observations=run.observations and _observations_in(run.observations, utm))
        for run in runs
    )


def parts_by_cell(runs: Sequence[ObservedRun], cells: Collection[str]) -> dict[str, Parts]:
    """Readings of each of the `cells` that has any with a position, by index of the run."""
    parts: dict[str, dict[int, Readings]] = {}
    for i, run in enumerate(runs):
        for obs in run.observations.cells if run.observations else ():
            if obs.cell in cells:
                parts.setdefault(obs.cell, {})[i] = obs
    every = [run.run for run in runs]
    began_ns = [_began_utc_ns(run) if len(every) > 1 else None for run in every]
    when = dict(enumerate(zip(modems_of(every), began_ns, strict=True)))
    return {cell: in_order(of_runs, when) for cell, of_runs in parts.items()}


def _began_utc_ns(run: Run) -> int | None:
    clock = fit_run(run.meta.origin, run.tables["fixes"])
    return clock.utc_ns(run.meta.started_ns) if clock else None


Key = TypeVar("Key")


def in_order(
    parts: Mapping[Key, Readings], when: Mapping[Key, tuple[Hashable, int | None]]
) -> dict[Key, Readings]:
    """The parts of a cell, numbered: of one modem in time order, else that with most levels first.

    `when` has modem and UTC of each run. The first of several modems gives the scale, and readings
    at the limits of the others are as vague as their offsets.
    """
    modems, began_ns = zip(*(when[key] for key in parts), strict=True) if parts else ((), ())
    is_one_modem = len(set(modems)) == 1 and all(obs.modem is None for obs in parts.values())
    by_scale = _scale_first(parts)
    in_time = by_scale
    if None not in began_ns:
        in_time = dict(sorted(by_scale.items(), key=lambda part: when[part[0]][1] or 0))
    number = {key: n for n, key in enumerate(in_time)}
    return {
        key: replace(obs, run=np.full(len(obs), number[key]))
        for key, obs in (in_time if is_one_modem else by_scale).items()
    }


def _scale_first(parts: Mapping[Key, Readings]) -> dict[Key, Readings]:
    def rank(part: tuple[Key, Readings]) -> tuple[int, float]:
        obs = part[1]
        return -int(np.count_nonzero(obs.limit == 0)), -float(np.sum(obs.level_dbm))

    return dict(sorted(parts.items(), key=rank))


def modems_of(runs: Sequence[Run]) -> list[int]:
    """Number of each run's modem; two runs have the same only if both certainly name the same."""
    known: dict[Hashable, int] = {}
    return [known.setdefault(modem_identity(run) or i, len(known)) for i, run in enumerate(runs)]


def parts_of_most_heard_modems(parts: Parts, modems: Sequence[int]) -> Parts:
    """The readings of the modems that the locator takes."""
    numbers = _modem_numbers(parts, modems)
    if len(np.unique(np.concatenate(numbers))) <= MOST_MODEMS:
        return parts
    most_heard = of_most_heard_modems(merge(parts, modems)).modem
    assert most_heard is not None  # of many modems
    chosen = zip(parts.items(), numbers, strict=True)
    return {i: part for (i, part), number in chosen if np.any(np.isin(number, most_heard))}


def merge(parts: Parts, modems: Sequence[int]) -> Readings:
    """Readings of a cell, run after run, those of each in time order.

    `modems` has the number of the modem of each run, or of all its modems.
    """
    series = list(parts.values())
    numbers = np.concatenate(_modem_numbers(parts, modems))
    modem = numbers if np.any(numbers) else None
    rat = next((obs.rat for obs in series if obs.rat), None)
    advances = [np.full(len(obs), -1) if obs.ta is None else obs.ta for obs in series]
    ta = None if all(obs.ta is None for obs in series) else np.concatenate(advances)
    shares = [np.ones(len(o)) if o.named_share is None else o.named_share for o in series]
    numbered = [obs.run for obs in series if obs.run is not None]
    is_unknown = all(obs.named_share is None for obs in series)
    named_share = None if is_unknown else np.concatenate(shares)
    return replace(
        series[0],
        rat=rat,
        places=join_places([obs.places for obs in series]),
        level_dbm=np.concatenate([obs.level_dbm for obs in series]),
        scan_seq=np.concatenate([obs.scan_seq for obs in series]),
        modem=modem,
        ta=ta,
        named_share=named_share,
        is_timed=len(series) == 1 and series[0].is_timed,
        run=np.concatenate(numbered) if len(numbered) == len(series) else None,
    )


def shares_of(
    parts: Parts, modems: Sequence[int], posterior: Posterior | None
) -> tuple[RunShare, ...]:
    """What each modem of each run contributes to a cell, in the order of `parts`."""
    offsets = posterior.offsets if posterior else None

    def share(run: int, n: int, modem: int) -> RunShare:
        if modem == 0:
            return RunShare(run, n, 0.0, 0.0)
        if offsets is None or modem >= len(offsets.mean_db):
            return RunShare(run, n, None, None)
        return RunShare(run, n, float(offsets.mean_db[modem]), float(offsets.sigma_db[modem]))

    shares = []
    for run, of_readings in zip(parts, _modem_numbers(parts, modems), strict=True):
        numbers, counts = np.unique(of_readings, return_counts=True)
        pairs = zip(numbers.tolist(), counts.tolist(), strict=True)
        shares += [share(run, n, modem) for modem, n in pairs]
    return tuple(shares)


def _modem_numbers(parts: Parts, modems: Sequence[int]) -> list[IntArray]:
    """Number of the modem of each reading, from 0 in the order of appearance, for each part."""
    known: dict[tuple[int, int], int] = {}
    numbers = []
    for i, obs in parts.items():
        different, first, which = np.unique(
            obs.modem_numbers, return_index=True, return_inverse=True
        )
        for k in np.argsort(first).tolist():
            known.setdefault((modems[i], int(different[k])), len(known))
        of_different = [known[modems[i], int(one)] for one in different]
        numbers.append(np.array(of_different, np.int64)[which])
    return numbers


def of_one_modem(observations: Observations) -> Observations:
    """Of each technology the readings of the modem with most."""
    counts: dict[str | None, Counter[int]] = {}
    for obs in observations.cells:
        counts.setdefault(obs.rat, Counter()).update(obs.modem_numbers.tolist())
    cells = []
    for obs in observations.cells:
        (modem, _), *_ = counts[obs.rat].most_common()
        is_kept = obs.modem_numbers == modem
        if obs.modem is None:
            cells.append(obs)
        elif np.any(is_kept):
            cells.append(replace(obs.part(is_kept), modem=None))
    return replace(observations, cells=tuple(cells))


def with_one_modem(run: Run) -> Run:
    """A run without the scans of other modems than the one with most readings."""
    sources, numbers = np.unique(run.tables["readings"]["source"], return_inverse=True)
    if len(sources) < 2:
        return run
    modem = sources[np.argmax(np.bincount(numbers))]
    kept = {
        name: rows[rows["source"] == modem]
        for name, rows in run.tables.items()
        if name in {"scans", "readings", "broadcasts"} and len(rows)
    }
    return replace(run, tables=run.tables | kept)


def modem_identity(run: Run) -> Hashable | None:
    """Identity of a run's modem: its port, with the boot where the port has no serial number.

    Several modems have all of theirs with their names. None where the run names none.
    """
    try:
        tables = source_tables(tomllib.loads(run.meta.config_text))
    except tomllib.TOMLDecodeError:
        return None
    modems = [one for one in tables if isinstance(one, dict) and one.get("kind") == MODEM]
    if not modems or not all("port" in one for one in modems):
        return None
    ports, drivers = [str(one["port"]) for one in modems], [one.get("driver") for one in modems]
    names = [str(one["name"]) for one in modems] if len(modems) > 1 else []
    identity = (*ports, *drivers, *names)
    if all("/by-id/" in port for port in ports):
        return identity
    return (*identity, run.meta.boot_id) if run.meta.boot_id else None


def _observations_in(observations: Observations, utm: Utm) -> Observations:
    moved = observations.each(lambda obs: replace(obs, places=obs.places.in_zone(utm)))
    return replace(moved, track=observations.track.in_zone(utm))
