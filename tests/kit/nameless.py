"""Walks past cells that a modem names in full, by channel and code alone, or in turn."""

from math import hypot, log10

import numpy as np

from logger.core.types import CellReading, Fix, Record, Scan
from tests.kit.runs import UTC0_NS

LAT, LON = 52.0, 13.0
M_PER_DEG_LAT, M_PER_DEG_LON = 111_240.0, 68_640.0
"""Of the ellipsoid at 52 degrees north."""
EARFCN, PCI = 5780, 210
BY_CHANNEL = f"LTE-{EARFCN}-{PCI}"
NAMED = "262-01-4711-9"


def at_deg(east_m, north_m):
    return LAT + north_m / M_PER_DEG_LAT, LON + east_m / M_PER_DEG_LON


def neighbour(rsrp_dbm=-90.0, **changes):
    """Known by channel and code alone."""
    known = {"rat": "LTE", "arfcn": EARFCN, "pci": PCI, "rsrp_dbm": rsrp_dbm}
    return CellReading("neighbour", **known | changes)


def serving(rsrp_dbm=-90.0, cid=9, **changes):
    """The same cell, or another one of its channel and code, with its identity."""
    identity = {"mcc": "262", "mnc": "01", "tac": 4711, "cid": cid}
    return neighbour(rsrp_dbm, **identity | changes)


def square(n=240, side_m=300.0, step_m=5.0):
    """Places of a walk around a block, one a second."""
    along = np.arange(n) * step_m % (4.0 * side_m)
    east = np.interp(along, [0.0, side_m, 2 * side_m, 3 * side_m, 4 * side_m], [0, 1, 1, 0, 0])
    north = np.interp(along, [0.0, side_m, 2 * side_m, 3 * side_m, 4 * side_m], [0, 0, 1, 1, 0])
    return np.column_stack([east * side_m, north * side_m])


def level_dbm(place_m, station_m, rng=None):
    distance_m = max(hypot(*(np.asarray(place_m) - station_m)), 5.0)
    return -35.0 - 30.0 * log10(distance_m) + (rng.normal(0.0, 2.0) if rng else 0.0)


def records(places_m, heard, *, t0_s=0):
    """A fix and a scan each second; `heard(i, place_m)` are the readings of scan i."""
    out = []
    for i, place_m in enumerate(places_m):
        t_ns = (t0_s + i) * 10**9
        lat, lon = at_deg(*place_m)
        fix = Fix(True, UTC0_NS + t_ns, lat, lon, 34.5, acc_m=3.0, sats_used=8)
        out.append(Record(t_ns, "gnss", fix))
        out.append(Record(t_ns + 5, "modem", Scan(t_ns, tuple(heard(i, place_m)))))
    return out
