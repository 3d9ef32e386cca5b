"""Verdicts, the report's table and cells of a database in a terminal, and verdicts as JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table

from postproc.verify.celldb import DbCell
from postproc.verify.run import CellVerdict, Verified
from postproc.verify.sites import Sites

Json = dict[str, Any]

_STYLES = {"consistent": "green", "rejected": "red", "cannot tell": "yellow"}


def _console() -> Console:
    """A terminal as wide as it is; a file or a pipe takes lines of any length."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=200)


def as_dict(verified: Verified) -> Json:
    """What `postproc verify --json` prints; unknown values are null."""
    cells = [asdict(cell) | {"detectable_m": cell.detectable_m} for cell in verified.cells]
    control = "Benjamini-Hochberg over the claims tested: q is p adjusted, rejected where q <= p_fa"
    return asdict(verified) | {"cells": cells, "false_discovery_control": control}


def sites_dict(cell: str, sites: Sites | None, why_not: str | None, p_fa: float) -> Json:
    """What `postproc verify --sites --json` prints."""
    found: Json = {"cell": cell, "verdict": site_verdict(sites, p_fa), "why_not": why_not}
    if sites is not None:
        found |= {"log_factor": sites.log_factor, "p": sites.p, "draws": sites.draws, "places": sites.places_deg}
    return found


def site_verdict(sites: Sites | None, p_fa: float) -> str:
    """In plain words."""
    if sites is None:
        return "no sign of two places"
    return "two places" if sites.p <= p_fa and sites.log_factor > 0.0 else "no sign of two places"


def print_sites(found: Json) -> None:
    """One place or two."""
    console = _console()
    console.print(f"[bold]{found['cell']}[/bold]  {found['verdict']}")
    if found["why_not"]:
        console.print(f"  - {found['why_not']}", markup=False)
        return
    places = " and ".join(f"{lat:.5f} {lon:.5f}" for lat, lon in found["places"])
    console.print(f"  two places against one: log factor {found['log_factor']:.1f}, near {places}")
    console.print(f"  p {found['p']:.3g}: share of {found['draws']} walks drawn past one place with a factor as large")


def print_verified(verified: Verified) -> None:
    """Each claim with its verdict, both tests and what would have been noticed."""
    console = _console()
    for warning in verified.warnings:
        console.print(f"[yellow]{warning}[/yellow]")
    for cell in verified.cells:
        _print_cell(console, cell)
    if verified.without_claim:
        n = len(verified.without_claim)
        console.print(
            f"\n{n} cell{'s' * (n != 1)} heard without a claim: absence from a database is no alarm by itself"
        )
    tested = sum(cell.p is not None for cell in verified.cells)
    if tested:
        console.print(
            f"false-alarm rate {verified.p_fa:g}; false discoveries over {tested} claim{'s' * (tested != 1)} "
            "controlled by Benjamini-Hochberg (q)"
        )


def _print_cell(console: Console, cell: CellVerdict) -> None:
    style, claim = _STYLES[cell.verdict], cell.claim
    console.print(f"\n[bold]{cell.cell}[/bold]  {cell.n} readings  [{style}]{cell.verdict}[/{style}]")
    sigma = f" +- {claim.sigma_m:.0f} m" if claim.sigma_m else ""
    away = f", {cell.distance_m:.0f} m from the walk" if cell.distance_m is not None else ""
    console.print(f"  claimed at {claim.lat_deg:.5f} {claim.lon_deg:.5f}{sigma} ({claim.source}){away}", markup=False)
    for reason in cell.reasons:
        console.print(f"  - {reason}", markup=False)
    if cell.p is None or cell.level is None or cell.q is None:
        return
    console.print(
        f"  direct p {cell.p_direct:.3g}, indirect p {cell.p_indirect:.3g} (the claim lies on the edge of the "
        f"{cell.level:.1%} region); followed: {cell.followed}, q {cell.q:.3g}"
    )
    table = Table(
        "noticed with 95 % (m)", *(f"{one.azimuth_deg:.0f} deg" for one in cell.power), box=None, padding=(0, 1)
    )
    table.add_row("direct", *(_metres(one.direct_m, one.direct_blind_m) for one in cell.power))
    table.add_row("indirect", *(_metres(one.indirect_m, one.indirect_blind_m) for one in cell.power))
    console.print(table)
    if any(one.direct_blind_m or one.indirect_blind_m for one in cell.power):
        console.print("  * farther out in this direction there is a place that would not be noticed")


def _metres(m: float | None, blind_m: float | None) -> str:
    return "none" if m is None else f"{m:.0f}{'*' if blind_m else ''}"


def print_cells(found: Sequence[DbCell]) -> None:
    """Cells of a database."""
    console = _console()
    if not found:
        console.print(
            "not in the database, which is no alarm by itself: it lists what others have seen, not what there is"
        )
        return
    table = Table("cell", "type", "place", "range (m)", "observations", "away (m)", box=None)
    for cell in found:
        name = f"{cell.mcc}-{cell.net}-{cell.area}-{cell.cell}{' (short identity)' if cell.short_cid else ''}"
        away = "-" if cell.distance_m is None else f"{cell.distance_m:.0f}"
        table.add_row(
            name, cell.radio, f"{cell.lat:.5f} {cell.lon:.5f}", _known(cell.range_m), _known(cell.samples), away
        )
    console.print(table)


def _known(value: int | None) -> str:
    return "-" if value is None else str(value)


def print_theory(found: Json) -> None:
    """The report's table beside the theory."""
    console = _console()
    console.print(f"false-alarm rate {found['p_fa']:g}, {found['trials']} trials; receivers: {found['receivers']}")
    table = Table("sigma (m)", "claim sigma (m)", "offset (m)", box=None, padding=(0, 1))
    for title in ("P_FA direct", "P_FA indirect", "P_D direct", "P_D indirect", "indirect from direct"):
        table.add_column(title)
    for row in found["rows"]:
        rates = (row[key] for key in ("false_alarm_direct", "false_alarm_indirect", "direct", "indirect"))
        where = (" ".join(f"{v:g}" for v in row[key]) for key in ("claim_sigma_m", "offset_m"))
        table.add_row(f"{row['sigma_m']:g}", *where, *map(_rates, rates), f"{row['indirect_from_direct']:.3f}")
    console.print(table)
    console.print(
        "  each: theory / simulated", *sorted({row["note"] for row in found["rows"] if row["note"]}), sep="\n  "
    )
    console.print("\nprinted in the report, and the indirect value that the direct one gives by degrees of freedom")
    table = Table("direct", "indirect", "3 (ours)", "2", "4", "printed - ours", box=None, padding=(0, 1))
    for pair in found["printed"]:
        values = (pair[key] for key in ("printed_direct", "printed_indirect"))
        computed = (f"{pair[key]:.3f}" for key in ("dof3", "dof2", "dof4"))
        table.add_row(*(f"{v:.2f}" for v in values), *computed, f"{pair['difference']:+.3f}")
    console.print(table)
    console.print("cannot be known", *found["cannot_be_known"], sep="\n  - ")
    _print_ranging(console, found)


def _print_ranging(console: Console, found: Json) -> None:
    error = found["range_error"]
    console.print(
        f"\nranging by level at {error['distance_m']:g} m, eta {error['eta']:g}, {error['sigma_db']:g} dB, "
        f"{error['offset_db']:g} dB off: C = {error['slope_db_per_m']:.4f} dB/m"
    )
    table = Table("", "first Taylor term", "exact", "simulated", box=None, padding=(0, 1))
    for name in ("mean", "sigma"):
        keys = (f"{name}_m", f"exact_{name}_m", f"simulated_{name}_m")
        table.add_row(f"{name} (m)", *(f"{error[key]:.1f}" for key in keys))
    console.print(table)
    for law, checks in found["normality"].items():
        for check in checks:
            cut = "all values" if check["limit_sigmas"] is None else f"within {check['limit_sigmas']:g} sigma"
            console.print(f"  normal? {law.replace('_', ' ')}, {cut}: KS {check['distance']:.3f}, p {check['p']:.3f}")


def _rates(rates: Json) -> str:
    return " / ".join("-" if v is None else f"{v:.3f}" for v in rates.values())
