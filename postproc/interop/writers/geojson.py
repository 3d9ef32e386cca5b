"""GeoJSON (RFC 7946): the walk and every level as a point, or the cells; (lon, lat), WGS 84."""

import json
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from logger.core.document import Table
from postproc.interop.exporting import Answered, ExportWalk
from postproc.interop.sighting import Sighting, moment, seconds
from postproc.outlines import DECIMALS, lines

Feature = dict[str, Any]


def write(walk: ExportWalk, target: Path) -> None:
    """One feature collection; `kind` is walk or level."""
    levels = (_level(one, walk.start_ns) for one in walk.sightings)
    _write(chain([_walk(walk)], levels), target)


def write_answers(_: Sequence[Answered], table: Table, target: Path) -> None:
    """A point for each cell; one without a place has no geometry (RFC 7946, 3.2)."""
    names = [column.title for column in table.columns]
    _write((_answer(dict(zip(names, row, strict=True))) for row in table.rows), target)


def _write(features: Iterable[Feature], target: Path) -> None:
    with target.open("w", encoding="utf-8") as file:
        file.write('{"type": "FeatureCollection", "features": [')
        for i, feature in enumerate(features):
            file.write(
                (",\n" if i else "\n") + json.dumps(feature, allow_nan=False, ensure_ascii=False)
            )
        file.write("\n]}\n")


def _answer(properties: Feature) -> Feature:
    at = properties["longitude_deg"], properties["latitude_deg"]
    geometry = None if None in at else _point(at)
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _walk(walk: ExportWalk) -> Feature:
    parts = [
        part
        for stretch in walk.track
        for part in lines([_place(fix.lon_deg, fix.lat_deg) for _, fix in stretch])
    ]
    first, last = walk.track[0][0], walk.track[-1][-1]
    properties: Feature = {
        "kind": "walk",
        "t_s": [seconds(t_ns - walk.start_ns) for t_ns in (first[0], last[0])],
    }
    properties |= {
        "utc": [moment(fix.utc_ns) for _, fix in (first, last)] if walk.has_utc else None
    }
    geometry = (
        {"type": "MultiLineString", "coordinates": parts}
        if parts
        else _point(_place(first[1].lon_deg, first[1].lat_deg))
    )
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _level(one: Sighting, start_ns: int) -> Feature:
    cell = one.reading
    properties = {
        "kind": "level",
        "cell": cell.cell,
        "rat": cell.rat,
        "level_dbm": one.rssi_dbm,
        "t_s": seconds(one.t_ns - start_ns),
        "utc": None if one.fix.utc_ns is None else moment(one.fix.utc_ns),
        "acc_m": one.fix.acc_m,
    }
    return {
        "type": "Feature",
        "geometry": _point(_place(one.lon_deg, one.lat_deg)),
        "properties": properties,
    }


def _point(lon_lat: tuple[float, float]) -> dict[str, Any]:
    return {"type": "Point", "coordinates": lon_lat}


def _place(lon_deg: float | None, lat_deg: float | None) -> tuple[float, float]:
    assert lon_deg is not None
    assert lat_deg is not None
    return round(lon_deg, DECIMALS), round(lat_deg, DECIMALS)
