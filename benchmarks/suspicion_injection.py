"""One rogue station put into a clean run: which rule names it, and how soon.

The station stands beside the track ahead of the place where the walker is when it is switched on;
where the walker stands, it is as far away. "strong" gives -50 dBm at 30 m, "weak" -85 dBm at its
closest. Levels follow a path loss exponent of 3.2 with 6 dB of shadowing over 40 m and 2 dB of
fading. The modem serves the station where it is 4 dB stronger than the serving cell, or from
-95 dBm on if it broadcasts a reselection offset of 60 dB or takes over from another technology;
where it is weaker it is reported as a neighbour, if the log has neighbours.
"""

import sys
from collections.abc import Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial
from math import cos, hypot, inf, log10, radians
from typing import NamedTuple

import numpy as np

from benchmarks.suspicion_logs import Log
from benchmarks.suspicion_patterns import COPIES, KINDS, pattern_of
from logger.core import answer
from logger.core.baseline import NO_BASELINE, Baseline
from logger.core.suspicion.rule import Rule, Word
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.types import CellReading, Fix, Record, Scan
from logger.sim.world import Shadowing

WITHIN_M, WITHIN_S = 200.0, 180.0
"""Walking and time after the station is heard first within which it should be named."""
_ETA = 3.2
_NEAR_M = 30.0
_HEARD_DBM = -105.0
_HYSTERESIS_DB = 4.0
_OFFSET_DBM = -95.0
_PASSED_DBM = -65.0
"""Level of an original that the walk has passed: within some 100 m of a station in a street."""
_APART_M = 1000.0
_METRES_PER_DEG = 111_320.0
_SAME = [
    one
    for name, module in sys.modules.items()
    if name.startswith("logger.core.suspicion.")
    for one in vars(module).values()
    if isinstance(one, Rule | partial)
]
"""What trackers compare by identity: a copy of one has the same."""


class Station(NamedTuple):
    """A kind of station, and how long it is on the air."""

    kind: str
    is_strong: bool
    on_air_s: float = inf


@dataclass(frozen=True, slots=True)
class Injection:
    """A run with one station: its name, and the number of the record that has it first.

    `is_passed`: a clone whose original the walk has passed as well.
    """

    station: Station
    cell: str
    records: Sequence[Record]
    first: int
    is_passed: bool


@dataclass(frozen=True, slots=True)
class Outcome:
    """The word of the station within the limits, all at the end, and when it was suspicious."""

    station: Station
    in_time: Word
    at_end: answer.Word
    seconds: float | None
    metres: float | None
    set_name: str
    is_passed: bool


def inject(log: Log, station: Station) -> Injection | None:
    """Put a station into a run; None where the run has no room or no cell for this kind."""
    kind, strong, on_air_s = station
    rng = np.random.default_rng([0, KINDS.index(kind), strong])
    track = _track(log.records)
    if track is None or track[-1, 0] - track[0, 0] < 2.5 * WITHIN_S:
        return None
    start_s = float(rng.uniform(track[0, 0] + 60.0, track[-1, 0] - 1.5 * WITHIN_S))
    pattern = pattern_of(log.records, kind, track)
    if pattern is None:
        return None
    if kind in COPIES:
        place = _away_from(track, pattern.place, rng)
        start_s = float(track[0, 0])
    else:
        place = _ahead(track, start_s, rng)
    if place is None:
        return None
    closest_m = float(np.min(np.hypot(track[:, 1] - place[0], track[:, 2] - place[1])))
    peak_dbm = -50.0 if strong else -85.0
    level_1m = peak_dbm + 10.0 * _ETA * log10(_NEAR_M if strong else max(closest_m, _NEAR_M))
    air = _Air(level_1m, Shadowing.draw(6.0, 40.0, rng), rng)
    records, first = _with_station(log, kind, pattern.reading, start_s, place, track, air, on_air_s)
    if first is None:
        return None
    is_passed = pattern.best_dbm >= _PASSED_DBM
    return Injection(station, pattern.reading.cell or "", records, first, is_passed)


@dataclass(frozen=True, slots=True)
class _Air:
    p0_dbm: float
    shadowing: Shadowing
    rng: np.random.Generator

    def level_dbm(self, x_m: float, y_m: float, place: tuple[float, float]) -> float:
        d_m = max(hypot(x_m - place[0], y_m - place[1]), 10.0)
        shadow = float(self.shadowing.at_db(np.array(x_m), np.array(y_m)))
        level = self.p0_dbm - 10.0 * _ETA * log10(d_m) + shadow + float(self.rng.normal(0.0, 2.0))
        return float(round(min(level, -40.0)))


def detect(
    injection: Injection,
    set_name: str = "",
    baseline: Baseline = NO_BASELINE,
    before: SuspicionTracker | None = None,
) -> Outcome:
    """Words in time and at the end; `before` was fed until the first reception."""
    tracker = before
    if tracker is None:
        tracker = SuspicionTracker(baseline=baseline)
        for record in injection.records[: injection.first]:
            tracker.feed(record)
    after = injection.records[injection.first :]
    last: tuple[float, float] | None = None
    metres, named_s, named_m = 0.0, None, None
    in_time: Word = "nothing unusual"
    for record in after:
        tracker.feed(record)
        if isinstance(record.value, Fix) and record.value.lat_deg is not None:
            here = record.value.lat_deg, record.value.lon_deg or 0.0
            metres += 0.0 if last is None else _apart_m(last, here)
            last = here
            continue
        seconds = (record.t_ns - after[0].t_ns) / 1e9
        if named_s is None and tracker.assessment(injection.cell).word == "suspicious":
            named_s, named_m = seconds, metres
        if seconds <= WITHIN_S or metres <= WITHIN_M:
            in_time = tracker.assessment(injection.cell).word
    at_end = tracker.assessment(injection.cell)
    is_passed = injection.is_passed
    return Outcome(injection.station, in_time, at_end, named_s, named_m, set_name, is_passed)


def _apart_m(a: tuple[float, float], b: tuple[float, float]) -> float:
    return _METRES_PER_DEG * hypot(a[0] - b[0], (a[1] - b[1]) * cos(radians(a[0])))


def _track(records: Sequence[Record]) -> np.ndarray | None:
    """Time, east and north of each fix, in seconds and metres from the first."""
    fixes = [(r.t_ns / 1e9, r.value.lat_deg, r.value.lon_deg)
             for r in records if isinstance(r.value, Fix) and r.value.valid]  # fmt: skip
    if len(fixes) < 2:
        return None
    t_lat_lon = np.array(fixes, float)
    lat0, lon0 = t_lat_lon[0, 1:]
    return np.column_stack([
        t_lat_lon[:, 0],
        (t_lat_lon[:, 2] - lon0) * _METRES_PER_DEG * cos(radians(lat0)),
        (t_lat_lon[:, 1] - lat0) * _METRES_PER_DEG,
    ])  # fmt: skip


def _ahead(track: np.ndarray, start_s: float, rng: np.random.Generator) -> tuple[float, float]:
    """30 m beside the place where the walker is 100 m or 60 s later."""
    i = int(np.searchsorted(track[:, 0], start_s))
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track[i:, 1:], axis=0).T))])
    k = i + int(np.argmax((way_m >= 100.0) | (track[i:, 0] >= start_s + 60.0)))
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    return (float(track[k, 1] + _NEAR_M * np.cos(angle)),
            float(track[k, 2] + _NEAR_M * np.sin(angle)))  # fmt: skip


def _away_from(
    track: np.ndarray, original: tuple[float, float] | None, rng: np.random.Generator
) -> tuple[float, float] | None:
    """30 m beside a place of the track about a kilometre from the original."""
    if original is None:
        return None
    apart_m = np.hypot(track[:, 1] - original[0], track[:, 2] - original[1])
    there = np.flatnonzero((apart_m >= 0.8 * _APART_M) & (apart_m <= 1.5 * _APART_M))
    if not len(there):
        return None
    k = int(rng.choice(there))
    return float(track[k, 1]) + 20.0, float(track[k, 2]) + 20.0


def _with_station(
    log: Log, kind: str, reading: CellReading, start_s: float, place: tuple[float, float],
    track: np.ndarray, air: _Air, on_air_s: float,
) -> tuple[list[Record], int | None]:  # fmt: skip
    """Records with the station in every scan that hears it, and the first of these."""
    records: list[Record] = []
    first = None
    has_neighbours = any(isinstance(r.value, Scan) and len(r.value.readings) > 1
                         for r in log.records)  # fmt: skip
    held_s = -1e9
    for record in log.records:
        value, t_s = record.value, record.t_ns / 1e9
        is_off = first is not None and t_s > records[first].t_ns / 1e9 + on_air_s
        if isinstance(value, Scan) and t_s >= start_s and not is_off:
            i = min(int(np.searchsorted(track[:, 0], t_s)), len(track) - 1)
            x_m, y_m = track[i, 1:]
            at = _drive(place, t_s - start_s) if kind == "moving" else place
            level_dbm = air.level_dbm(float(x_m), float(y_m), at)
            scan, is_heard = _add_station(
                value, kind, reading, level_dbm, has_neighbours, t_s - held_s
            )
            if is_heard:
                first = len(records) if first is None else first
                held_s = t_s
            records.append(replace(record, value=scan) if is_heard else record)
        else:
            records.append(record)
    return records, first


def _drive(place: tuple[float, float], since_s: float) -> tuple[float, float]:
    """A car that drives 600 m there and back at 4 m/s, again and again."""
    way_m = (4.0 * since_s) % 1200.0
    return place[0] + min(way_m, 1200.0 - way_m), place[1]


def _add_station(
    scan: Scan, kind: str, reading: CellReading, level_dbm: float, has_neighbours: bool,
    since_s: float,
) -> tuple[Scan, bool]:  # fmt: skip
    """The scan with the station, and whether it is in it."""
    others = tuple(r for r in scan.readings if r.cell is None or r.cell != reading.cell)
    original = next((r for r in scan.readings if r.cell == reading.cell), None)
    is_stronger = original is None or original.level_dbm is None or level_dbm > original.level_dbm
    if level_dbm < _HEARD_DBM or not is_stronger:
        return scan, False
    serving = next((r for r in others if r.role == "serving"), None)
    limit_dbm = -200.0 if serving is None or serving.level_dbm is None else (
        serving.level_dbm + (_HYSTERESIS_DB if since_s > 5.0 else -_HYSTERESIS_DB))  # fmt: skip
    attracts = kind in {"new area", "downgrade"} and level_dbm >= _OFFSET_DBM
    is_serving = attracts or (level_dbm >= limit_dbm and kind != "downgrade")
    level = {"GSM": "rssi_dbm", "WCDMA": "rscp_dbm"}.get(reading.rat or "", "rsrp_dbm")
    station = replace(reading, **{level: level_dbm}, role="serving" if is_serving else "neighbour")
    if not is_serving:
        return (
            (replace(scan, readings=(*others, station)), True) if has_neighbours else (scan, False)
        )
    if kind in {"new area", "downgrade", "invented identity"} or not has_neighbours:
        return replace(scan, readings=(station,)), True
    rest = tuple(replace(r, role="neighbour") for r in others)
    return replace(scan, readings=(station, *rest)), True


def outcomes(log: Log, baseline: Baseline, stations: Iterable[Station]) -> Iterator[Outcome]:
    """Outcomes of stations, one at a time; what was before each is followed once."""
    injections = [one for station in stations if (one := inject(log, station)) is not None]
    if baseline.n_walks:  # its squares, which a tracker holds, cannot be copied
        yield from (detect(one, log.set_name, baseline) for one in injections)
        return
    tracker, n_fed = SuspicionTracker(baseline=baseline), 0
    for injection in sorted(injections, key=lambda one: one.first):
        for record in log.records[n_fed : injection.first]:
            tracker.feed(record)
        n_fed = injection.first
        same = {id(one): one for one in (baseline, *_SAME)}
        yield detect(injection, log.set_name, baseline, deepcopy(tracker, same))
