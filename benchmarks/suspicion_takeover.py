"""A channel that is taken over beside a receiver that stands, for `suspicion.py`.

The scans are replies of real modems (../shared/corpus/modem; CELLWALK_CORPUS names another folder)
that identify five cells or more, heard again and again with 2 dB of fading. Then one of their
channels has another transmitter, 40 dB stronger at most, with the identity of the cell that was
there or with another one of its network and area. Beside each such run stands one without it.
"""

import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from logger.core.suspicion.rule import Word
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.types import CellReading, Fix, Record, Scan
from postproc.interop.sighting import with_name

CORPUS = Path(
    os.environ.get("CELLWALK_CORPUS", Path(__file__).resolve().parents[2] / "shared" / "corpus")
)
PERIODS_S = (10.0, 30.0, 60.0)
"""A modem that names all cells takes half a minute or more."""
_FADING_DB = 2.0
_BEFORE = 10
"""Scans before; a receiver that stands for less knows little of its place."""
_LATEST_S, _LATEST_SCANS = 60.0, 3
_ABOVE_DB, _STRONGEST_DBM = 40.0, -48.0
_LEAST_DB = 25.0
_FEWEST_CELLS = 5
_WHERE = {"310": (34.05, -118.24), "404": (23.0, 72.6), "250": (55.75, 37.6)}
_GRAZ = (47.07, 15.44)
"""Of replies without a country."""
_NUMBERS = (
    *("role", "rat", "mcc", "mnc", "lac", "cid", "arfcn", "bsic", "rxlev_raw", "rssi_dbm"),
)  # fmt: skip
_OTHER_BSIC = 55


class Takeover(NamedTuple):
    """The word of the cell in time, and the worst of all cells without a takeover."""

    period_s: float
    is_same: bool
    in_time: Word
    clean: Word


def full_scans(corpus: Path = CORPUS) -> list[tuple[CellReading, ...]]:
    """Replies that identify enough cells of GSM, as readings."""
    scans = []
    for entry in json.loads((corpus / "modem" / "expected.json").read_text("utf-8")):
        cells = [_reading(row) for row in entry["expected"]]
        named = tuple({cell.cell: cell for cell in cells if cell and cell.level_dbm}.values())
        if len(named) >= _FEWEST_CELLS:
            scans.append(named)
    return scans


def _reading(row: dict[str, Any]) -> CellReading | None:
    """A row that has an identity."""
    if row.get("rat") != "GSM" or not row.get("cid") or not row.get("lac"):
        return None
    if row.get("rxlev_raw") is None and row.get("rssi_dbm") is None:
        return None
    values = {name: row[name] for name in _NUMBERS if name in row} | {"role": "scan"}
    return with_name(CellReading(**values))


def takeovers(scans: list[tuple[CellReading, ...]]) -> Iterator[Takeover]:
    """One run for each cell that is weak enough, each period, and each identity."""
    for place, cells in enumerate(scans):
        for k, cell in enumerate(cells):
            if cell.level_dbm is None or cell.level_dbm > _STRONGEST_DBM - _LEAST_DB:
                continue
            level_dbm = min(cell.level_dbm + _ABOVE_DB, _STRONGEST_DBM)
            taken = replace(cell, rxlev_raw=None, rssi_dbm=level_dbm)
            other = replace(taken, cid=4711, bsic=_OTHER_BSIC, label=None)
            for period_s in PERIODS_S:
                for is_same in (True, False):
                    rogue = taken if is_same else with_name(other)
                    rng = np.random.default_rng([place, k, int(period_s), is_same])
                    name = rogue.cell or ""
                    n_after = max(_LATEST_SCANS, int(_LATEST_S // period_s))
                    after = [*cells[:k], rogue, *cells[k + 1 :]]
                    heard = (
                        _tracker_after(period_s, rng, cells, after, n_after).assessment(name).word
                    )
                    clean = _tracker_after(period_s, rng, cells, list(cells), n_after).conspicuous()
                    worst: Word = clean[0].word if clean else "nothing unusual"
                    yield Takeover(period_s, is_same, heard, worst)


def _tracker_after(
    period_s: float,
    rng: np.random.Generator,
    before: tuple[CellReading, ...],
    after: list[CellReading],
    n_after: int,
) -> SuspicionTracker:
    """The tracker after the scans before and those after."""
    tracker = SuspicionTracker()
    lat_deg, lon_deg = _WHERE.get(before[0].mcc or "", _GRAZ)
    fix = Fix(True, lat_deg=lat_deg, lon_deg=lon_deg)
    for i in range(_BEFORE + n_after):
        t_ns = round(i * period_s * 1e9)
        cells = before if i < _BEFORE else after
        heard = tuple(_with_fading(cell, rng) for cell in cells)
        tracker.feed(Record(t_ns, "gnss", fix))
        tracker.feed(Record(t_ns, "modem", Scan(t_ns, heard)))
    return tracker


def _with_fading(cell: CellReading, rng: np.random.Generator) -> CellReading:
    level_dbm = round((cell.level_dbm or 0.0) + rng.normal(0.0, _FADING_DB))
    return replace(cell, rxlev_raw=None, rssi_dbm=float(level_dbm))


def print_takeovers(results: list[Takeover]) -> None:
    """Shares of runs with a word in time, by period and identity."""
    print("takeover      scan every   runs  suspicious  unusual  words without it")
    for period_s in PERIODS_S:
        for is_same in (True, False):
            runs = [r for r in results if (r.period_s, r.is_same) == (period_s, is_same)]
            if not runs:
                continue
            suspicious = sum(r.in_time == "suspicious" for r in runs) / len(runs)
            unusual = sum(r.in_time != "nothing unusual" for r in runs) / len(runs)
            wrong = sum(r.clean != "nothing unusual" for r in runs)
            name = "same identity" if is_same else "new identity"
            print(f"{name:13} {period_s:6.0f} s  {len(runs):7}  {suspicious:10.2f}  {unusual:7.2f}"
                  f"  {wrong}")  # fmt: skip
