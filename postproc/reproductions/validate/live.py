"""A simulated walk through the live estimate, as the device runs it.

A fix and a scan every two seconds.
"""

from collections.abc import Iterator

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.censoring import GSM_FLOOR_DBM
from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.types import CellReading, Fix, LiveEstimate, Note, Record, Scan
from postproc.reproductions.validate.walk import INTERVAL_S, ORIGIN_M, UTM

ACCURACY_M = 3.0  # of a receiver under open sky


def reading(cid: int, level_dbm: float) -> CellReading:
    """A decoded GSM cell at a level."""
    return CellReading("serving", "GSM", "001", "01", lac=1, cid=cid, rssi_dbm=level_dbm)


def records(
    x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray
) -> Iterator[tuple[int, Record]]:
    """Records of a walk with their numbers.

    Levels have shape (cells, n), NaN where a cell was not received.
    """
    points = zip(x_m.tolist(), y_m.tolist(), level_dbm.T.tolist(), strict=True)
    for k, (x, y, levels_dbm) in enumerate(points):
        t_ns = round(k * INTERVAL_S * 1e9)
        lat_deg, lon_deg = UTM.to_latlon(x + ORIGIN_M[0], y + ORIGIN_M[1])
        fix = Fix(True, lat_deg=lat_deg, lon_deg=lon_deg, acc_m=ACCURACY_M)
        yield 2 * k, Record(t_ns, "gnss", fix)
        cells = (reading(*cell) for cell in enumerate(levels_dbm, 1) if not np.isnan(cell[1]))
        yield 2 * k + 1, Record(t_ns, "modem", Scan(t_ns, tuple(cells), 2 * k, 2 * k))


def track(x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> list[Note | LiveEstimate]:
    """Notes and estimates of the live tracker along a walk; levels as of `records`.

    A scan before the first fix makes the cells known, so that the first reading of the walk is
    used.
    """
    tracker = LiveTracker(LiveSettings())
    cells = tuple(reading(cid, GSM_FLOOR_DBM) for cid in range(1, len(level_dbm) + 1))
    tracker.feed(0, Record(0, "modem", Scan(0, cells)))
    return [output for record in records(x_m, y_m, level_dbm) for output in tracker.feed(*record)]


def of_stage(outputs: list[Note | LiveEstimate], *stages: str) -> list[LiveEstimate]:
    """The estimates of some stages, in their order."""
    return [e for e in outputs if isinstance(e, LiveEstimate) and e.stage in stages]


def position_m(estimate: LiveEstimate) -> tuple[float, float]:
    """Position in the walk's local metres."""
    return estimate.x_m - ORIGIN_M[0], estimate.y_m - ORIGIN_M[1]


def radius_m(estimate: LiveEstimate) -> float:
    """The checklist's error radius, sqrt(Pxx + Pyy)."""
    return float(np.sqrt(estimate.p_xx + estimate.p_yy))
