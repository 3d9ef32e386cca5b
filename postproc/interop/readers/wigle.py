"""WiGLE CSV 1.4 and 1.6: an app line, a header line, a line per sighting; cells among Wi-Fi.

Source: api.wigle.net/csvFormat.html, and CellReceiver.java of wiglenet/wigle-wifi-wardriving for
what the app writes about cells. `MAC` is network_area_cell, `AuthMode` the technology and a country
or network, `FirstSeen` the time of this sighting in UTC; columns go by their names, since many
programs write other columns than their version has.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from postproc import csv_table
from postproc.interop.contents import Contents, Format
from postproc.interop.sighting import (
    LEVEL_RANGE_DBM,
    RATS,
    Columns,
    Fields,
    Moment,
    NoCell,
    Row,
    Sighting,
    integer,
    level_in,
    number,
    parse_rows,
    text,
    utc_ns_of,
)

PREFIX = "WigleWifi-"
NO_LEVEL_DBM = -113.0
"""Written for a cell whose level the telephone did not know."""

_NEEDED = ("mac", {"authmode", "type"}, "firstseen", "rssi", "currentlatitude", "currentlongitude")
_CELL = re.compile(r"(\d{3})(\d{2,3})_(\d+)_(\d+)")


def read(source: Path) -> Iterator[Row]:
    """Cells of a file of either version; raises `RunFileError` without the columns needed."""
    with csv_table.text_lines(source) as lines:
        skip = lines.number if next(lines, "").startswith(PREFIX) else 0
    yield from parse_rows(csv_table.rows(source, skip=skip, required=_NEEDED), _sighting)


def _sighting(line: int, fields: Fields) -> Sighting | NoCell:
    # real rows say GSM in Type and LTE in AuthMode; the app sets AuthMode from the cell itself
    kinds = (text(fields, "authmode").partition(";")[0].upper(), text(fields, "type").upper())
    rat = next((RATS[kind] for kind in kinds if kind in RATS), None)
    if rat is None:
        return NoCell(line, f"no cell but {kinds[1][:20] or 'something else'}")
    mac = text(fields, "mac")
    cell = _CELL.fullmatch(mac)
    if cell is None:
        raise ValueError(f"MAC is no cell, which is network_area_cell: {mac[:40]!r}")
    if number(fields, "rssi", LEVEL_RANGE_DBM) == NO_LEVEL_DBM:
        raise ValueError("RSSI is -113, which stands for an unknown level")
    cell_of_mac = dict(zip(("mcc", "mnc", "area", "cid"), cell.groups(), strict=True))
    channel = integer(fields, "channel") or ""
    return _COLUMNS.sighting(line, {**fields, **cell_of_mac, "rat": rat, "arfcn": channel})


def _when(_: int, fields: Fields) -> Moment:
    utc_ns = utc_ns_of(text(fields, "firstseen"), "FirstSeen")
    if utc_ns <= 0:
        raise ValueError("FirstSeen is no time")
    return Moment(utc_ns, is_utc=True)


_COLUMNS = Columns(
    when=_when,
    level_dbm=level_in("rssi"),
    place=("currentlatitude", "currentlongitude"),
    alt_m=("altitudemeters",),
    acc_m=("accuracymeters",),
    area=("area",),
)


def _is_it(seen: Contents) -> bool:
    return seen.kind == "text" and (seen.head.startswith(PREFIX) or seen.has("mac", "firstseen"))


IMPORTS = (Format("WiGLE CSV", read, "FirstSeen", _is_it),)
