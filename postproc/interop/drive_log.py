"""Logs of drive tests in one form: one row for each cell of a scan.

Columns: `t_s` (seconds), `lat`, `lon` (WGS 84 degrees), `rat`, `mcc`, `mnc`, `lac_tac`, `cid`,
`arfcn`, `pci_bsic`, `level_dbm` (GSM RxLev, UMTS RSCP, LTE RSRP), `serving` (1 or 0), `ta`. Empty
is unknown; rows with the same `t_s` are one scan. A cell without its network code is named with a
question mark in its place, since many logs of telephones leave it out.
"""

from collections.abc import Iterator
from pathlib import Path

from logger.core.places import check_position
from logger.core.types import CellReading, Fix
from postproc.interop import csv_table
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    RATS,
    Fields,
    cell_identity,
    integer,
    maybe,
    network_code,
    number,
    reading_of,
    text,
)
from postproc.interop.sighting import Row, Sighting, parse_rows

COLUMNS = frozenset({"t_s", "lat", "lon", "rat", "lac_tac", "pci_bsic", "level_dbm"})
_CODES = {"GSM": "bsic", "WCDMA": "psc"}


def read(source: Path) -> Iterator[Row]:
    """Rows in the file's order; raises `RunFileError` without the columns needed."""
    yield from parse_rows(csv_table.rows(source, required=tuple(COLUMNS)), _sighting)


def _sighting(line: int, fields: Fields) -> Sighting:
    t_s = number(fields, "t_s")
    lat_deg, lon_deg = number(fields, "lat"), number(fields, "lon")
    check_position(lat_deg, lon_deg)
    fix = Fix(True, lat_deg=lat_deg, lon_deg=lon_deg)
    return Sighting(line, round(t_s * 1e9), fix, _reading(fields))


def _reading(fields: Fields) -> CellReading:
    rat = RATS.get(text(fields, "rat").upper())
    if rat is None:
        raise ValueError(f"no technology is called {text(fields, 'rat')[:40]!r}")
    mcc, mnc = network_code(fields, "mcc", 3), network_code(fields, "mnc", 2)
    area, cid = integer(fields, "lac_tac"), cell_identity(fields, "cid")
    return reading_of(
        rat,
        "serving" if text(fields, "serving") == "1" else "neighbour",
        maybe(fields, "level_dbm", LEVEL_RANGE_DBM),
        area,
        mcc=mcc,
        mnc=mnc,
        cid=cid,
        arfcn=integer(fields, "arfcn"),
        ta=integer(fields, "ta"),
        **{_CODES.get(rat, "pci"): integer(fields, "pci_bsic")},
    )
