"""Where a transmitter can stand, from the options of a user: metres around the walk, or a file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import shapely

from logger.core.errors import ConfigError, GeoError
from logger.core.foreign import decode_json, read_regular
from logger.core.model.area import Area, Polygon, Ring
from logger.core.places import check_position

_MOST_BYTES, _MOST_CORNERS = 8 << 20, 20_000
"""A border of a city has some thousand corners; each is compared with each position."""

_THIN = 1e-4
"""Width by length of what is no more than a line."""

_Position = Annotated[list[float], msgspec.Meta(min_length=2)]


class _GeoJson(msgspec.Struct):
    type: str
    coordinates: msgspec.Raw = msgspec.Raw(b"null")
    geometry: "_GeoJson | None" = None
    features: "list[_GeoJson]" = []
    geometries: "list[_GeoJson]" = []


def area_of(within_walk_m: float | None, file: Path | str | None) -> Area | None:
    """The area that a user gives; raises `ConfigError` for a wrong file, and for both."""
    if within_walk_m is not None and file is not None:
        raise ConfigError("--within-walk is not allowed with --area")
    if file is not None:
        return read_area(Path(file))
    if within_walk_m is None:
        return None
    if not within_walk_m > 0.0:
        raise ConfigError(f"within {within_walk_m:g} m of the walk there is no place")
    return Area.within_walk(within_walk_m)


def read_area(path: Path) -> Area:
    """The polygons of a GeoJSON file; raises `ConfigError` for one that has none."""
    try:
        whole = decode_json(read_regular(path, _MOST_BYTES), _GeoJson)
        polygons = tuple(polygon for one in _geometries(whole) for polygon in _polygons(one))
        for polygon in polygons:
            _check(polygon)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    except (msgspec.DecodeError, RecursionError) as error:
        raise ConfigError(f"{path} is no GeoJSON with polygons: {error}") from error
    except (ValueError, GeoError) as error:
        raise ConfigError(f"{path}: {error}") from error
    if not polygons:
        raise ConfigError(f"{path} has no polygon: an area is a Polygon or a MultiPolygon")
    n_corners = sum(len(ring) for polygon in polygons for ring in polygon)
    if n_corners > _MOST_CORNERS:
        raise ConfigError(
            f"{path} has {n_corners} corners, of which {_MOST_CORNERS} are allowed: simplify it"
        )
    return Area(f"inside {path.name}", polygons=polygons)


def _geometries(part: _GeoJson) -> Iterator[_GeoJson]:
    if part.type in {"FeatureCollection", "GeometryCollection"}:
        for one in (*part.features, *part.geometries):
            yield from _geometries(one)
    elif part.type == "Feature":
        if part.geometry is not None:
            yield from _geometries(part.geometry)
    else:
        yield part


def _polygons(geometry: _GeoJson) -> list[Polygon]:
    if geometry.type not in {"Polygon", "MultiPolygon"}:
        raise ValueError(f"a {geometry.type[:20]} is no area: use a Polygon or a MultiPolygon")
    text = geometry.coordinates
    if geometry.type == "Polygon":
        text = msgspec.Raw(b"[%b]" % bytes(text))
    found = msgspec.json.decode(text, type=list[list[list[_Position]]])
    return [
        tuple(tuple((lon_deg, lat_deg) for lon_deg, lat_deg, *_ in ring) for ring in polygon)
        for polygon in found
    ]


def _encloses_anything(ring: Ring) -> bool:
    corners = np.array(ring) - ring[0]
    large, small = np.linalg.svd(corners, compute_uv=False)
    return bool(small > _THIN * large)


def _check(polygon: Polygon) -> None:
    for ring in polygon:
        if len(set(ring)) < 3:
            raise ValueError("a ring of a polygon has at least three corners")
        for lon_deg, lat_deg in ring:
            check_position(lat_deg, lon_deg)
        if not _encloses_anything(ring):
            raise ValueError("the corners of a polygon lie on one line")
        if shapely.is_valid_reason(shapely.Polygon(ring)).startswith("Self-intersection"):
            raise ValueError("the border of a polygon crosses itself: corners are in their order")
    if not polygon:
        raise ValueError("a polygon has no ring")
