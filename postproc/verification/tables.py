"""Verdicts, the report's table and cells of a database in a terminal, and verdicts as JSON."""

from collections.abc import Sequence
from dataclasses import asdict

from msgspec import UNSET
from rich.console import Console

from postproc.json_text import Json
from postproc.terminal import print_text, screen, styled_text, table
from postproc.verification.celldb import DbCell
from postproc.verification.verdicts import CellVerdict, SiteVerdict, Verified

_STYLES = {"consistent": "green", "rejected": "red", "cannot tell": "yellow"}


def as_dict(verified: Verified) -> Json:
    """What `postproc verify --json` prints; unknown values are null."""
    cells = [asdict(cell) | {"detectable_m": cell.detectable_m} for cell in verified.cells]
    control = "Benjamini-Hochberg over the claims tested: q is p adjusted, rejected where q <= p_fa"
    return asdict(verified) | {"cells": cells, "false_discovery_control": control}


def print_sites(tested: SiteVerdict) -> None:
    """One place or two."""
    console = screen()
    print_text(console, styled_text((tested.cell, "bold"), (f"  {tested.verdict}", "")))
    if tested.places is UNSET:
        print_text(console, tested.why_not or "", bullet="  - ")
        return
    places = " and ".join(f"{lat:.5f} {lon:.5f}" for lat, lon in tested.places)
    factor = f"two places against one: log factor {tested.log_factor:.1f}, near {places}"
    print_text(console, factor, bullet="  ")
    p_text = (
        f"p {tested.p:.3g}: share of {tested.draws} walks simulated past one transmitter with "
        "a factor as large"
    )
    print_text(console, p_text, bullet="  ")


def print_verified(verified: Verified) -> None:
    """Each claim with its verdict, p-value and what the test would have detected."""
    console = screen()
    for warning in verified.warnings:
        print_text(console, warning, "yellow")
    for cell in verified.cells:
        _print_cell(console, cell)
    if verified.without_claim:
        n = len(verified.without_claim)
        text = (
            f"{n} cell{'s' * (n != 1)} observed without a claim: absence from a database is no "
            "alarm by itself"
        )
        print_text(console, f"\n{text}")
    if verified.heard_once:
        n = len(verified.heard_once)
        print_text(
            console,
            f"{n} cell{'s' * (n != 1)} observed in one scan only or never without doubt: "
            "not tested",
        )
    tested = sum(cell.p is not None for cell in verified.cells)
    if tested:
        text = (
            f"false-alarm rate {verified.p_fa:g}; false discoveries over {tested} "
            f"claim{'s' * (tested != 1)}"
        )
        print_text(console, f"{text} controlled by Benjamini-Hochberg (q)")


def _print_cell(console: Console, cell: CellVerdict) -> None:
    claim = cell.claim
    verdict = (cell.verdict, _STYLES[cell.verdict])
    print_text(
        console,
        styled_text(("\n", ""), (cell.cell, "bold"), (f"  {cell.n} readings  ", ""), verdict),
    )
    sigma = f" +- {claim.sigma_m:.0f} m" if claim.sigma_m else ""
    away = f", {_distance(cell.distance_m)} from the walk" if cell.distance_m is not None else ""
    at = f"claimed at {claim.lat_deg:.5f} {claim.lon_deg:.5f}{sigma} ({claim.source}){away}"
    print_text(console, at, bullet="  ")
    for reason in cell.reasons:
        print_text(console, reason, bullet="  - ")
    if cell.p is None or cell.level is None or cell.q is None:
        return
    tests = (
        f"p {cell.p:.3g} (the claim lies on the edge of the {cell.level:.1%} region), "
        f"q {cell.q:.3g}"
    )
    print_text(console, tests, bullet="  ")
    titles = ["detected with 95 % (m)", *(f"{one.azimuth_deg:.0f} deg" for one in cell.power)]
    rows = [
        ["  displacement", *(_metres(one.indirect_m, one.indirect_blind_m) for one in cell.power)]
    ]
    table(console, titles, rows, right=titles[1:])
    if any(one.indirect_blind_m for one in cell.power):
        print_text(
            console,
            "* farther out in this direction a displacement would not be detected",
            bullet="  ",
        )


def _distance(m: float) -> str:
    return f"{m:.0f} m" if m < 10_000.0 else f"{m / 1000.0:.0f} km"


def _metres(m: float | None, blind_m: float | None) -> str:
    return "none" if m is None else f"{m:.0f}{'*' if blind_m else ''}"


def print_cells(cells: Sequence[DbCell]) -> None:
    """Cells of a database."""
    console = screen()
    if not cells:
        text = (
            "not in the database, which is no alarm by itself: it lists what others have "
            "observed, not what exists"
        )
        print_text(console, text)
        return
    rows = []
    for cell in cells:
        short = " (short identity)" if cell.short_cid else ""
        name = f"{cell.mcc}-{cell.net}-{cell.area}-{cell.cell}{short}"
        away = "-" if cell.distance_m is None else f"{cell.distance_m:.0f}"
        position = f"{cell.lat:.5f} {cell.lon:.5f}"
        rows.append(
            [
                name,
                cell.radio,
                position,
                _number_text(cell.range_m),
                _number_text(cell.samples),
                away,
            ]
        )
    titles = ["cell", "type", "position", "range (m)", "observations", "away (m)"]
    table(console, titles, rows, right=titles[3:])


def _number_text(value: int | None) -> str:
    return "-" if value is None else str(value)
