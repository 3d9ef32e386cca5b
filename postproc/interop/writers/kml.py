"""KML 2.2 (OGC 07-147r2): the levels of each cell in classes of 10 dB, or places and regions.

Every stretch has its time, for the time slider of a globe; without UTC there are no times.
"""

from collections.abc import Iterator, Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

from logger.core.answer import Answer
from logger.core.document import Column, Table, Value
from logger.core.places import MAX_GAP_S
from postproc.interop.exporting import Answered, ExportWalk, says_of, title_of
from postproc.interop.sighting import Sighting, moment
from postproc.interop.xml_file import add
from postproc.interop.xml_file import write as write_xml
from postproc.outlines import Line, LonLat, Rings, lines

NAMESPACE = "http://www.opengis.net/kml/2.2"
CLASSES_DBM = (-60, -70, -80, -90, -100, -110)
"""A class reaches from its level up to the class before; the last class has no floor."""
_CLASS_COLOURS = (
    "ff25e7fd",
    "ff4ac96d",
    "ff879e1f",
    "ff8d6d31",
    "ff8a4e3e",
    "ff7d2848",
    "ff540144",
)
_WORD_COLOURS = {"suspicious": "2828dc", "unusual": "0090e0", "nothing unusual": "e68a00"}
"""Blue, green, red, as KML has them."""
_REGIONS = {95: ("surely within (95 %)", "40"), 50: ("most likely within (50 %)", "70")}
"""Name of the folder, and how opaque an area is."""
HAS_REGIONS = True


def write(walk: ExportWalk, target: Path) -> None:
    """Folders: the walk, then one for each cell."""
    says = "times are UTC, from GPS" if walk.has_utc else "UTC is not known, so nothing has a time"
    root, document = _document(says)
    _style(document, "walk", "ff808080", 2)
    for i, colour in enumerate(_CLASS_COLOURS):
        _style(document, f"level-{i}", colour, 5)
    folder = _folder(document, "walk", "track of the receiver")
    for stretch in walk.track:
        points = [
            (fix.lon_deg, fix.lat_deg)
            for _, fix in stretch
            if fix.lon_deg is not None and fix.lat_deg is not None
        ]
        ends = (stretch[0][1].utc_ns, stretch[-1][1].utc_ns)
        _placemark(folder, "walk", "walk", lines(points), ends, points[0])
    by_cell: dict[str, list[Sighting]] = {}
    for one in walk.sightings:
        by_cell.setdefault(one.reading.cell or "", []).append(one)
    for cell, sightings in sorted(by_cell.items(), key=lambda entry: -len(entry[1])):
        _cell(document, cell, sightings)
    write_xml(root, target)


def write_answers(answered: Sequence[Answered], table: Table, target: Path) -> None:
    """A folder of points and two of areas, with the columns of the table: a layer each.

    A cell without a place is in the first without a geometry.
    """
    root, document = _document("a word is no accusation: it is a reason to walk there")
    for word, colour in _WORD_COLOURS.items():
        name = word.replace(" ", "-")
        _style(document, name, f"ff{colour}", 1)
        for percent, (_, opacity) in _REGIONS.items():
            _style(document, f"{name}-{percent}", f"ff{colour}", 1, fill=f"{opacity}{colour}")
    schema = add(document, "Schema", name="cell", id="cell")
    for column in table.columns:
        kind = "double" if column.title.endswith(("_m", "_deg")) else "string"
        kind = "int" if column.title.startswith("n_") else kind
        add(schema, "SimpleField", name=column.title, type=kind)
    places = _folder(document, "cells", "the likeliest place of each")
    areas = {percent: _folder(document, name, "") for percent, (name, _) in _REGIONS.items()}
    for (answer, regions), row in zip(answered, table.rows, strict=True):
        style = answer.word.word.replace(" ", "-") if answer.word else "nothing-unusual"
        placemark = _answer(places, answer, style, table.columns, row)
        if answer.place is not None:
            at = answer.place.in_short()
            add(add(placemark, "Point"), "coordinates", _coordinates([(at.lon, at.lat)]))
        for percent, outline in regions.items():
            placemark = _answer(areas[percent], answer, f"{style}-{percent}", table.columns, row)
            _area(placemark, outline)
    write_xml(root, target)


def _answer(
    parent: ET.Element, answer: Answer, style: str, columns: Sequence[Column], row: Sequence[Value]
) -> ET.Element:
    placemark = add(parent, "Placemark")
    add(placemark, "name", title_of(answer))
    add(placemark, "description", escape(says_of(answer), quote=False))
    add(placemark, "styleUrl", f"#{style}")
    data = add(add(placemark, "ExtendedData"), "SchemaData", schemaUrl="#cell")
    for column, value in zip(columns, row, strict=True):
        if value is not None:
            add(data, "SimpleData", value, name=column.title)
    return placemark


def _document(says: str) -> tuple[ET.Element, ET.Element]:
    root = ET.Element("kml", {"xmlns": NAMESPACE})
    document = add(root, "Document")
    add(document, "name", "cellwalk")
    add(document, "description", says)
    return root, document


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


def _cell(document: ET.Element, cell: str, sightings: Sequence[Sighting]) -> None:
    rat = next((one.reading.rat for one in sightings), None)
    folder = _folder(document, cell, f"{len(sightings)} levels" + (f", {rat}" if rat else ""))
    levels = _folder(folder, "levels", "dBm, in classes of 10 dB")
    for strip in strips(sightings):
        chosen, points = (
            level_class(strip[0].rssi_dbm),
            [(one.lon_deg, one.lat_deg) for one in strip],
        )
        ends = (strip[0].fix.utc_ns, strip[-1].fix.utc_ns)
        _placemark(levels, class_name(chosen), f"level-{chosen}", lines(points), ends, points[0])


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
) -> None:
    """Lines, or a point where there is none."""
    placemark = add(parent, "Placemark")
    add(placemark, "name", name)
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


def _area(placemark: ET.Element, outline: Sequence[Rings]) -> None:
    geometry = add(placemark, "MultiGeometry")
    for rings in outline:
        polygon = add(geometry, "Polygon")
        add(polygon, "tessellate", 1)
        for i, ring in enumerate(rings):
            boundary = add(polygon, "innerBoundaryIs" if i else "outerBoundaryIs")
            add(add(boundary, "LinearRing"), "coordinates", _coordinates(ring))


def _coordinates(points: Sequence[LonLat]) -> str:
    return " ".join(f"{lon:.7f},{lat:.7f}" for lon, lat in points)
