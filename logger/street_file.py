"""Streets of a file: lines of GeoJSON, or tracks and routes of GPX, as a map in metres."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import msgspec
import numpy as np

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError, GeoError
from logger.core.geo import Utm, check_position
from logger.core.guidance.street_map import StreetMap

FARTHEST_M = 3000.0
"""Streets farther from the first position are left out: no walk of an hour gets there."""
_MOST_BYTES = 64 * 1024 * 1024
"""A larger file holds a country; a walker needs a part of a city."""

Line = list[tuple[float, float]]


def read_lines(path: Path) -> list[Line]:
    """Lines of a street file as (latitude, longitude) in degrees.

    Raises `ConfigError` for a file that is neither GeoJSON nor GPX, or that has no line.
    """
    try:
        content = path.read_bytes() if path.stat().st_size <= _MOST_BYTES else None
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    if content is None:
        raise ConfigError(f"{path} is larger than {_MOST_BYTES >> 20} MB: cut out the part you need")
    try:
        lines = list(_gpx(content) if content.lstrip().startswith(b"<") else _geojson(content))
        for line in lines:
            for lat_deg, lon_deg in line:
                check_position(lat_deg, lon_deg)
    except (ValueError, TypeError, LookupError, AttributeError, ET.ParseError, GeoError) as error:
        raise ConfigError(f"{path} is neither GeoJSON nor GPX with lines: {error}") from error
    if not lines:
        raise ConfigError(f"{path} has no line: streets are LineString (GeoJSON) or trk, rte (GPX)")
    return lines


def street_map(lines: list[Line], utm: Utm, x_m: float, y_m: float) -> StreetMap:
    """The streets within `FARTHEST_M` of a position."""
    return StreetMap(line for one in lines if (line := _near(one, utm, x_m, y_m)) is not None)


def _near(line: Line, utm: Utm, x_m: float, y_m: float) -> FloatArray | None:
    lat_deg, lon_deg = np.array(line, float).T
    line_m = np.stack(utm.to_xy_arrays(lat_deg, lon_deg), axis=1)
    low, high = np.min(line_m, axis=0), np.max(line_m, axis=0)
    here = np.array([x_m, y_m])
    is_far = np.any(low > here + FARTHEST_M) or np.any(high < here - FARTHEST_M)
    return None if is_far else line_m


def _geojson(content: bytes) -> Iterator[Line]:
    document = msgspec.json.decode(content)
    features = document.get("features", [document])
    for feature in features:
        yield from _of_geometry(feature.get("geometry") or feature)


def _of_geometry(geometry: dict[str, Any]) -> Iterator[Line]:
    match geometry.get("type"):
        case "LineString":
            parts = [geometry["coordinates"]]
        case "MultiLineString":
            parts = geometry["coordinates"]
        case "GeometryCollection":
            for one in geometry["geometries"]:
                yield from _of_geometry(one)
            return
        case _:  # buildings, trees: not a way
            return
    for part in parts:
        if len(part) > 1:
            yield [(float(point[1]), float(point[0])) for point in part]


def _gpx(content: bytes) -> Iterator[Line]:
    for element in ET.fromstring(content).iter():
        if element.tag.rpartition("}")[2] in {"trkseg", "rte"}:
            line = [(float(p.attrib["lat"]), float(p.attrib["lon"])) for p in element if "lat" in p.attrib]
            if len(line) > 1:
                yield line
