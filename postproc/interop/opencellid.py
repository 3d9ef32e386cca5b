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

from logger.core.errors import RunFileError
from logger.core.types import Rat, Role
from postproc.interop import csv_table
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    RATS,
    Fields,
    cell_identity,
    is_plmn,
    maybe,
    number,
    place_of,
    plmn,
    reading_of,
    text,
    utc_ns_of,
    whole,
)
from postproc.interop.sighting import Heard, Row, parsed

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
_ASU_MOST = {"GSM": 31, "LTE": 97, "NR": 97}


def read_csv(source: Path) -> Iterator[Row]:
    """Measurements of a CSV file; raises `RunFileError` without the columns needed."""
    yield from parsed(csv_table.rows(source, required=_NEEDED), _sighting)


def read_json(source: Path) -> Iterator[Row]:
    """Measurements of a JSON file, numbered from 1; raises `RunFileError` for other JSON."""
    try:
        found = json.loads(source.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise RunFileError(f"{source} is no JSON file: {error}") from error
    measurements = found.get("measurements") if isinstance(found, dict) else None
    if not isinstance(measurements, list) or not all(isinstance(one, dict) for one in measurements):
        raise RunFileError(f'{source} is JSON, but has no list "measurements" as OpenCelliD has')
    yield from parsed(enumerate(measurements, 1), _sighting)


def writable(heard: Heard) -> bool:
    """Whether a measurement has all that the format needs: who, and when in UTC."""
    cell = heard.reading
    return is_plmn(cell.mcc, cell.mnc) and None not in (
        heard.fix.utc_ns,
        cell.cid,
        cell.rat,
        _area(heard),
    )


def write_csv(heard: Sequence[Heard], target: Path) -> None:
    """Measurements that are `writable`, in the columns of the app's own export."""
    with target.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, _COLUMNS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(map(_measurement, heard))


def write_json(heard: Sequence[Heard], target: Path) -> None:
    """Measurements that are `writable`, as the API takes them: codes are integers."""
    numbered = [
        one | {"mcc": int(one["mcc"]), "mnc": int(one["mnc"])} for one in map(_measurement, heard)
    ]
    target.write_text(json.dumps({"measurements": numbered}, indent=1) + "\n", encoding="utf-8")


def _measurement(heard: Heard) -> dict[str, Any]:
    fix, cell = heard.fix, heard.reading
    assert fix.utc_ns is not None
    assert cell.rat is not None
    found = {
        "mcc": cell.mcc,
        "mnc": cell.mnc,
        "lac": _area(heard),
        "cellid": cell.cid,
        "lat": fix.lat_deg,
        "lon": fix.lon_deg,
        "signal": round(heard.rssi_dbm),
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
    return {name: value for name, value in found.items() if value is not None}


def _area(heard: Heard) -> int | None:
    return heard.reading.tac if heard.reading.lac is None else heard.reading.lac


def _sighting(line: int, fields: Fields) -> Heard | None:
    rat = RATS.get(text(fields, "act", "net_type").upper())
    if rat is None:
        return None
    mcc, mnc = plmn(fields)
    area = (
        whole(fields, "lac", "tac")
        if rat in {"GSM", "WCDMA"}
        else _known_first(fields, "tac", "lac")
    )
    found: dict[str, Any] = {
        "mcc": mcc,
        "mnc": mnc,
        "cid": cell_identity(fields, "cellid", "cell_id"),
        "arfcn": whole(fields, "arfcn"),
        "psc": whole(fields, "psc") if rat == "WCDMA" else None,
        "pci": _known_first(fields, "pci", "psc") if rat not in {"GSM", "WCDMA"} else None,
        "ta": whole(fields, "ta") if rat == "GSM" else None,
    }
    utc_ns = _utc_ns(text(fields, "measured_at"))
    acc_m = maybe(fields, "rating" if "rating" in fields else "accuracy", (0.0, 1e6)) or None
    known = {
        "acc_m": acc_m,
        "alt_m": maybe(fields, "altitude"),
        "speed_mps": maybe(fields, "speed"),
        "course_deg": maybe(fields, "direction" if "direction" in fields else "bearing"),
    }
    fix = place_of(fields, "lat", "lon", utc_ns, **known)
    return Heard(
        line, utc_ns, fix, reading_of(rat, _role(fields), _level_dbm(fields, rat), area, **found)
    )


def _known_first(fields: Fields, *names: str) -> int | None:
    """First known integer: an app writes a mark where Tower Collector leaves the column empty."""
    return next((value for name in names if (value := whole(fields, name)) is not None), None)


def _role(fields: Fields) -> Role:
    told = text(fields, "neighboring").lower()
    return "scan" if not told else "neighbour" if told in {"true", "1"} else "serving"


def _utc_ns(found: str) -> int:
    if not found:
        raise ValueError("measured_at is empty")
    # ten digits are seconds until the year 2286, thirteen are milliseconds since 2001
    utc_ns = (
        int(found) * (10**6 if len(found) > 11 else 10**9)
        if found.isdecimal()
        else utc_ns_of(found, "measured_at")
    )
    if not 0 < utc_ns < 2**62:
        raise ValueError(f"measured_at is out of range: {found[:40]}")
    return utc_ns


def _level_dbm(fields: Fields, rat: Rat) -> float:
    """Level of a measurement; raises ValueError where it is not known."""
    if text(fields, "dbm"):
        return number(fields, "dbm", (LEVEL_RANGE_DBM[0], -1.0))
    told = "signal" if text(fields, "signal") else "asu"
    signal = number(fields, told, (LEVEL_RANGE_DBM[0], 2.0**31))
    if signal < 0:
        return signal
    # 3GPP TS 27.007 8.5 (GSM); CellSignalStrengthLte and -Nr of Android. For WCDMA there are two
    # scales
    if signal > _ASU_MOST.get(rat, -1):
        raise ValueError(f"{told} {signal:.0f} is no level of {rat}")
    return 2.0 * signal - 113.0 if rat == "GSM" else signal - 140.0
