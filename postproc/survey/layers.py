"""Estimates as GeoParquet and GeoPackage, for DuckDB, GeoPandas and QGIS."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import geopandas as gpd
import msgspec
import pandas as pd
import shapely

from logger.core.types import known_utc_text
from postproc.atomic_write import whole_file
from postproc.survey.agreement import LoggerReport
from postproc.survey.cell_location import LocatedCell

_WGS84 = "EPSG:4326"


_TIMES = {"first_utc_ns": "first_utc", "last_utc_ns": "last_utc"}
_COLUMNS = [
    _TIMES.get(name, name)
    for name in LocatedCell.__struct_fields__
    if name not in {"region_wkb", "runs"}
]


def files_of(stem: Path) -> tuple[Path, Path]:
    """STEM.parquet and STEM.gpkg; a dot in the name begins no suffix."""
    name = stem.stem if stem.suffix in {".parquet", ".gpkg"} else stem.name
    return stem.with_name(f"{name}.parquet"), stem.with_name(f"{name}.gpkg")


def write_layers(
    cells: Sequence[LocatedCell], loggers: Sequence[LoggerReport], files: tuple[Path, Path]
) -> None:
    """Write the `files_of` a stem; raises `RunFileError` where that is impossible.

    The GeoParquet file has a row for each cell with two geometries: `position`, the primary one,
    and `region`, its 95 % region. The GeoPackage has the layers `cells` (points), `regions` and the
    table `loggers`.
    """
    table = pd.DataFrame([_row(cell) for cell in cells], columns=_COLUMNS)
    points = [
        None
        if cell.lat_deg is None or cell.lon_deg is None
        else shapely.Point(cell.lon_deg, cell.lat_deg)
        for cell in cells
    ]
    regions = [shapely.from_wkb(cell.region_wkb) if cell.region_wkb else None for cell in cells]
    parquet, package = files
    frame = gpd.GeoDataFrame(
        table.assign(region=gpd.GeoSeries(regions, crs=_WGS84)),
        geometry=gpd.GeoSeries(points, crs=_WGS84),
    ).rename_geometry("position")
    with whole_file(parquet) as part:
        frame.to_parquet(part, index=False)
    with whole_file(package) as part:
        _write_package(frame, loggers, part)


def _write_package(frame: gpd.GeoDataFrame, loggers: Sequence[LoggerReport], target: Path) -> None:
    target.unlink(missing_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GDAL dislikes the suffix of an unfinished file
        points = frame.drop(columns="region")
        points.to_file(target, layer="cells", driver="GPKG", index=False)
        regions = frame.set_geometry("region").drop(columns="position")
        regions.to_file(target, layer="regions", driver="GPKG", index=False)
        table = pd.DataFrame(loggers, columns=LoggerReport._fields)
        gpd.GeoDataFrame(table, geometry=[None] * len(table), crs=_WGS84).to_file(
            target, layer="loggers", driver="GPKG", index=False
        )


def _row(cell: LocatedCell) -> Mapping[str, Any]:
    row = msgspec.structs.asdict(cell)
    del row["region_wkb"], row["runs"]
    row["reasons"] = "; ".join(cell.reasons)
    row["word_reasons"] = "; ".join(cell.word_reasons)
    row["word_rules"] = " ".join(cell.word_rules)
    row["offsets"] = msgspec.json.encode(cell.offsets).decode()
    for name_ns, name in _TIMES.items():
        row[name] = known_utc_text(row.pop(name_ns))
    return row
