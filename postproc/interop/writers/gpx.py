"""GPX 1.1: the walk as a track with a segment for each stretch, or cells as waypoints.

The format allows only times in UTC, so times are left out where the receiver never reported UTC.
"""

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from logger.core.document import Table
from logger.core.types import Fix
from postproc.interop.exporting import Answered, ExportWalk, says_of, title_of
from postproc.interop.sighting import moment
from postproc.interop.xml_file import add, decimal
from postproc.interop.xml_file import write as write_xml
from postproc.outlines import DECIMALS

HAS_LEVELS = False
NAMESPACE = "http://www.topografix.com/GPX/1/1"


def write(walk: ExportWalk, target: Path) -> None:
    """The track."""
    root = _root()
    track = add(root, "trk")
    add(track, "name", "walk")
    if not walk.has_utc:
        add(track, "desc", "UTC is not known, so the points have no time")
    for stretch in walk.track:
        segment = add(track, "trkseg")
        for _, fix in stretch:
            _point(segment, fix)
    write_xml(root, target)


def write_answers(answered: Sequence[Answered], _: Table, target: Path) -> None:
    """A waypoint for each cell that has a place."""
    root = _root()
    for answer, _regions in answered:
        if answer.place is not None:
            place = answer.place.in_short()
            waypoint = add(root, "wpt", **_at(place.lat, place.lon))
            add(waypoint, "name", title_of(answer))
            add(waypoint, "desc", says_of(answer))
            add(waypoint, "type", "cell")
    write_xml(root, target)


def _root() -> ET.Element:
    return ET.Element("gpx", {"xmlns": NAMESPACE, "version": "1.1", "creator": "cellwalk"})


def _point(segment: ET.Element, fix: Fix) -> None:
    assert fix.lat_deg is not None
    assert fix.lon_deg is not None
    point = add(segment, "trkpt", **_at(fix.lat_deg, fix.lon_deg))
    if fix.alt_m is not None:
        add(point, "ele", decimal(fix.alt_m, 2))
    if fix.utc_ns is not None:
        add(point, "time", moment(fix.utc_ns))
    if fix.sats_used is not None:
        add(point, "sat", fix.sats_used)
    if fix.hdop is not None:
        add(point, "hdop", decimal(fix.hdop, 2))


def _at(lat_deg: float, lon_deg: float) -> dict[str, str]:
    """Position attributes; the schema excludes 180 degrees east, which is the same as west."""
    text = decimal(lon_deg, DECIMALS)
    return {"lat": decimal(lat_deg, DECIMALS), "lon": f"-{text}" if float(text) == 180.0 else text}
