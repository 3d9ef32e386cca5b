"""OpenCelliD measurements, CSV and JSON, and the exports of Tower Collector.

Sources: wiki.opencellid.org/wiki/API; CsvUploadFormatter.java and CsvExportFormatter.java of
zamojski/TowerCollector. Columns go by their names: their order differs between programs, and so
does that of latitude and longitude. `measured_at` is Unix time in ms, or a date in UTC. `signal` is
in dBm where it is negative; else it is the ASU.
"""

from collections.abc import Iterator
from pathlib import Path

from logger.core.types import Rat
from postproc.interop import json_lines
from postproc.interop.columns import Columns, by_flag
from postproc.interop.contents import Format, of_columns, of_json
from postproc.interop.fields import LEVEL_RANGE_DBM, Fields, level_of, number, text, utc_ns_of
from postproc.interop.log_times import Moment
from postproc.interop.sighting import Row

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


def _read_json(source: Path) -> Iterator[Row]:
    return json_lines.parse_objects(
        source, _COLUMNS.sighting, list_after=r'"measurements"\s*:\s*\['
    )


def _when(_: int, fields: Fields) -> Moment:
    measured_at = text(fields, "measured_at")
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
    return Moment(utc_ns, is_utc=True)


def _level_dbm(fields: Fields, rat: Rat | None) -> float:
    """Level of a measurement; raises ValueError where it is not known."""
    if text(fields, "dbm"):
        return number(fields, "dbm", (LEVEL_RANGE_DBM[0], -1.0))
    assert rat is not None
    return level_of(fields, "signal" if text(fields, "signal") else "asu", rat)


_COLUMNS = Columns(
    rat=("act", "net_type"),
    when=_when,
    level_dbm=_level_dbm,
    role=by_flag("neighboring", means="neighbour", otherwise="serving"),
    alt_m=("altitude",),
    acc_m=("rating", "accuracy"),
    speed_mps=("speed",),
    course_deg=("direction", "bearing"),
    area={
        "GSM": ("lac", "tac"),
        "WCDMA": ("lac", "tac"),
        "LTE": ("tac", "lac"),
        "NR": ("tac", "lac"),
    },
    cid=("cellid", "cell_id"),
    codes={"WCDMA": ("psc",), "LTE": ("pci", "psc"), "NR": ("pci", "psc")},
    ta={"GSM": ("ta",)},
)

IMPORTS = (
    of_columns(
        "OpenCelliD measurements, CSV",
        _COLUMNS,
        _NEEDED,
        times="measured_at",
        known_by=("mcc", "measured_at"),
    ),
    Format("OpenCelliD measurements, JSON", _read_json, "measured_at", of_json("measurements")),
)
