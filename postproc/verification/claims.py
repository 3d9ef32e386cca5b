"""Claimed positions: from the command line, a CSV of our own, a cell export, or a cell database."""

import csv
import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from pyproj import Geod

from logger.core.cell_names import identity_of
from logger.core.errors import ConfigError, GeoError, RunFileError
from logger.core.places import MAX_LATITUDE_DEG, check_position
from logger.sqlite_file import is_sqlite
from postproc.foreign_file import Lines, text_lines, with_limit
from postproc.verification.celldb import CellDb, cell_export

RANGE_SIGMA = 0.5
"""Sigma of a position in an export by its `range`, the greatest distance at which the cell was
observed: the position is the centre of these observations, not that of the transmitter.
"""
UNKNOWN_SIGMA_M = 1000.0
"""Sigma of a position in an export without a range."""
_MOST = 100_000
"""Claims about cells of the runs: more than a city has cells."""
_COLUMNS = ("cell", "lat", "lon")
_GEOD = Geod(ellps="WGS84")


@dataclass(frozen=True, slots=True)
class Claim:
    """Claimed position of a cell with a standard deviation per axis; `cell` None: every cell."""

    cell: str | None
    lat_deg: float
    lon_deg: float
    sigma_m: float = 0.0
    source: str = ""


_REACH_KM = 50.0
"""A GSM cell is received within 35 km, and a walk has its own length."""


def away_m(one_deg: tuple[float, float], other_deg: tuple[float, float]) -> float:
    """Distance on the Earth between two positions (latitude, longitude)."""
    return float(_GEOD.inv(one_deg[1], one_deg[0], other_deg[1], other_deg[0])[2])


def swap_hint(claim: Claim, walk_deg: tuple[float, float]) -> str | None:
    """Question whether the claim's latitude and longitude were exchanged.

    `walk_deg` is that of the walk. None where the claim can be received, or
    is far away either way.
    """
    lat_deg, lon_deg = claim.lon_deg, claim.lat_deg
    if not abs(lat_deg) <= MAX_LATITUDE_DEG:
        return None
    claimed_km, other_km = (
        away_m(one, walk_deg) / 1000.0
        for one in ((claim.lat_deg, claim.lon_deg), (lat_deg, lon_deg))
    )
    if claimed_km <= _REACH_KM or other_km > _REACH_KM:
        return None
    near = (
        f"at {lat_deg:.5f} {lon_deg:.5f} it would be {max(other_km, 1.0):.0f} km or less from "
        "the walk"
    )
    return f"latitude and longitude swapped? {near} instead of {claimed_km:.0f} km"


def parse_claim(text: str, cell: str | None) -> Claim:
    """LAT,LON[,SIGMA_M]; raises `ConfigError`."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in {2, 3} or not all(map(math.isfinite, values)):
        raise ConfigError(f"{text!r} is no claim: LAT,LON or LAT,LON,SIGMA_M is wanted")
    return _check(
        Claim(cell, values[0], values[1], values[2] if len(values) == 3 else 0.0, "command line")
    )


def read_claims(path: Path, wanted: Sequence[str]) -> tuple[list[Claim], list[str]]:
    """Claims about cells, from a file, and the other cells of our CSV (cell, lat, lon[, sigma_m]).

    Raises `RunFileError` for a file that contains none, `ConfigError` for a bad claim.
    """
    if is_sqlite(path):
        with closing(CellDb(path)) as database:
            return claims_of(database, wanted), []
    try:
        with text_lines(path) as lines:
            reader = csv.DictReader(lines)
            names = [name.strip().lower() for name in reader.fieldnames or ()]
            if set(_COLUMNS) <= set(names) and "radio" not in names:
                reader.fieldnames = names
                others: dict[str, None] = {}
                rows = _of_csv(reader, lines, path, wanted, others)
                return list(with_limit(rows, path, "claims", _MOST)), list(others)
    except csv.Error as error:
        raise RunFileError(f"{path} is no CSV file: {error}") from error
    return _of_export(path, wanted), []


def _of_csv(
    reader: "csv.DictReader[str]",
    lines: Lines,
    path: Path,
    wanted: Sequence[str],
    others: dict[str, None],
) -> Iterator[Claim]:
    for row in reader:
        lines.end_row()
        if row["cell"] in wanted:
            yield _own(row, path, lines.number)
        elif row["cell"] and len(others) < _MOST:
            others[row["cell"]] = None


def _own(row: dict[str, str], path: Path, line: int) -> Claim:
    try:
        lat_deg, lon_deg = _number(row, "lat"), _number(row, "lon")
        sigma_m = _number(row, "sigma_m") if row.get("sigma_m") else 0.0
        return _check(Claim(row["cell"], lat_deg, lon_deg, sigma_m, f"{path} line {line}"))
    except (ValueError, ConfigError, GeoError) as error:
        raise RunFileError(f"{path}: line {line}: {error}") from error


def _number(row: dict[str, str], name: str) -> float:
    try:
        return float(row[name] or "")
    except ValueError:
        raise ValueError(f"{name} is no number: {row[name] or ''!r}") from None


def claims_of(database: CellDb, observed: Sequence[str]) -> list[Claim]:
    """Claims about the observed cells that a database knows; raises `RunFileError` for damage."""
    claims = []
    for name in observed:
        if identity_of(name) is not None:
            known = database.by_identity(name)
            if known:
                cell = max(known, key=lambda row: row.samples or 0)
                how = " (by the lower 16 bits of its identity)" if cell.short_cid else ""
                where = f"{database.path}{how}"
                claims.append(Claim(name, cell.lat, cell.lon, _sigma_m(cell.range_m), where))
    return claims


def _of_export(path: Path, observed: Sequence[str]) -> list[Claim]:
    wanted = {identity: name for name in observed if (identity := identity_of(name)) is not None}
    claims: dict[str, Claim] = {}
    with cell_export(path) as export:
        column = export.column
        for row in export.rows:
            try:
                mcc, net, area, cell = (
                    int(row[column[key]]) for key in ("mcc", "net", "area", "cell")
                )
                name = wanted.get((mcc, net, area, cell))
                if name is None:
                    continue
                span = row[column["range"]] if "range" in column else ""
                sigma_m = _sigma_m(int(span) if span.isdigit() else None)
                claims[name] = _check(
                    Claim(
                        name,
                        float(row[column["lat"]]),
                        float(row[column["lon"]]),
                        sigma_m,
                        str(path),
                    )
                )
            except (ValueError, IndexError, GeoError):
                continue  # a row of an export that names no cell or no position
    return list(claims.values())


def _sigma_m(range_m: int | None) -> float:
    return RANGE_SIGMA * range_m if range_m else UNKNOWN_SIGMA_M


def _check(claim: Claim) -> Claim:
    try:
        check_position(claim.lat_deg, claim.lon_deg)
    except GeoError as error:
        if abs(claim.lat_deg) <= 180.0 and abs(claim.lon_deg) <= MAX_LATITUDE_DEG < abs(
            claim.lat_deg
        ):
            raise GeoError(f"{error}; latitude and longitude swapped?") from error
        raise
    if not 0.0 <= claim.sigma_m < 1e6:
        raise ConfigError(
            f"the sigma of a claim is a number of metres, zero or larger, not {claim.sigma_m:g}"
        )
    return claim
