"""Walks of a modem that names the strongest cells, as observations and as run files."""

import numpy as np

from logger.core.places import Places, Utm
from logger.core.readings import Readings
from logger.core.runfile import RunWriter, convert_journal
from logger.core.types import CellReading, Fix, Record, Scan
from tests.kit.runs import meta

N_SCANS, STEP_M = 400, 4.0
UTM = Utm(33)
START_M = 390_000.0, 5_820_000.0
LISTED = 5
SITES_M = {
    1: (200.0, 60.0), 2: (500.0, -80.0), 3: (800.0, 100.0), 4: (1100.0, -60.0),
    5: (1400.0, 80.0), 6: (700.0, 400.0), 7: (100.0, -500.0), 8: (1500.0, -500.0),
}  # fmt: skip


def levels(seed, *, sites=None, extra_db=None, offset_db=0.0, without=()):
    """Level of each cell along an eastward walk, -inf where the modem does not name it."""
    random = np.random.default_rng(seed)
    x_m = np.arange(N_SCANS) * STEP_M
    y_m = random.normal(0.0, 4.0) + 0.0 * x_m
    rows = {}
    for cid, (east_m, north_m) in (SITES_M | (sites or {})).items():
        away_m = np.hypot(x_m - east_m, y_m - north_m)
        shadow_db = 5.0 * np.sin(x_m / 40.0 + 7.0 * cid) + 3.0 * np.cos(x_m / 23.0 + cid)
        level_dbm = -15.0 - 30.0 * np.log10(np.maximum(away_m, 20.0)) + shadow_db
        level_dbm += (extra_db or {}).get(cid, 0.0) + offset_db + random.normal(0, 3.0, N_SCANS)
        rows[cid] = np.full(N_SCANS, -np.inf) if cid in without else np.round(level_dbm)
    stacked = np.array(list(rows.values()))
    weakest = np.sort(stacked, axis=0)[-LISTED]
    return x_m, y_m, dict(zip(rows, np.where(stacked >= weakest, stacked, -np.inf), strict=True))


def walk(seed, **changes):
    """The walk as observations by cell."""
    x_m, y_m, rows = levels(seed, **changes)
    cells = []
    for cid, level_dbm in rows.items():
        scan = np.flatnonzero(np.isfinite(level_dbm))
        if len(scan):
            places = Places.of(
                START_M[0] + x_m[scan],
                START_M[1] + y_m[scan],
                utm=UTM,
                sigma_m=np.full(len(scan), 3.0),
                t_ns=scan * 10**9,
            )
            cells.append(Readings(name(cid), "GSM", places, level_dbm[scan], scan))
    return cells


def name(cid):
    return f"262-01-801-{cid}"


def write_walk(folder, number, **changes):
    """The walk as a run file."""
    x_m, y_m, rows = levels(number, **changes)
    lat_deg, lon_deg = UTM.to_latlon_arrays(START_M[0] + x_m, START_M[1] + y_m)
    journal = folder / f"run-{number:06d}.journal"
    writer = RunWriter(journal, meta(run_id=f"{number:032x}"))
    for k in range(N_SCANS):
        t_ns = k * 3 * 10**9
        fix = Fix(True, lat_deg=float(lat_deg[k]), lon_deg=float(lon_deg[k]), acc_m=3.0)
        seq = writer.append(Record(t_ns, "gnss", fix))
        readings = tuple(
            CellReading("neighbour", "GSM", "262", "01", 801, cid=cid, rssi_dbm=float(row[k]))
            for cid, row in rows.items()
            if np.isfinite(row[k])
        )
        writer.append(Record(t_ns + 10**8, "modem", Scan(t_ns, readings, seq, seq)))
    writer.close(N_SCANS * 3 * 10**9, "test")
    run = journal.with_suffix(".h5")
    convert_journal(journal, run)
    return run
