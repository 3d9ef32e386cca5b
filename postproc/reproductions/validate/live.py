"""A simulated walk through the live estimate, as the device runs it: a fix and a scan every two
seconds.
"""

from collections.abc import Iterator

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.censoring import GSM_FLOOR_DBM
from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.types import CellReading, Fix, LiveEstimate, Note, Record, Scan
from postproc.reproductions.validate.walk import INTERVAL_S, ORIGIN_M, UTM

ACCURACY_M = 3.0


def reading(cid: int, level_dbm: float) -> CellReading:
    """A decoded GSM cell at a level."""
    return CellReading("serving", "GSM", "001", "01", lac=1, cid=cid, rssi_dbm=level_dbm)


def records(
    x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray
) -> Iterator[tuple[int, Record]]:
    """Records of a walk with their numbers; levels have shape (cells, n), NaN where a cell was not
    heard.
    """
    for k, (x, y) in enumerate(
        zip((x_m + ORIGIN_M[0]).tolist(), (y_m + ORIGIN_M[1]).tolist(), strict=True)
    ):
        t_ns = round(k * INTERVAL_S * 1e9)
        lat_deg, lon_deg = UTM.to_latlon(x, y)
        yield (
            2 * k,
            Record(t_ns, "gnss", Fix(True, lat_deg=lat_deg, lon_deg=lon_deg, acc_m=ACCURACY_M)),
        )
        heard = [
            (cid, level)
            for cid, level in enumerate(level_dbm[:, k].tolist(), 1)
            if not np.isnan(level)
        ]
        yield (
            2 * k + 1,
            Record(
                t_ns, "modem", Scan(t_ns, tuple(reading(*cell) for cell in heard), 2 * k, 2 * k)
            ),
        )


def followed(x_m: FloatArray, y_m: FloatArray, level_dbm: FloatArray) -> list[Note | LiveEstimate]:
    """All that the live estimate says along a walk; levels as of `records`.

    A scan before the first fix has named the cells, so that the first reading of the walk is used.
    """
    tracker = LiveTracker(LiveSettings())
    named = tuple(reading(cid, GSM_FLOOR_DBM) for cid in range(1, len(level_dbm) + 1))
    tracker.feed(0, Record(0, "modem", Scan(0, named)))
    return [said for numbered in records(x_m, y_m, level_dbm) for said in tracker.feed(*numbered)]


def of_stage(said: list[Note | LiveEstimate], *stages: str) -> list[LiveEstimate]:
    """The estimates of some stages, in their order."""
    return [value for value in said if isinstance(value, LiveEstimate) and value.stage in stages]


def place_m(estimate: LiveEstimate) -> tuple[float, float]:
    """Place in the walk's own metres."""
    return estimate.x_m - ORIGIN_M[0], estimate.y_m - ORIGIN_M[1]


def radius_m(estimate: LiveEstimate) -> float:
    """The checklist's error radius, sqrt(Pxx + Pyy)."""
    return float(np.sqrt(estimate.p_xx + estimate.p_yy))
