"""Claimed positions, from an option, a CSV, a cell export or database; and verdicts on them."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from msgspec import UNSET, Struct, UnsetType

from logger.core.cell_names import identity_of, with_hint
from logger.core.certainty import OnMap
from logger.core.document import (
    Column,
    Document,
    Line,
    Part,
    Table,
    Value,
    Word,
    degrees_text,
    number_of,
)
from logger.core.errors import ConfigError, GeoError, RunFileError
from logger.core.places import MAX_LATITUDE_DEG, check_position, position_of
from logger.sqlite_file import is_sqlite
from postproc import csv_table
from postproc.foreign_file import with_limit
from postproc.ground import apart_m
from postproc.verification.celldb import CellDb, cell_export

RANGE_SIGMA = 0.5
"""Sigma of a position in an export by its `range`, the greatest distance at which the cell was
observed: the position is the centre of these observations, not that of the transmitter.
"""
UNKNOWN_SIGMA_M = 1000.0
"""Sigma of a position in an export without a range."""
_MOST_SIGMA_M = 1e6
_MOST = 100_000
"""Claims about cells of the runs: more than a city has cells."""
_COLUMNS = ("cell", "lat", "lon")


@dataclass(frozen=True, slots=True)
class Claim:
    """Claimed position of a cell with a standard deviation per axis; `cell` None: every cell."""

    cell: str | None
    lat_deg: float
    lon_deg: float
    sigma_m: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        if not 0.0 <= self.sigma_m <= _MOST_SIGMA_M:
            raise ConfigError(
                f"the sigma of a claim is a number of metres, zero or larger, not {self.sigma_m:g}"
            )

    @property
    def at(self) -> OnMap:
        """The place."""
        return OnMap(lat=self.lat_deg, lon=self.lon_deg)


_REACH_KM = 50.0
"""A GSM cell is received within 35 km, and a walk has its own length."""


def swap_hint(claim: Claim, walk: OnMap) -> str | None:
    """Question whether the claim's latitude and longitude were exchanged.

    None where the claim can be received from the walk, or is far away either way.
    """
    swapped = OnMap(lat=claim.lon_deg, lon=claim.lat_deg)
    if not abs(swapped.lat) <= MAX_LATITUDE_DEG:
        return None
    claimed_km, other_km = (apart_m((at, walk)) / 1000.0 for at in (claim.at, swapped))
    if claimed_km <= _REACH_KM or other_km > _REACH_KM:
        return None
    meant = f"{round(swapped.lat, 7)},{round(swapped.lon, 7)}"
    return f"did you mean {meant}? It is near the walk; the claim is off by {claimed_km:.0f} km"


def parse_claim(text: str, cell: str | None) -> Claim:
    """LAT,LON[,SIGMA_M]; raises as `position_of`."""
    at, sigma_m = position_of(text, "SIGMA_M")
    return Claim(cell, at.lat, at.lon, sigma_m or 0.0, "command line")


def read_claims(path: Path, wanted: Sequence[str]) -> tuple[list[Claim], list[str]]:
    """Claims about cells, from a file, and the other cells of our CSV (cell, lat, lon[, sigma_m]).

    Raises `RunFileError` for a file that contains none, `ConfigError` for a bad claim.
    """
    if is_sqlite(path):
        with closing(CellDb(path)) as database:
            return claims_of(database, wanted), []
    with csv_table.text_lines(path) as lines:
        names = csv_table.names_of(next(lines, ""))
    if set(_COLUMNS) <= set(names) and "radio" not in names:
        others: dict[str, None] = {}
        rows = _of_csv(path, wanted, others)
        return list(with_limit(rows, path, "claims", _MOST)), list(others)
    return _of_export(path, wanted), []


def _of_csv(path: Path, wanted: Sequence[str], others: dict[str, None]) -> Iterator[Claim]:
    for line, row in csv_table.rows(path):
        if csv_table.TOO_MANY in row:
            raise RunFileError(f"{path}: line {line} has more values than the header has columns")
        if row["cell"] in wanted:
            yield _own(row, path, line)
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
    return min(RANGE_SIGMA * range_m, _MOST_SIGMA_M) if range_m else UNKNOWN_SIGMA_M


def _check(claim: Claim) -> Claim:
    check_position(claim.lat_deg, claim.lon_deg)
    return claim


# --- verdicts ---

Verdict = Literal["consistent", "rejected", "cannot tell"]
Followed = Literal["indirect"]
_MOST_NAMES = 8
LEAST_P = 0.0005
"""Smaller p-values only order claims: 2000 true ones are drawn."""
_CONTROL = "Benjamini-Hochberg over the claims tested: q is p adjusted, rejected where q <= p_fa"


@dataclass(frozen=True, slots=True)
class Detectable:
    """Smallest displacement towards an azimuth that is rejected with 95 %.

    None where none up to `limit_m` is.

    `indirect_blind_m` is a larger one that is not, such as the mirror image of a straight walk, if
    any. `direct_m` and `direct_blind_m` are of a test that is no longer made.
    """

    azimuth_deg: float
    indirect_m: float | None
    indirect_blind_m: float | None
    limit_m: float
    direct_m: None = None
    direct_blind_m: None = None


@dataclass(frozen=True, slots=True)
class CellVerdict:
    """One claim about one cell; values are None where they cannot be computed, `reasons` say why.

    `p` is the p-value of the claim in the posterior, also named `p_indirect` (Verma et al.: the
    test that `followed` names), and `q` the same adjusted for the number of claims. `level` is that
    of the smallest highest-density region that contains the claim, `distance_m` the claim's from
    the walk, `best_deg` the best position (latitude, longitude). `notices_m` is the least
    displacement that is rejected with 95 %, whatever its direction. `p_direct`, `p_direct_model`,
    `p_indirect_model` and `normality` are of tests that are no longer made. `error` is the error of
    the program that ended the test, if any.
    """

    cell: str
    n: int
    claim: Claim
    verdict: Verdict
    reasons: tuple[str, ...]
    followed: Followed | None = None
    p: float | None = None
    q: float | None = None
    p_direct: None = None
    p_indirect: float | None = None
    p_direct_model: None = None
    p_indirect_model: None = None
    level: float | None = None
    distance_m: float | None = None
    best_deg: tuple[float, float] | None = None
    power: tuple[Detectable, ...] = ()
    notices_m: float | None = None
    normality: tuple[()] = ()
    error: str | None = None

    @property
    def detectable_m(self) -> list[float | None]:
        """Least displacement that the test rejects with probability 0.95, by direction."""
        return [direction.indirect_m for direction in self.power]


@dataclass(frozen=True, slots=True)
class Verified:
    """Verdicts on all claims of a run.

    `without_claim` are cells observed that no claim is about, which is no alarm; `heard_once` are
    cells identified in one scan only or never without doubt, which are not tested; `not_observed`
    are cells of a file of claims that the runs lack.
    """

    p_fa: float
    cells: tuple[CellVerdict, ...]
    without_claim: tuple[str, ...]
    warnings: tuple[str, ...]
    heard_once: tuple[str, ...] = ()
    not_observed: tuple[str, ...] = ()

    def of_cell(self, cell: str) -> list[CellVerdict]:
        """Verdicts on a cell."""
        return [verdict for verdict in self.cells if verdict.cell == cell]

    @property
    def not_observed_text(self) -> str:
        """Their first names."""
        names, more = self.not_observed[:_MOST_NAMES], len(self.not_observed) - _MOST_NAMES
        if not names:
            return ""
        observed = {*(one.cell for one in self.cells), *self.without_claim, *self.heard_once}
        said = ", ".join(with_hint(name, sorted(observed)) for name in names)
        which = said + (f" and {more} more" if more > 0 else "")
        return f"claimed but not observed, so not tested: {which}"


class SiteVerdict(Struct, kw_only=True):
    """Whether a cell has one transmitter or two, as `postproc verify --sites --json` prints it.

    `places` are latitude and longitude of the two likeliest positions; `log_factor` is the log
    Bayes factor of two against one, and `p` the share of `draws` walks simulated past one
    transmitter that have one as large. They are left out where `why_not` says why there is no test.
    `error` is the error of the program that ended it, if any.
    """

    cell: str
    verdict: Literal["two places", "no sign of two places"]
    why_not: str | None = None
    log_factor: float | UnsetType = UNSET
    p: float | UnsetType = UNSET
    draws: int | UnsetType = UNSET
    places: list[tuple[float, float]] | UnsetType = UNSET
    error: str | UnsetType = UNSET


def p_text(p: float) -> str:
    """A p-value, no smaller than is known."""
    return f"below {LEAST_P:g}" if p < LEAST_P else f"{p:.3g}"


def document_of(verified: Verified) -> Document:
    """Each claim with verdict, p-value and what the test would have detected."""
    cells = [asdict(cell) | {"detectable_m": cell.detectable_m} for cell in verified.cells]
    content = asdict(verified) | {"cells": cells, "false_discovery_control": _CONTROL}
    return Document(content, warnings=verified.warnings, body=_verified_parts(verified))


def _verified_parts(verified: Verified) -> Iterator[Part]:
    for cell in verified.cells:
        yield from _cell_parts(cell)
    if verified.without_claim:
        absent = "absence from a database is no alarm by itself"
        cells = number_of(len(verified.without_claim), "cell")
        yield f"\n{cells} observed without a claim: {absent}"
    if verified.heard_once:
        once = "observed in one scan only or never without doubt: not tested"
        yield f"{number_of(len(verified.heard_once), 'cell')} {once}"
    if verified.not_observed:
        yield verified.not_observed_text
    if not (verified.cells or verified.without_claim or verified.heard_once):
        yield "no cell was observed: no claim is tested"
    tested = sum(cell.p is not None for cell in verified.cells)
    if tested:
        over = f"false discoveries over {number_of(tested, 'claim')}"
        yield f"false-alarm rate {verified.p_fa:g}; {over} controlled by Benjamini-Hochberg (q)"


def _cell_parts(cell: CellVerdict) -> Iterator[Part]:
    claim = cell.claim
    yield ""
    # what the walk can tell comes before what it says
    n_first = cell.p is not None
    first = "".join(f": {notices}" for notices in cell.reasons[:n_first])
    yield Line((Word(cell.cell, "bold"), f"  {number_of(cell.n, 'reading')}{first}"))
    sigma = f" +- {claim.sigma_m:.0f} m" if claim.sigma_m else ""
    away = f", {_distance(cell.distance_m)} from the walk" if cell.distance_m is not None else ""
    at = f"claimed at {degrees_text(claim.lat_deg, claim.lon_deg)}{sigma} ({claim.source}){away}"
    yield Line((Word(cell.verdict), f": {at}"), bullet="  ")
    for reason in cell.reasons[n_first:]:
        yield Line(reason, bullet="  - ")
    if cell.p is None or cell.level is None or cell.q is None:
        return
    edge = f"the claim lies on the edge of the {_level_text(cell.level)} region"
    yield Line(f"p {p_text(cell.p)} ({edge}), q {p_text(cell.q)}", bullet="  ")
    columns = [
        Column("detected with 95 %", unit="m"),
        *(Column(f"{one.azimuth_deg:.0f} deg", ".0f") for one in cell.power),
    ]
    detected = (_metres(one.indirect_m, one.indirect_blind_m) for one in cell.power)
    yield Table(columns, [["  displacement", *detected]])
    if any(one.indirect_blind_m for one in cell.power):
        blind = "* farther out in this direction a displacement would not be detected"
        yield Line(blind, bullet="  ")


def _level_text(level: float) -> str:
    return "> 99.9 %" if level > 1.0 - 1e-3 else f"{100.0 * level:.1f} %"


def _distance(m: float) -> str:
    return f"{m:.0f} m" if m < 10_000.0 else f"{m / 1000.0:.0f} km"


def _metres(m: float | None, blind_m: float | None) -> Value:
    return "none" if m is None else f"{m:.0f}*" if blind_m else m


def document_of_sites(cells: Sequence[SiteVerdict], p_fa: float) -> Document:
    """One place or two, cell by cell."""
    parts = [part for cell in cells for part in _site_parts(cell)]
    return Document({"p_fa": p_fa, "cells": cells}, body=parts)


def _site_parts(tested: SiteVerdict) -> Iterator[Part]:
    yield Line((Word(tested.cell, "bold"), f"  {tested.verdict}"))
    if tested.places is UNSET:
        yield Line(tested.why_not or "", bullet="  - ")
        return
    places = " and ".join(degrees_text(*place) for place in tested.places)
    factor = f"two places against one: log factor {tested.log_factor:.1f}, near {places}"
    yield Line(factor, bullet="  ")
    if tested.draws:  # none where one transmitter explains the levels as well
        share = f"share of {tested.draws} walks simulated past one transmitter"
        yield Line(f"p {tested.p:.3g}: {share} with a factor as large", bullet="  ")
