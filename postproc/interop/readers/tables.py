"""Formats that are tables: what their columns are called, and how they are known.

CellMapper CSV has one row for each level, without times, so only the order of the rows counts.
`Signal` is in dBm (LTE: RSRP), `CID` the complete identity of any technology, `PSC` the scrambling
code of UMTS or the physical identity of LTE; files with and without the header line occur. Source:
docs.cellmapper.net, page CellMapper CSV.

Logs of drive tests have one row for each cell of a scan: `t_s` (seconds; of ten digits since 1970),
`lat`, `lon` (WGS 84 degrees), `rat`, `mcc`, `mnc`, `lac_tac`, `cid`, `arfcn`, `pci_bsic`,
`level_dbm` (GSM RxLev, UMTS RSCP, LTE RSRP), `serving` (1 or 0), `ta`, `neighbour_arfcns` (the
broadcast list: channels with blanks between, or none). Empty is unknown; rows with the same `t_s`
are one scan. A cell without network code has a question mark in its place.

OpenCelliD measurements, CSV and JSON, are also what Tower Collector exports. The order of columns
differs between programs, and so does that of latitude and longitude. `measured_at` is Unix time in
ms, or a date in UTC. `signal` is in dBm where negative, else ASU. Sources:
wiki.opencellid.org/wiki/API; zamojski/TowerCollector.
"""

from collections.abc import Iterator
from pathlib import Path

from logger.core.types import Rat
from postproc import csv_table
from postproc.interop import json_lines
from postproc.interop.contents import Contents, Format, of_columns, of_json
from postproc.interop.sighting import (
    CODES,
    LEVEL_RANGE_DBM,
    RATS,
    Columns,
    Fields,
    Moment,
    Row,
    broadcast_of,
    by_flag,
    level_in,
    level_of,
    maybe,
    moment_of,
    number,
    parse_rows,
    text,
)

_CELLMAPPER_HEADER = (
    "latitude", "longitude", "altitude", "mcc", "mnc", "lac", "cid", "signal", "type", "subtype",
    "arfcn", "psc",
)  # fmt: skip
_CELLMAPPER_TYPES = frozenset({*RATS, "CDMA"})
_SINCE_1970_S = 1e9
_CODE = ("psc", "pci", "psc or pci")
_CELLMAPPER = Columns(
    rat=("type",),
    place=("latitude", "longitude"),
    alt_m=("altitude",),
    level_dbm=level_in("signal"),
    codes={"WCDMA": _CODE, "LTE": _CODE, "NR": _CODE},
)


def _is_cellmapper_row(line: str) -> bool:
    values = line.strip().split(",")
    return len(values) in {11, 12, 13} and values[8].strip().upper() in _CELLMAPPER_TYPES


def _is_cellmapper(seen: Contents) -> bool:
    return seen.kind == "text" and (
        seen.has(*_CELLMAPPER_HEADER[:9]) or _is_cellmapper_row(seen.head)
    )


def _read_cellmapper(source: Path) -> Iterator[Row]:
    with csv_table.text_lines(source) as lines:
        header = _CELLMAPPER_HEADER if _is_cellmapper_row(next(lines, "")) else ()
    yield from parse_rows(csv_table.rows(source, header=header), _CELLMAPPER.sighting)


def _drive_moment(_: int, fields: Fields) -> Moment:
    t_s = number(fields, "t_s")
    return Moment(round(t_s * 1e9), is_utc=t_s >= _SINCE_1970_S)


_DRIVE_LOG = Columns(
    when=_drive_moment,
    level_dbm=lambda fields, _: maybe(fields, "level_dbm", LEVEL_RANGE_DBM),
    role=lambda fields: "serving" if text(fields, "serving") == "1" else "neighbour",
    area=("lac_tac",),
    codes=dict.fromkeys(CODES, ("pci_bsic",)),
    ta=("ta",),
    more=lambda fields, _: {"broadcast": broadcast_of(fields)},
    half_networks=True,
)


def _read_opencellid_json(source: Path) -> Iterator[Row]:
    return json_lines.parse_objects(
        source, _OPENCELLID.sighting, list_after=r'"measurements"\s*:\s*\['
    )


def _opencellid_time(_: int, fields: Fields) -> Moment:
    measured_at = text(fields, "measured_at")
    if not measured_at:
        raise ValueError("measured_at is empty")
    return Moment(moment_of(measured_at, "measured_at").t_ns, is_utc=True)


def _opencellid_level_dbm(fields: Fields, rat: Rat | None) -> float:
    """Level of a measurement; raises ValueError where it is not known."""
    if text(fields, "dbm"):
        return number(fields, "dbm", (LEVEL_RANGE_DBM[0], -1.0))
    assert rat is not None
    return level_of(fields, "signal" if text(fields, "signal") else "asu", rat)


_OPENCELLID = Columns(
    rat=("act", "net_type"),
    when=_opencellid_time,
    level_dbm=_opencellid_level_dbm,
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
    Format("CellMapper CSV", _read_cellmapper, "", _is_cellmapper),
    of_columns(
        "drive test CSV",
        _DRIVE_LOG,
        ("t_s", "lat", "lon", "rat", "lac_tac", "pci_bsic", "level_dbm"),
        times="t_s",
        has_scans=True,
    ),
    of_columns(
        "OpenCelliD measurements, CSV",
        _OPENCELLID,
        (
            "mcc",
            "mnc",
            "lat",
            "lon",
            "measured_at",
            {"cellid", "cell_id"},
            {"act", "net_type"},
            {"signal", "dbm", "asu"},
        ),
        times="measured_at",
        known_by=("mcc", "measured_at"),
    ),
    Format(
        "OpenCelliD measurements, JSON",
        _read_opencellid_json,
        "measured_at",
        of_json("measurements"),
    ),
)
