"""KML 2.2 (OGC 07-147r2): for each cell its levels in classes of 10 dB, regions, positions.

Every stretch carries the time in which it was walked, so that the time slider of a globe shows the
walk; without UTC there are no times.
"""

from collections.abc import Iterator, Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

from logger.core.locator.rivals import share_text
from logger.core.places import MAX_GAP_S
from postproc.interop.estimates import Estimate, Line, LonLat, Rings, lines
from postproc.interop.exporting import ExportWalk
from postproc.interop.fields import moment
from postproc.interop.sighting import Sighting
from postproc.interop.xml_file import add
from postproc.interop.xml_file import write as write_xml

NAMESPACE = "http://www.opengis.net/kml/2.2"
CLASSES_DBM = (-60, -70, -80, -90, -100, -110)
"""A class holds its own level and what is above, up to the class before; the last class has no
floor.
"""
_CLASS_COLOURS = (
    "ff25e7fd",
    "ff4ac96d",
    "ff879e1f",
    "ff8d6d31",
    "ff8a4e3e",
    "ff7d2848",
    "ff540144",
)
_AREA_COLOURS = {95: "40e68a00", 50: "70e68a00"}
_LINE = "ffe68a00"

HAS_ESTIMATES = True


def write(walk: ExportWalk, estimates: Sequence[Estimate], target: Path) -> None:
    """Folders: the walk, then one for each cell."""
    root = ET.Element("kml", {"xmlns": NAMESPACE})
    document = add(root, "Document")
    add(document, "name", "cellwalk")
    add(
        document,
        "description",
        "times are UTC, from GPS" if walk.has_utc else "UTC is not known, so nothing has a time",
    )
    _styles(document)
    folder = _folder(document, "walk", "track of the receiver")
    for stretch in walk.track:
        points = [
            (fix.lon_deg, fix.lat_deg)
            for _, fix in stretch
            if fix.lon_deg is not None and fix.lat_deg is not None
        ]
        ends = (stretch[0][1].utc_ns, stretch[-1][1].utc_ns)
        _placemark(folder, "walk", "walk", lines(points), ends, points[0])
    by_cell: dict[str, list[Sighting]] = {estimate.cell: [] for estimate in estimates}
    for one in walk.sightings:
        by_cell.setdefault(one.reading.cell or "", []).append(one)
    estimate_of = {estimate.cell: estimate for estimate in estimates}
    for cell, sightings in sorted(by_cell.items(), key=lambda entry: -len(entry[1])):
        _cell(document, cell, sightings, estimate_of.get(cell))
    write_xml(root, target)


def _styles(document: ET.Element) -> None:
    _style(document, "walk", "ff808080", 2)
    for i, colour in enumerate(_CLASS_COLOURS):
        _style(document, f"level-{i}", colour, 5)
    for level, colour in _AREA_COLOURS.items():
        _style(document, f"region-{level}", _LINE, 1, fill=colour)
    _style(document, "ellipse", _LINE, 2, fill="00ffffff")
    icon = add(add(document, "Style", id="position"), "IconStyle")
    add(icon, "color", _LINE)


def _style(
    document: ET.Element, name: str, colour: str, width: int, fill: str | None = None
) -> None:
    style = add(document, "Style", id=name)
    add(add(style, "IconStyle"), "color", colour)
    line = add(style, "LineStyle")
    add(line, "color", colour)
    add(line, "width", width)
    if fill is not None:
        add(add(style, "PolyStyle"), "color", fill)


def _cell(
    document: ET.Element, cell: str, sightings: Sequence[Sighting], estimate: Estimate | None
) -> None:
    rat = next((one.reading.rat for one in sightings), None)
    says = f"{len(sightings)} levels" + (f", {rat}" if rat else "")
    if estimate is not None:
        says = "; ".join([says, estimate.verdict, *estimate.warnings])
    folder = _folder(document, cell, says)
    levels = _folder(folder, "levels", "dBm, in classes of 10 dB")
    for strip in strips(sightings):
        chosen, points = (
            level_class(strip[0].rssi_dbm),
            [(one.lon_deg, one.lat_deg) for one in strip],
        )
        ends = (strip[0].fix.utc_ns, strip[-1].fix.utc_ns)
        _placemark(levels, class_name(chosen), f"level-{chosen}", lines(points), ends, points[0])
    if estimate is not None:
        for level, outline in estimate.regions.items():
            _area(folder, f"{level} % region", f"region-{level}", outline)
        for position in estimate.positions:
            share = "" if position.probability is None else f" ({share_text(position.probability)})"
            name = (
                position.name
                if position.verdict in {None, "located"}
                else f"{position.name}: {position.verdict}"
            )
            title, about = f"{name}{share}", position.radii_text
            _placemark(folder, title, "position", [], (None, None), position.lon_lat, about)
            _area(folder, f"95 % ellipse of {position.name}", "ellipse", position.ellipse95)


def level_class(level_dbm: float) -> int:
    """Number of the class of a level, from 0 for the strongest."""
    return next((i for i, floor in enumerate(CLASSES_DBM) if level_dbm >= floor), len(CLASSES_DBM))


def class_name(number: int) -> str:
    if number == len(CLASSES_DBM):
        return f"below {CLASSES_DBM[-1]} dBm"
    return f"{CLASSES_DBM[number]} dBm and above"


def strips(sightings: Sequence[Sighting]) -> Iterator[Sequence[Sighting]]:
    """Stretches of one class without a gap; each ends at the first level of the next."""
    start = 0
    for i, (one, following) in enumerate(pairwise(sightings), 1):
        apart = following.t_ns - one.t_ns > MAX_GAP_S * 1e9
        if apart or level_class(one.rssi_dbm) != level_class(following.rssi_dbm):
            yield sightings[start : i if apart else i + 1]
            start = i
    if sightings:
        yield sightings[start:]


def _folder(parent: ET.Element, name: str, says: str) -> ET.Element:
    folder = add(parent, "Folder")
    add(folder, "name", name)
    add(folder, "description", escape(says))  # which a globe shows as HTML
    return folder


def _placemark(
    parent: ET.Element,
    name: str,
    style: str,
    parts: Sequence[Line],
    utc_ns: tuple[int | None, int | None],
    at: LonLat,
    about: str = "",
) -> None:
    """Lines, or a point where there is none."""
    placemark = add(parent, "Placemark")
    add(placemark, "name", name)
    if about:
        add(placemark, "description", about)
    if None not in utc_ns:
        span = add(placemark, "TimeSpan")
        add(span, "begin", moment(utc_ns[0]))
        add(span, "end", moment(utc_ns[1]))
    add(placemark, "styleUrl", f"#{style}")
    if not parts:
        add(add(placemark, "Point"), "coordinates", _coordinates([at]))
        return
    geometry = add(placemark, "MultiGeometry") if len(parts) > 1 else placemark
    for part in parts:
        line = add(geometry, "LineString")
        add(line, "tessellate", 1)
        add(line, "coordinates", _coordinates(part))


def _area(parent: ET.Element, name: str, style: str, outline: Sequence[Rings]) -> None:
    if not outline:
        return
    placemark = add(parent, "Placemark")
    add(placemark, "name", name)
    add(placemark, "styleUrl", f"#{style}")
    geometry = add(placemark, "MultiGeometry")
    for rings in outline:
        polygon = add(geometry, "Polygon")
        add(polygon, "tessellate", 1)
        for i, ring in enumerate(rings):
            boundary = add(polygon, "innerBoundaryIs" if i else "outerBoundaryIs")
            add(add(boundary, "LinearRing"), "coordinates", _coordinates(ring))


def _coordinates(points: Sequence[LonLat]) -> str:
    return " ".join(f"{lon:.7f},{lat:.7f}" for lon, lat in points)
