"""GPX 1.1: the walk as a track with a segment for each stretch, positions of cells as waypoints.

The format allows only times in UTC, so times are left out where the receiver never reported UTC.
"""

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from logger.core.types import Fix
from postproc.interop.estimates import DECIMALS, Estimate
from postproc.interop.exporting import ExportWalk
from postproc.interop.fields import moment
from postproc.interop.xml_file import add, decimal
from postproc.interop.xml_file import write as write_xml

NAMESPACE = "http://www.topografix.com/GPX/1/1"

HAS_ESTIMATES = True


def write(walk: ExportWalk, estimates: Sequence[Estimate], target: Path) -> None:
    """Track and waypoints."""
    root = ET.Element("gpx", {"xmlns": NAMESPACE, "version": "1.1", "creator": "cellwalk"})
    for estimate in estimates:
        for position in estimate.positions:
            waypoint = add(root, "wpt", **_at(position.lon_lat[1], position.lon_lat[0]))
            add(waypoint, "name", f"{estimate.cell} {position.name}")
            share = (
                "" if position.probability is None else f", probability {position.probability:.2f}"
            )
            radii = f", {position.radii_text}" if position.radii_m else ""
            about = position.verdict or "not the answer, for comparison"
            add(waypoint, "desc", f"{about}{share}{radii}")
            add(waypoint, "type", "estimate")
    track = add(root, "trk")
    add(track, "name", "walk")
    if not walk.has_utc:
        add(track, "desc", "UTC is not known, so the points have no time")
    for stretch in walk.track:
        segment = add(track, "trkseg")
        for _, fix in stretch:
            _point(segment, fix)
    write_xml(root, target)


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
