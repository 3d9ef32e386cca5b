"""OpenCelliD measurements, CSV and JSON, and the exports of Tower Collector.

Sources: wiki.opencellid.org/wiki/API; CsvUploadFormatter.java and CsvExportFormatter.java of
zamojski/TowerCollector. Columns go by their names: their order differs between programs, and so
does that of latitude and longitude. `measured_at` is Unix time in ms, or a date in UTC. `signal` is
in dBm where it is negative; else it is the ASU.
"""

import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from logger.core.types import Rat, Role
from postproc.interop import csv_table, json_lines
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    RATS,
    Fields,
    cell_identity,
    fix_of,
    integer,
    is_plmn,
    level_of,
    maybe,
    number,
    plmn,
    reading_of,
    text,
    utc_ns_of,
)
from postproc.interop.sighting import Row, Sighting, parse_rows

_NEEDED = (
    "mcc",
    "mnc",
    "lat",
    "lon",
    "measured_at",
    {"cellid", "cell_id"},
    {"act", "net_type"},
    {"signal", "dbm", "asu"},
)
_COLUMNS = (
    "mcc", "mnc", "lac", "cellid", "lat", "lon", "signal", "measured_at", "rating",
    "speed", "direction", "act", "ta",
    "psc", "tac", "pci", "sid", "nid", "bid",
)  # fmt: skip
_ACT = {"WCDMA": "UMTS", "LTE-M": "LTE", "NB-IoT": "LTE"}


def read_csv(source: Path) -> Iterator[Row]:
    """Measurements of a CSV file; raises `RunFileError` without the columns needed."""
    yield from parse_rows(csv_table.rows(source, required=_NEEDED), _sighting)


def read_json(source: Path) -> Iterator[Row]:
    """Measurements of a JSON file, numbered from 1; raises `RunFileError` for other JSON."""
    yield from json_lines.parse_objects(source, _sighting, list_after=r'"measurements"\s*:\s*\[')


def writable(sighting: Sighting) -> bool:
    """Whether a measurement has all that the format needs: who, and when in UTC."""
    cell = sighting.reading
    return is_plmn(cell.mcc, cell.mnc) and None not in (
        sighting.fix.utc_ns,
        cell.cid,
        cell.rat,
        _area(sighting),
    )


def write_csv(sightings: Sequence[Sighting], target: Path) -> None:
    """Measurements that are `writable`, in the columns of the app's own export."""
    with target.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, _COLUMNS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(map(_measurement, sightings))


def write_json(sightings: Sequence[Sighting], target: Path) -> None:
    """Measurements that are `writable`, as the API takes them: codes are integers."""
    numbered = [
        one | {"mcc": int(one["mcc"]), "mnc": int(one["mnc"])}
        for one in map(_measurement, sightings)
    ]
    target.write_text(json.dumps({"measurements": numbered}, indent=1) + "\n", encoding="utf-8")


def _measurement(sighting: Sighting) -> dict[str, Any]:
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


def _sighting(line: int, fields: Fields) -> Sighting | None:
    rat = RATS.get(text(fields, "act", "net_type").upper())
    if rat is None:
        return None
    mcc, mnc = plmn(fields)
    area = (
        integer(fields, "lac", "tac")
        if rat in {"GSM", "WCDMA"}
        else _known_first(fields, "tac", "lac")
    )
    values: dict[str, Any] = {
        "mcc": mcc,
        "mnc": mnc,
        "cid": cell_identity(fields, "cellid", "cell_id"),
        "arfcn": integer(fields, "arfcn"),
        "psc": integer(fields, "psc") if rat == "WCDMA" else None,
        "pci": _known_first(fields, "pci", "psc") if rat not in {"GSM", "WCDMA"} else None,
        "ta": integer(fields, "ta") if rat == "GSM" else None,
    }
    utc_ns = _utc_ns(text(fields, "measured_at"))
    acc_m = maybe(fields, "rating" if "rating" in fields else "accuracy", (0.0, 1e6)) or None
    known = {
        "acc_m": acc_m,
        "alt_m": maybe(fields, "altitude"),
        "speed_mps": maybe(fields, "speed"),
        "course_deg": maybe(fields, "direction" if "direction" in fields else "bearing"),
    }
    fix = fix_of(fields, "lat", "lon", utc_ns, **known)
    return Sighting(
        line, utc_ns, fix, reading_of(rat, _role(fields), _level_dbm(fields, rat), area, **values)
    )


def _known_first(fields: Fields, *names: str) -> int | None:
    """First known integer: an app writes a mark where Tower Collector leaves the column empty."""
    return next((value for name in names if (value := integer(fields, name)) is not None), None)


def _role(fields: Fields) -> Role:
    flag = text(fields, "neighboring").lower()
    return "scan" if not flag else "neighbour" if flag in {"true", "1"} else "serving"


def _utc_ns(measured_at: str) -> int:
    if not measured_at:
        raise ValueError("measured_at is empty")
    # ten digits are seconds until the year 2286, thirteen are milliseconds since 2001
    utc_ns = (
        int(measured_at) * (10**6 if len(measured_at) > 11 else 10**9)
        if measured_at.isdecimal()
        else utc_ns_of(measured_at, "measured_at")
    )
    if not 0 < utc_ns < 2**62:
        raise ValueError(f"measured_at is out of range: {measured_at[:40]}")
    return utc_ns


def _level_dbm(fields: Fields, rat: Rat) -> float:
    """Level of a measurement; raises ValueError where it is not known."""
    if text(fields, "dbm"):
        return number(fields, "dbm", (LEVEL_RANGE_DBM[0], -1.0))
    column = "signal" if text(fields, "signal") else "asu"
    return level_of(fields, column, rat)
