"""Logs of legitimate networks as records, for `suspicion.py`."""

import os
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from math import cos, radians
from pathlib import Path

import numpy as np
from scipy.signal import find_peaks

from logger.core.cell_names import channel_name
from logger.core.types import CellReading, Fix, Record, Scan, reportable
from postproc.interop.contents import plain_file
from postproc.interop.importing import recognise, scans_of
from postproc.interop.sighting import Sighting

LOGS = Path(
    os.environ.get("CELLWALK_CELLS", Path(__file__).resolve().parents[2] / "shared" / "cells")
)
"""Folder of the logs (*.csv.gz); they are not part of the project."""
_LONGEST_PAUSE_S = 30.0
"""Of a longer gap only this much counts as time in which a rule could have been broken."""
_SETS = ("cork_driving", "cork_static", "india_gsm", "india_umts", "losangeles", "ottawa")
_MEAN_S, _PEAK_DB, _SILENT_DBM, _ONE_PLACE_M = 10.0, 10.0, -125.0, 300.0
_METRES_PER_DEG = 111_320.0
_CODES = 1024
"""More than there are colour codes of a technology."""


@dataclass(frozen=True, slots=True)
class Log:
    """One run: its set, its records in order, and its duration without pauses."""

    name: str
    records: Sequence[Record]
    hours: float

    @property
    def set_name(self) -> str:
        return next((name for name in _SETS if self.name.startswith(name)), "simulated")

    @property
    def by_channel(self) -> "Log":
        """The log with channel and code as the identity of each cell that has no other."""
        records = [
            replace(
                r, value=replace(r.value, readings=tuple(map(_with_channel_name, r.value.readings)))
            )
            if isinstance(r.value, Scan)
            else r
            for r in self.records
        ]
        return Log(f"{self.name} by channel", records, self.hours)


def read_logs(folder: Path = LOGS) -> Iterator[Log]:
    """All logs of a folder, by name."""
    for path in sorted(folder.glob("*.csv.gz")):
        yield read_log(path)


@cache  # 109 logs take a minute, and each number of earlier walks asks for them
def read_log(path: Path) -> Log:
    """One log; rows without a position are left out."""
    with plain_file(path) as plain:
        form = recognise(plain)
        rows = [row for row in form.read(plain) if isinstance(row, Sighting)]
    rows.sort(key=lambda row: row.t_ns)
    records = []
    for scan in scans_of(rows, form):
        t_ns = scan[0].t_ns - rows[0].t_ns
        records.append(Record(t_ns, "import", scan[0].fix))
        readings = tuple(reportable(row.reading) for row in scan)
        records.append(Record(t_ns, "import", Scan(t_ns, readings)))
    return Log(path.name.removesuffix(".csv.gz"), records, hours_of(records))


def _with_channel_name(reading: CellReading) -> CellReading:
    if reading.cell is not None or reading.arfcn is None or reading.pci is None:
        return reading
    name, cid = channel_name(reading), reading.arfcn * _CODES + reading.pci
    return replace(reading, label=name, cid=cid)


def cells_with_one_peak(log: Log) -> set[str]:
    """Cells whose level rises and falls once, or at one place: the others may be two of one code.

    A peak is 10 dB above the levels on both sides, in means over 10 s.
    """
    heard: dict[str, list[tuple[float, float, float, float]]] = defaultdict(list)
    east_m = north_m = 0.0
    for record in log.records:
        if isinstance(record.value, Fix):
            lat_deg, lon_deg = record.value.lat_deg or 0.0, record.value.lon_deg or 0.0
            north_m = lat_deg * _METRES_PER_DEG
            east_m = lon_deg * _METRES_PER_DEG * cos(radians(lat_deg))
        elif isinstance(record.value, Scan):
            for reading in record.value.readings:
                if reading.cell and reading.level_dbm is not None:
                    level = record.t_ns / 1e9, east_m, north_m, reading.level_dbm
                    heard[reading.cell].append(level)
    return {cell for cell, levels in heard.items() if _has_one_peak(np.array(levels))}


def _has_one_peak(levels: np.ndarray) -> bool:
    """By time in s, east and north in m, and level in dBm; shape (n, 4)."""
    interval = (levels[:, 0] // _MEAN_S).astype(int)
    means = np.full((int(np.ptp(interval)) + 3, 3), (np.nan, np.nan, _SILENT_DBM))
    for k in np.unique(interval):
        means[k - interval.min() + 1] = levels[interval == k, 1:].mean(axis=0)
    peaks, _ = find_peaks(means[:, 2], prominence=_PEAK_DB)
    best = means[np.argmax(means[:, 2]), :2]
    return all(float(np.hypot(*(means[k, :2] - best))) < _ONE_PLACE_M for k in peaks)


def hours_of(records: Sequence[Record]) -> float:
    """Duration without pauses."""
    t_s = [record.t_ns / 1e9 for record in records]
    return sum(min(b - a, _LONGEST_PAUSE_S) for a, b in pairwise(t_s)) / 3600.0
