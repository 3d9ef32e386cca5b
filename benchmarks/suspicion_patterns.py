"""What an injected station broadcasts, in the form in which a log prints its cells."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from logger.core.types import CellReading, Record, Scan
from postproc.interop.sighting import reading_of

CLONES = frozenset({"clone on its channel", "clone on another channel"})
COPIES = CLONES | {"perfect copy"}
ORDINARY = "ordinary catcher"
"""The network and an area in use, and an identity that is free."""
KINDS = (
    *("invented identity", "new area", "downgrade", ORDINARY),
    *(*sorted(CLONES), "moving", "perfect copy"),
)
_OFTEN = 20
"""Readings of a cell that can be copied."""


class Pattern(NamedTuple):
    """The station's reading without a level; where its original was strongest, and how strong."""

    reading: CellReading
    place: tuple[float, float] | None = None
    best_dbm: float = -200.0


def pattern_of(records: Sequence[Record], kind: str, track: np.ndarray) -> Pattern | None:
    """What the station broadcasts, in the form of this log; None where it cannot be printed."""
    scans = [(record.t_ns / 1e9, record.value) for record in records]
    serving = [
        (t_s, reading)
        for t_s, scan in scans
        if isinstance(scan, Scan)
        for reading in scan.readings
        if reading.cell and reading.role == "serving"
    ]
    if not serving:
        return None
    if kind in COPIES:
        return _clone(serving, kind, track)
    n_of = Counter(reading.rat for _, reading in serving[::50])
    model = max((reading for _, reading in serving), key=lambda reading: n_of[reading.rat])
    area = model.lac or model.tac
    is_2g = kind == "downgrade" and model.rat == "GSM"
    if is_2g or model.mcc is None or area is None:
        return None  # the log prints no plan or area that the station could break
    if kind == "downgrade":
        model = replace(model, rat="GSM", arfcn=63)
    identity = {
        "invented identity": ("001", 1, 10),
        "new area": (model.mcc, area + 7000, 4711),
        "moving": (model.mcc, area, 4711),
        ORDINARY: (model.mcc, area, 4711),
        "downgrade": (model.mcc, 7000, 4711),
    }[kind]
    return Pattern(_reading_with(model, *identity))


def _reading_with(model: CellReading, mcc: str, area: int, cid: int) -> CellReading:
    """An identity with what this log prints of each cell: many print no network code."""
    mnc = None if model.mnc is None else "01" if mcc == "001" else model.mnc
    arfcn = None if model.arfcn is None else 63
    code = {} if model.bsic is None else {"bsic": 55}
    label = f"{mcc}-?-{area}-{cid}" if mnc is None else None
    return reading_of(model.rat or "LTE", "serving", None, area, mcc=mcc, mnc=mnc, cid=cid,
                      arfcn=arfcn, label=label, **code)  # fmt: skip


def _clone(
    serving: list[tuple[float, CellReading]], kind: str, track: np.ndarray
) -> Pattern | None:
    """The strongest cell of those heard often: one that the walk passed, if it passed any."""
    n: dict[str, int] = {}
    best: dict[str, tuple[float, float, CellReading]] = {}
    for t_s, reading in serving:
        level_dbm = reading.level_dbm
        if reading.cell is None or level_dbm is None:
            continue
        n[reading.cell] = n.get(reading.cell, 0) + 1
        if reading.cell not in best or level_dbm > best[reading.cell][0]:
            best[reading.cell] = level_dbm, t_s, reading
    often = [cell for cell in n if n[cell] >= _OFTEN]
    if not often:
        return None
    level_dbm, t_s, reading = max((best[cell] for cell in often), key=lambda one: one[0])
    i = int(np.searchsorted(track[:, 0], t_s))
    if kind == "clone on another channel":
        if reading.arfcn is None:
            return None
        reading = replace(reading, arfcn=reading.arfcn + 40, bsic=33)
    place = track[min(i, len(track) - 1), 1:]
    return Pattern(reading, (float(place[0]), float(place[1])), level_dbm)
