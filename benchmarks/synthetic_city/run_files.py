"""Walks of a city as run files, made with the real writer."""

from pathlib import Path

import numpy as np

from benchmarks.synthetic_city.walks import FIRST_UTC_NS
from logger.core.places import Utm
from logger.core.runfile import RunMeta, RunWriter, convert_journal
from logger.core.types import CellReading, Fix, Record, Scan
from postproc.survey.walk_readings import WalkReadings


def write_run(walk: WalkReadings, folder: Path) -> Path:
    """One run; the port of its modem is named after the logger."""
    path = folder / walk.run.name
    config = f'[modem]\nport = "/dev/serial/by-id/usb-{walk.run.modem}"\ndriver = "sim800"\n'
    meta = RunMeta(
        run_id=walk.run.run_id, boot_id="", started_ns=0, origin="synthetic", program="benchmark",
        config_text=config,
    )  # fmt: skip
    journal = path.with_suffix(".journal")
    writer = RunWriter(journal, meta)
    order = np.argsort(walk.scan_seq, kind="stable")
    first = np.unique(walk.scan_seq[order], return_index=True)[1]
    lat_deg, lon_deg = Utm(walk.zone).to_latlon_arrays(
        walk.x_m[order][first], walk.y_m[order][first]
    )
    start_ns = walk.run.began_utc_ns or FIRST_UTC_NS
    for k, rows in enumerate(np.split(order, first[1:])):
        t_ns = int(walk.t_ns[rows[0]])
        fix = Fix(True, start_ns + t_ns, float(lat_deg[k]), float(lon_deg[k]), acc_m=6.0)
        seq = writer.append(Record(t_ns, "gnss", fix))
        readings = tuple(_reading(walk, row) for row in rows.tolist())
        writer.append(Record(t_ns + 1, "modem", Scan(t_ns, readings, seq, seq)))
    writer.close(int(walk.t_ns.max()) + 1, "end")
    convert_journal(journal, path)
    journal.unlink()
    return path


def _reading(walk: WalkReadings, row: int) -> CellReading:
    mcc, mnc, lac, cid = walk.cells[int(walk.cell[row])].cell.split("-")
    level_dbm = float(walk.level_dbm[row])
    return CellReading("neighbour", "GSM", mcc, mnc, int(lac), int(cid), rssi_dbm=level_dbm)
