"""Cells of OpenCelliD and Mozilla exports in one indexed SQLite file.

Each cell has one row: of several rows of one identity it is the one last updated. Positions are
looked up by belts of a hundredth of a degree of latitude, in each of which the index is ordered by
longitude. A database lists where others observed cells, not which cells exist: absence is
never an alarm by itself.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import cos, floor, radians
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import Geod

from logger.core.cell_names import identity_of
from logger.core.document import Column, Degrees, Document, Table, Value
from logger.core.errors import ConfigError, GeoError, RunFileError
from logger.core.places import check_position
from logger.sqlite_file import connect

FARTHEST_M = 200_000.0

_BELTS_PER_DEG = 100
_METRES_PER_DEG = 110_500.0
_SHORT_CID = 1 << 16
APPLICATION_ID = 0x43574442
_GEOD = Geod(ellps="WGS84")
BELT = "CAST((lat + 90) * 100 AS INTEGER)"
_FIELDS = "radio, mcc, net, area, cell, lat, lon, range_m, samples, updated_s"

_CELL_COLUMNS = (
    Column("cell"),
    Column("type"),
    Column("position"),
    Column("range", ".0f", "m"),
    Column("observations", "d"),
    Column("away", ".0f", "m"),
)


@dataclass(frozen=True, slots=True)
class DbCell:
    """A cell of the database; `updated_s` is Unix time, `samples` the number of observations.

    `distance_m` is that from the requested position, None for a search by identity. `short_cid`
    means that only the lower 16 bits of the identity match, which is all that some 3G
    modems print.
    """

    radio: str
    mcc: int
    net: int
    area: int
    cell: int
    lat: float
    lon: float
    range_m: int | None
    samples: int | None
    updated_s: int | None
    distance_m: float | None = None
    short_cid: bool = False


class CellDb:
    """A database open for reading; raises `RunFileError` for a file that is none."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._db = open_celldb(path)

    def __len__(self) -> int:
        with _damage_named(self.path):
            return int(self._db.execute("SELECT count(*) FROM cell").fetchone()[0])

    def close(self) -> None:
        """Release the file."""
        self._db.close()

    def by_identity(self, name: str) -> list[DbCell]:
        """Cells with the identity `mcc-mnc-area-cid`, of any radio.

        Raises `ConfigError` for what is no identity.

        Where there is none, cells of the area whose lower 16 bits are those of a short identity.
        """
        identity = identity_of(name)
        if identity is None:
            raise ConfigError(
                f"{name!r} is no cell: mcc-mnc-area-cid is wanted, like 262-01-801-86355"
            )
        same = "mcc = ? AND net = ? AND area = ?"
        cells = self._cells(f"{same} AND cell = ?", identity)
        if cells or identity[3] >= _SHORT_CID:
            return cells
        short = self._cells(f"{same} AND cell & 65535 = ? AND radio = 'UMTS'", identity)
        return [replace(cell, short_cid=True) for cell in short]

    def near(
        self, lat_deg: float, lon_deg: float, radius_m: float, most: int = 100
    ) -> list[DbCell]:
        """Cells within a radius, nearest first.

        Raises `ConfigError` for a radius beyond 200 km, `GeoError` for no position.
        """
        check_position(lat_deg, lon_deg)
        if not 0.0 < radius_m <= FARTHEST_M:
            raise ConfigError(
                f"a radius lies between 0 and {FARTHEST_M / 1000:.0f} km, not at {radius_m:g} m"
            )
        reach_deg = radius_m / _METRES_PER_DEG
        narrowest = cos(radians(min(abs(lat_deg) + reach_deg, 89.9)))
        belts = range(_belt(lat_deg - reach_deg), _belt(lat_deg + reach_deg) + 1)
        inside: list[DbCell] = []
        for low, high in _longitude_intervals(lon_deg, reach_deg / narrowest):
            for belt in belts:
                inside += self._cells(f"{BELT} = ? AND lon BETWEEN ? AND ?", (belt, low, high))
        if not inside:
            return []
        n = len(inside)
        away_m = _GEOD.inv(
            np.full(n, lon_deg),
            np.full(n, lat_deg),
            [cell.lon for cell in inside],
            [cell.lat for cell in inside],
        )[2]
        order = [i for i in np.argsort(away_m) if away_m[i] <= radius_m][:most]
        return [replace(inside[i], distance_m=float(away_m[i])) for i in order]

    def _cells(self, where: str, values: tuple[Any, ...]) -> list[DbCell]:
        with _damage_named(self.path):
            rows = self._db.execute(f"SELECT {_FIELDS} FROM cell WHERE {where}", values).fetchall()  # noqa: S608
            return [_cell_of(*row) for row in rows]


def _cell_of(
    radio: str,
    mcc: int,
    net: int,
    area: int,
    cell: int,
    lat: float,
    lon: float,
    *more: int | None,
) -> DbCell:
    """A row as a cell; raises ValueError or TypeError for values that the import never writes."""
    check_position(float(lat), float(lon))
    range_m, samples, updated_s = (value if isinstance(value, int) else None for value in more)
    return DbCell(
        str(radio),
        int(mcc),
        int(net),
        int(area),
        int(cell),
        lat,
        lon,
        range_m=range_m,
        samples=samples,
        updated_s=updated_s,
    )


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    """What a damaged file raises, a text that is none among it, as one `RunFileError`."""
    try:
        yield
    except (sqlite3.Error, GeoError, TypeError, ValueError, OverflowError) as error:
        raise RunFileError(f"{path} is damaged: {error}; import the exports again") from error


def open_celldb(path: Path) -> sqlite3.Connection:
    if not path.is_file():
        raise RunFileError(f"{path}: no such file")
    try:
        db = connect(path)
        if db.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID:
            db.close()
            raise RunFileError(f"{path} is no cell database; `postproc celldb import` makes one")
    except (sqlite3.Error, ValueError) as error:
        raise RunFileError(f"{path} is no cell database: {error}") from error
    return db


def _belt(lat_deg: float) -> int:
    return floor((min(max(lat_deg, -90.0), 90.0) + 90.0) * _BELTS_PER_DEG)


def _longitude_intervals(lon_deg: float, reach_deg: float) -> list[tuple[float, float]]:
    """Intervals of longitude, two where they cross the date line."""
    low, high = lon_deg - reach_deg, lon_deg + reach_deg
    if reach_deg >= 180.0:
        return [(-180.0, 180.0)]
    if low < -180.0:
        return [(-180.0, high), (low + 360.0, 180.0)]
    if high > 180.0:
        return [(low, 180.0), (-180.0, high - 360.0)]
    return [(low, high)]


def document_of_cells(cells: Sequence[DbCell]) -> Document:
    """What `postproc celldb lookup` says."""
    content = {"cells": cells, "absence_is_an_alarm": False}
    if not cells:
        absent = (
            "not in the database, which is no alarm by itself: it lists what others have "
            "observed, not what exists"
        )
        return Document(content, body=[absent])
    return Document(content, body=[Table(_CELL_COLUMNS, [_cell_row(cell) for cell in cells])])


def _cell_row(cell: DbCell) -> tuple[Value, ...]:
    short = " (short identity)" if cell.short_cid else ""
    name = f"{cell.mcc}-{cell.net}-{cell.area}-{cell.cell}{short}"
    position = Degrees(cell.lat, cell.lon)
    return name, cell.radio, position, cell.range_m, cell.samples, cell.distance_m
