"""Streets of a file: lines of GeoJSON, or tracks and routes of GPX."""

from codecs import BOM_UTF8
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import msgspec

from logger.core.errors import ConfigError, GeoError
from logger.core.geo import check_position
from logger.core.guidance.street_atlas import Line
from logger.core.plain_file import open_plain

_MOST_BYTES = 64 * 1024 * 1024
"""A larger file holds a country; a walker needs a part of a city."""


def read_lines(path: Path) -> list[Line]:
    """Read the lines of a street file as (latitude, longitude) in degrees.

    Raises `ConfigError` for a file that is neither GeoJSON nor GPX, or that has no line.
    """
    try:
        with open_plain(path) as file:
            content = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    if len(content) > _MOST_BYTES:
        raise ConfigError(f"{path} has more than {_MOST_BYTES >> 20} MB: cut out a part of a city")
    content = content.removeprefix(BOM_UTF8)
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
    # expat bounds what entities expand to since 2.4.1
    for element in ET.fromstring(content).iter():  # noqa: S314
        if element.tag.rpartition("}")[2] not in {"trkseg", "rte"}:
            continue
        points = [point.attrib for point in element if "lat" in point.attrib]
        if len(points) > 1:
            yield [(float(point["lat"]), float(point["lon"])) for point in points]
