"""AIMSICD: the app's database, or the table of measurements of it that the app saves as CSV.

Sources: DBTableColumnIds.java and AIMSICDDbAdapter.java of
CellularPrivacy/Android-IMSI-Catcher-Detector. A measurement (`DBi_measure`) names its cell by the
number of a row of `DBi_bts`, so the cells of the CSV alone have that number for a name. Messages,
their senders and TMSIs, which the database has too, are not read.
"""

import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from logger.core.errors import RunFileError
from logger.sqlite_file import open_database
from postproc.interop import csv_table
from postproc.interop.contents import Contents
from postproc.interop.fields import (
    NETWORK_TYPES,
    RATS,
    Fields,
    cell_identity,
    fix_of,
    integer,
    level_of,
    maybe,
    plmn,
    reading_of,
    text,
)
from postproc.interop.log_times import moment_of
from postproc.interop.sighting import Row, Sighting, parse_rows

_MEASURED = ("time", "gpsd_lat", "gpsd_lon", "rx_signal", "bts_id")
_QUERY = (
    "SELECT m.rowid AS line, m.*, b.MCC, b.MNC, b.LAC, b.CID, b.PSC "
    "FROM DBi_measure AS m LEFT JOIN DBi_bts AS b ON b._id = m.bts_id ORDER BY m.rowid"
)


def is_database(seen: Contents) -> bool:
    return seen.kind == "tables" and seen.has("dbi_measure", "dbi_bts")


def is_csv(seen: Contents) -> bool:
    return seen.kind == "text" and seen.has(*_MEASURED)


def read_database(source: Path) -> Iterator[Row]:
    """Measurements with the identities of their cells; raises `RunFileError` if damaged."""
    try:
        with open_database(source) as database:
            database.row_factory = sqlite3.Row
            rows = ((row["line"], _lower(row)) for row in database.execute(_QUERY))
            yield from parse_rows(rows, _sighting)
    except sqlite3.Error as error:
        raise RunFileError(f"{source} is no database of AIMSICD: {error}") from error


def read_csv(source: Path) -> Iterator[Row]:
    """Measurements of the table DBi_measure; raises `RunFileError` without its columns."""
    yield from parse_rows(csv_table.rows(source, required=_MEASURED), _sighting)


def _lower(row: sqlite3.Row) -> dict[str, Any]:
    return {name.lower(): row[name] for name in row.keys()}  # noqa: SIM118 (rows are no dicts)


def _sighting(line: int, fields: Fields) -> Sighting | None:
    kind = text(fields, "rat").upper()
    rat = RATS.get(kind) or NETWORK_TYPES.get(kind)
    if rat is None:
        return None
    moment = moment_of(text(fields, "time"), "time")
    fix = fix_of(
        fields,
        "gpsd_lat",
        "gpsd_lon",
        moment.utc_ns,
        acc_m=maybe(fields, "gpsd_accu", (0.0, 1e6)) or None,
    )
    mcc, mnc = plmn(fields)
    values: dict[str, Any] = {
        "mcc": mcc,
        "mnc": mnc,
        "cid": cell_identity(fields, "cid"),
        "arfcn": integer(fields, "bcch") or None,
        "psc": integer(fields, "psc") if rat == "WCDMA" else None,
        "ta": integer(fields, "ta") if rat == "GSM" else None,
        "label": None if "cid" in fields else f"bts {text(fields, 'bts_id')}",
    }
    is_neighbour = text(fields, "isneighbour") in {"1", "true"}
    reading = reading_of(
        rat,
        "neighbour" if is_neighbour else "serving",
        level_of(fields, "rx_signal", rat),
        integer(fields, "lac"),
        **values,
    )
    return Sighting(line, moment.t_ns, fix, reading)
