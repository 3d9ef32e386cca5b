"""Walks for baselines, made with the real writer."""

from logger.core.runfile import RunWriter, convert_journal
from logger.core.types import CellReading, Fix, Record, Scan
from tests.kit.runs import meta

STEP_DEG = 5e-5
"""Along a meridian, 5.6 m: 54 scans in a square of 300 m."""


def cell(cid, level_dbm, *, lac=801, channel=20, **changes):
    values = {"arfcn": channel, "bsic": 9, "rssi_dbm": level_dbm} | changes
    return CellReading("neighbour", "GSM", "262", "01", lac, cid=cid, **values)


def name(cid, lac=801):
    return f"262-01-{lac}-{cid}"


def write_walk(folder, number, readings_at, *, n=120, lat_deg=52.5, lon_deg=13.4, finish=True):
    """A walk northwards; `readings_at(k)` has the readings of the k-th scan."""
    journal = folder / f"run-{number:06d}.journal"
    writer = RunWriter(journal, meta(run_id=f"{number:032x}"))
    for k in range(n):
        t_ns = k * 2 * 10**9
        fix = Fix(True, 1_790_000_000 * 10**9 + t_ns, lat_deg + k * STEP_DEG, lon_deg, acc_m=5.0)
        seq = writer.append(Record(t_ns, "gnss", fix))
        scan = Scan(t_ns, tuple(readings_at(k)), seq, seq)
        writer.append(Record(t_ns + 10**8, "modem", scan))
    if not finish:
        writer.sync()
        return journal
    writer.close(n * 2 * 10**9, "test")
    run = journal.with_suffix(".h5")
    convert_journal(journal, run)
    return run


def two_cells(level_dbm=-60.0):
    return lambda k: (cell(1, level_dbm - k % 7), cell(2, level_dbm - 20.0, channel=25))
