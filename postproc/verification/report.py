"""What `postproc verify` and `postproc celldb lookup` say."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict

from msgspec import UNSET

from logger.core.document import (
    Column,
    Degrees,
    Document,
    Line,
    Part,
    Table,
    Value,
    Word,
    degrees_text,
)
from postproc.verification.celldb import DbCell
from postproc.verification.verdicts import CellVerdict, SiteVerdict, Verified

_CONTROL = "Benjamini-Hochberg over the claims tested: q is p adjusted, rejected where q <= p_fa"
_CELL_COLUMNS = (
    Column("cell"),
    Column("type"),
    Column("position"),
    Column("range", ".0f", "m"),
    Column("observations", "d"),
    Column("away", ".0f", "m"),
)


def document_of(verified: Verified) -> Document:
    """Each claim with its verdict, its p-value and what the test would have detected."""
    cells = [asdict(cell) | {"detectable_m": cell.detectable_m} for cell in verified.cells]
    content = asdict(verified) | {"cells": cells, "false_discovery_control": _CONTROL}
    return Document(content, warnings=verified.warnings, body=_verified_parts(verified))


def _verified_parts(verified: Verified) -> Iterator[Part]:
    for cell in verified.cells:
        yield from _cell_parts(cell)
    if verified.without_claim:
        absent = "absence from a database is no alarm by itself"
        yield f"\n{_cells(len(verified.without_claim))} observed without a claim: {absent}"
    if verified.heard_once:
        once = "observed in one scan only or never without doubt: not tested"
        yield f"{_cells(len(verified.heard_once))} {once}"
    tested = sum(cell.p is not None for cell in verified.cells)
    if tested:
        over = f"false discoveries over {tested} claim{'s' * (tested != 1)}"
        yield f"false-alarm rate {verified.p_fa:g}; {over} controlled by Benjamini-Hochberg (q)"


def _cells(n: int) -> str:
    return f"{n} cell{'s' * (n != 1)}"


def _cell_parts(cell: CellVerdict) -> Iterator[Part]:
    claim = cell.claim
    yield ""
    yield Line((Word(cell.cell, "bold"), f"  {cell.n} readings  ", Word(cell.verdict)))
    sigma = f" +- {claim.sigma_m:.0f} m" if claim.sigma_m else ""
    away = f", {_distance(cell.distance_m)} from the walk" if cell.distance_m is not None else ""
    at = f"claimed at {degrees_text(claim.lat_deg, claim.lon_deg)}{sigma} ({claim.source}){away}"
    yield Line(at, bullet="  ")
    for reason in cell.reasons:
        yield Line(reason, bullet="  - ")
    if cell.p is None or cell.level is None or cell.q is None:
        return
    edge = f"the claim lies on the edge of the {cell.level:.1%} region"
    yield Line(f"p {cell.p:.3g} ({edge}), q {cell.q:.3g}", bullet="  ")
    columns = [
        Column("detected with 95 %", unit="m"),
        *(Column(f"{one.azimuth_deg:.0f} deg", ".0f") for one in cell.power),
    ]
    detected = (_metres(one.indirect_m, one.indirect_blind_m) for one in cell.power)
    yield Table(columns, [["  displacement", *detected]])
    if any(one.indirect_blind_m for one in cell.power):
        blind = "* farther out in this direction a displacement would not be detected"
        yield Line(blind, bullet="  ")


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
    share = f"share of {tested.draws} walks simulated past one transmitter with a factor as large"
    yield Line(f"p {tested.p:.3g}: {share}", bullet="  ")


def document_of_cells(cells: Sequence[DbCell]) -> Document:
    """Cells of a database."""
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
