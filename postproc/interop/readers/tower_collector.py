"""GPX and KML of Tower Collector: a point for each measurement, its cells as text in the name.

Sources: GpxExportFormatter.java and KmlExportFormatter.java of zamojski/TowerCollector. The app's
CSV and JSON are read by `postproc.interop.opencellid`. The name of the telephone, which both have,
is not read.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from logger.core.types import Fix
from postproc.interop import xml_file
from postproc.interop.contents import Contents
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    RATS,
    cell_identity,
    fix_of,
    integer,
    maybe,
    number,
    plmn,
    reading_of,
    utc_ns_of,
)
from postproc.interop.sighting import BadRow, NoCell, Row, Sighting, parse_rows

_CELL = re.compile(
    r"\((?:MCC (?P<mcc>\d+), )?MNC (?P<mnc>-?\d+), LAC (?P<lac>-?\d+), CID (?P<cid>-?\d+), "
    r"(?:PSC (?P<psc>-?\d+), )?Signal strength (?P<dbm>-?\d*) dBm, "
    r"Network (?P<network>[^,)]*)(?P<neighbour>, neighboring)?\)"
)
_ACCURACY = re.compile(r"\(GPS accuracy ([\d.]+) m\)")


def is_it(seen: Contents) -> bool:
    """Whether Tower Collector wrote a file."""
    return seen.kind == "xml" and "Tower Collector" in seen.head


def read(source: Path) -> Iterator[Row]:
    """Cells of all points; raises `RunFileError` for damaged XML."""
    points = (
        (number, point)
        for number, point in enumerate(xml_file.elements(source, "trkpt", "Placemark"), 1)
        if point.tag == "trkpt" or point.find("Point") is not None
    )
    yield from parse_rows(points, _cells)


def _cells(line: int, point: ET.Element) -> list[Row]:
    name = point.findtext("name") or ""
    fix = _fix(point, name)
    cells = [_cell(line, fix, found) for found in _CELL.finditer(name)]
    return cells or [NoCell(line, "no cell in the name of the point")]


def _fix(point: ET.Element, name: str) -> Fix:
    accuracy = _ACCURACY.search(name)
    place = _place(point)
    fields = {**place, "acc": accuracy[1] if accuracy else ""}
    when = point.findtext("time") or point.findtext("TimeStamp/when") or ""
    return fix_of(
        fields,
        "lat",
        "lon",
        utc_ns_of(when, "time"),
        alt_m=maybe(fields, "ele"),
        acc_m=maybe(fields, "acc", (0.0, 1e6)) or None,
    )


def _place(point: ET.Element) -> dict[str, str]:
    if point.tag == "trkpt":
        at = {name: point.get(name, "") for name in ("lat", "lon")}
        return at | {"ele": point.findtext("ele") or ""}
    lon, lat, *ele = [*(point.findtext("Point/coordinates") or "").strip().split(","), ""][:3]
    return {"lat": lat, "lon": lon, "ele": ele[0] if ele else ""}


def _cell(line: int, fix: Fix, found: re.Match[str]) -> Row:
    fields = found.groupdict()
    rat = RATS.get(fields["network"].strip().upper())
    if rat is None:
        return NoCell(line)
    try:
        mcc, mnc = plmn(fields)
        codes = {"WCDMA": "psc", "LTE": "pci", "NR": "pci"}
        code = {codes[rat]: integer(fields, "psc")} if rat in codes else {}
        reading = reading_of(
            rat,
            "neighbour" if fields["neighbour"] else "serving",
            number(fields, "dbm", LEVEL_RANGE_DBM),
            integer(fields, "lac"),
            mcc=mcc,
            mnc=mnc,
            cid=cell_identity(fields, "cid"),
            **code,
        )
    except ValueError as error:
        return BadRow(line, str(error))
    assert fix.utc_ns is not None
    return Sighting(line, fix.utc_ns, fix, reading)
