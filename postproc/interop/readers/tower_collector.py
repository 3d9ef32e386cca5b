"""GPX and KML of Tower Collector: a point for each measurement, its cells as text in the name.

Sources: GpxExportFormatter.java and KmlExportFormatter.java of zamojski/TowerCollector. The app's
CSV and JSON are read by `postproc.interop.readers.tables`. The name of the telephone, which
both have, is not read.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from postproc.interop import xml_file
from postproc.interop.contents import Contents, Format
from postproc.interop.sighting import Columns, Moment, NoCell, Row, level_in, parse_rows, utc_ns_of

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
    accuracy = _ACCURACY.search(name)
    shared = {
        **_place(point),
        "acc": accuracy[1] if accuracy else "",
        "time": point.findtext("time") or point.findtext("TimeStamp/when") or "",
    }
    found = [(line, {**cell.groupdict(""), **shared}) for cell in _CELL.finditer(name)]
    if not found:
        _COLUMNS.when(line, shared)  # a point without a time is a bad one
        return [NoCell(line, "no cell in the name of the point")]
    return list(parse_rows(found, _COLUMNS.sighting))


def _place(point: ET.Element) -> dict[str, str]:
    if point.tag == "trkpt":
        at = {name: point.get(name, "") for name in ("lat", "lon")}
        return at | {"ele": point.findtext("ele") or ""}
    lon, lat, *ele = [*(point.findtext("Point/coordinates") or "").strip().split(","), ""][:3]
    return {"lat": lat, "lon": lon, "ele": ele[0] if ele else ""}


_COLUMNS = Columns(
    rat=("network",),
    when=lambda _, fields: Moment(utc_ns_of(fields["time"], "time"), is_utc=True),
    level_dbm=level_in("dbm"),
    role=lambda fields: "neighbour" if fields["neighbour"] else "serving",
    alt_m=("ele",),
    acc_m=("acc",),
    codes={"WCDMA": ("psc",), "LTE": ("psc",), "NR": ("psc",)},
)

IMPORTS = (Format("Tower Collector GPX or KML", read, "time", is_it),)
