"""OpenCelliD measurements as CSV, in the columns of Tower Collector's own export.

Sources: wiki.opencellid.org/wiki/API; CsvExportFormatter.java of zamojski/TowerCollector.
"""

import csv
from pathlib import Path
from typing import Any

from postproc.interop.exporting import ExportWalk
from postproc.interop.sighting import Sighting, is_plmn

_COLUMNS = (
    "mcc", "mnc", "lac", "cellid", "lat", "lon", "signal", "measured_at", "rating",
    "speed", "direction", "act", "ta",
    "psc", "tac", "pci", "sid", "nid", "bid",
)  # fmt: skip
_ACT = {"WCDMA": "UMTS", "LTE-M": "LTE", "NB-IoT": "LTE"}


def writable(sighting: Sighting) -> bool:
    """Whether a measurement has all that the format needs: who, and when in UTC."""
    cell = sighting.reading
    return is_plmn(cell.mcc, cell.mnc) and None not in (
        sighting.fix.utc_ns,
        cell.cid,
        cell.rat,
        _area(sighting),
    )


def write(walk: ExportWalk, target: Path) -> None:
    """Levels that are `writable`."""
    with target.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, _COLUMNS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(map(measurement, walk.sightings))


def measurement(sighting: Sighting) -> dict[str, Any]:
    """What the format has of a level."""
    fix, cell = sighting.fix, sighting.reading
    assert fix.utc_ns is not None
    assert cell.rat is not None
    values = {
        "mcc": cell.mcc,
        "mnc": cell.mnc,
        "lac": _area(sighting),
        "cellid": cell.cid,
        "lat": fix.lat_deg,
        "lon": fix.lon_deg,
        "signal": round(sighting.rssi_dbm),
        "measured_at": fix.utc_ns // 10**6,
        "rating": fix.acc_m,
        "speed": fix.speed_mps,
        "direction": fix.course_deg,
        "act": _ACT.get(cell.rat, cell.rat),
        "ta": cell.ta,
        "psc": cell.psc,
        "tac": cell.tac,
        "pci": cell.pci,
    }
    return {name: value for name, value in values.items() if value is not None}


def _area(sighting: Sighting) -> int | None:
    return sighting.reading.tac if sighting.reading.lac is None else sighting.reading.lac
