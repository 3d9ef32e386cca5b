"""CellMapper CSV: one row for each level, without times, so only the order of the rows counts.

Source: docs.cellmapper.net, page CellMapper CSV. `Signal` is in dBm (LTE: RSRP), `CID` the complete
identity of any technology, `PSC` the scrambling code of UMTS or the physical identity of LTE. Files
with and without the header line occur.
"""

from collections.abc import Iterator
from pathlib import Path

from postproc.interop import csv_table
from postproc.interop.contents import Contents
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    RATS,
    Fields,
    cell_identity,
    fix_of,
    integer,
    maybe,
    number,
    plmn,
    reading_of,
    text,
)
from postproc.interop.sighting import Row, Sighting, parse_rows

COLUMNS = (
    "latitude", "longitude", "altitude", "mcc", "mnc", "lac", "cid", "signal", "type", "subtype",
    "arfcn", "psc",
)  # fmt: skip
_TYPES = frozenset({*RATS, "CDMA"})
_ROW_NS = 10**9


def is_it(seen: Contents) -> bool:
    """Whether a file has these columns, or a first row of them."""
    if seen.kind != "text":
        return False
    return seen.has(*COLUMNS[:9]) or _is_row(seen.head)


def read(source: Path) -> Iterator[Row]:
    """Rows in the file's order; their times count them."""
    with csv_table.text_lines(source) as lines:
        header = COLUMNS if _is_row(next(lines, "")) else ()
    yield from parse_rows(csv_table.rows(source, header=header), _sighting)


def _is_row(line: str) -> bool:
    values = line.strip().split(",")
    return len(values) in {11, 12, 13} and values[8].strip().upper() in _TYPES


def _sighting(line: int, fields: Fields) -> Sighting | None:
    rat = RATS.get(text(fields, "type").upper())
    if rat is None:
        return None
    mcc, mnc = plmn(fields)
    code = text(fields, "psc", "pci", "psc or pci")
    named = {"WCDMA": "psc", "LTE": "pci", "NR": "pci"}.get(rat)
    reading = reading_of(
        rat,
        "scan",
        number(fields, "signal", LEVEL_RANGE_DBM),
        integer(fields, "lac"),
        mcc=mcc,
        mnc=mnc,
        cid=cell_identity(fields, "cid"),
        arfcn=integer(fields, "arfcn"),
        **({named: integer({"psc": code}, "psc")} if named else {}),
    )
    fix = fix_of(fields, "latitude", "longitude", None, alt_m=maybe(fields, "altitude"))
    return Sighting(line, line * _ROW_NS, fix, reading)
