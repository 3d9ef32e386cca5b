"""CellMapper CSV: one row for each level, without times, so only the order of the rows counts.

Source: docs.cellmapper.net, page CellMapper CSV. `Signal` is in dBm (LTE: RSRP), `CID` the complete
identity of any technology, `PSC` the scrambling code of UMTS or the physical identity of LTE. Files
with and without the header line occur.
"""

from collections.abc import Iterator
from pathlib import Path

from postproc.interop import csv_table
from postproc.interop.columns import Columns, level_in
from postproc.interop.contents import Contents, Format
from postproc.interop.fields import RATS
from postproc.interop.sighting import Row, parse_rows

_HEADER = (
    "latitude", "longitude", "altitude", "mcc", "mnc", "lac", "cid", "signal", "type", "subtype",
    "arfcn", "psc",
)  # fmt: skip
_TYPES = frozenset({*RATS, "CDMA"})
_CODE = ("psc", "pci", "psc or pci")
_COLUMNS = Columns(
    rat=("type",),
    place=("latitude", "longitude"),
    alt_m=("altitude",),
    level_dbm=level_in("signal"),
    codes={"WCDMA": _CODE, "LTE": _CODE, "NR": _CODE},
)


def _is_row(line: str) -> bool:
    values = line.strip().split(",")
    return len(values) in {11, 12, 13} and values[8].strip().upper() in _TYPES


def _is_it(seen: Contents) -> bool:
    return seen.kind == "text" and (seen.has(*_HEADER[:9]) or _is_row(seen.head))


def _read(source: Path) -> Iterator[Row]:
    with csv_table.text_lines(source) as lines:
        header = _HEADER if _is_row(next(lines, "")) else ()
    yield from parse_rows(csv_table.rows(source, header=header), _COLUMNS.sighting)


IMPORTS = (Format("CellMapper CSV", _read, "", _is_it),)
