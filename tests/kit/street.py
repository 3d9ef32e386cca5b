"""A drive along a street with a cell each 600 m."""

from dataclasses import replace
from math import hypot, log10

import numpy as np

from logger.core.types import CellReading, Fix, Record, Scan
from tests.kit.suspicion_walks import LAT_DEG, LON_DEG, gsm

STEP_S, STEP_M, N_SCANS = 5.0, 25.0, 120
CELLS = range(10, 16)
_METRES_PER_DEG = 111_320.0
_WEAKEST_DBM = -108.0


def street(rat="LTE", seed=0):
    """Records of ten minutes; `seed` draws the fading."""
    fading, shadowing = np.random.default_rng([seed, 5]), np.random.default_rng(5)
    shadow_db = shadowing.normal(0.0, 3.0, (N_SCANS, len(CELLS)))
    records = []
    for k in range(N_SCANS):
        t_ns, north_m = round((k + 1) * STEP_S * 1e9), k * STEP_M
        fix = Fix(True, lat_deg=LAT_DEG + north_m / _METRES_PER_DEG, lon_deg=LON_DEG)
        heard = []
        for i, cid in enumerate(CELLS):
            away_m = hypot(north_m - 150.0 - 600.0 * i, 70.0)
            dbm = -5.0 - 32.0 * log10(away_m) + shadow_db[k, i] + fading.normal(0.0, 2.0)
            if dbm >= _WEAKEST_DBM:
                heard.append(_reading(rat, cid, float(round(dbm))))
        heard.sort(key=lambda reading: -reading.level_dbm)
        scan = Scan(t_ns, (replace(heard[0], role="serving"), *heard[1:]))
        records += [Record(t_ns, "gnss", fix), Record(t_ns, "modem", scan)]
    return records


def _reading(rat, cid, dbm):
    if rat == "GSM":
        return gsm(cid, dbm)
    return CellReading(
        "neighbour", "LTE", "232", "01", tac=7, cid=cid, arfcn=100 + cid, pci=cid, rsrp_dbm=dbm
    )
