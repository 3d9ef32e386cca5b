"""GeoJSON (RFC 7946): the walk, every level as a point, and the estimates; (lon, lat), WGS 84."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from postproc.interop.estimates import DECIMALS, Estimate, Rings, lines
from postproc.interop.exporting import ExportWalk
from postproc.interop.fields import moment, seconds
from postproc.interop.sighting import Sighting

Feature = dict[str, Any]

HAS_ESTIMATES = True


def write(walk: ExportWalk, estimates: Sequence[Estimate], target: Path) -> None:
    """One feature collection; `kind` is walk, level, region, place or ellipse95."""
    with target.open("w", encoding="utf-8") as file:
        file.write('{"type": "FeatureCollection", "features": [')
        for i, feature in enumerate(_features(walk, estimates)):
            file.write(
                (",\n" if i else "\n") + json.dumps(feature, allow_nan=False, ensure_ascii=False)
            )
        file.write("\n]}\n")


def _features(walk: ExportWalk, estimates: Sequence[Estimate]) -> Iterator[Feature]:
    yield _walk(walk)
    for one in walk.sightings:
        yield _level(one, walk.start_ns)
    for estimate in estimates:
        yield from _estimate(estimate)


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


def _estimate(estimate: Estimate) -> Iterator[Feature]:
    about: Feature = {"cell": estimate.cell, "verdict": estimate.verdict}
    for level, outline in estimate.regions.items():
        yield _area(outline, {"kind": "region", "level_percent": level, **about})
    for position in estimate.positions:
        named = {
            "name": position.name,
            "probability": position.probability,
            "cell": estimate.cell,
            "verdict": position.verdict,
        }
        radii_m = dict(zip(("r50_m", "r95_m"), position.radii_m or (), strict=False))
        yield {
            "type": "Feature",
            "geometry": _point(_place(*position.lon_lat)),
            "properties": {"kind": "place", **named, **radii_m},
        }
        if position.ellipse95:
            yield _area(position.ellipse95, {"kind": "ellipse95", **named})


def _area(outline: Sequence[Rings], properties: Feature) -> Feature:
    geometry = {"type": "MultiPolygon", "coordinates": outline}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _point(lon_lat: tuple[float, float]) -> dict[str, Any]:
    return {"type": "Point", "coordinates": lon_lat}


def _place(lon_deg: float | None, lat_deg: float | None) -> tuple[float, float]:
    assert lon_deg is not None
    assert lat_deg is not None
    return round(lon_deg, DECIMALS), round(lat_deg, DECIMALS)
