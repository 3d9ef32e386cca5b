"""Verdicts, the report's table and cells of a database in a terminal, and verdicts as JSON."""

from collections.abc import Sequence
from dataclasses import asdict

from rich.console import Console

from postproc.json_text import Json
from postproc.terminal import say, screen, styled, table
from postproc.verification.celldb import DbCell
from postproc.verification.clone_test import Sites
from postproc.verification.run_claims import CellVerdict, Verified

_STYLES = {"consistent": "green", "rejected": "red", "cannot tell": "yellow"}


def as_dict(verified: Verified) -> Json:
    """What `postproc verify --json` prints; unknown values are null."""
    cells = [asdict(cell) | {"detectable_m": cell.detectable_m} for cell in verified.cells]
    control = "Benjamini-Hochberg over the claims tested: q is p adjusted, rejected where q <= p_fa"
    return asdict(verified) | {"cells": cells, "false_discovery_control": control}


def sites_dict(cell: str, sites: Sites | None, why_not: str | None, p_fa: float) -> Json:
    """What `postproc verify --sites --json` prints."""
    found: Json = {"cell": cell, "verdict": site_verdict(sites, p_fa), "why_not": why_not}
    if sites is not None:
        found |= {
            "log_factor": sites.log_factor,
            "p": sites.p,
            "draws": sites.draws,
            "places": sites.places_deg,
        }
    return found


def site_verdict(sites: Sites | None, p_fa: float) -> str:
    """In plain words."""
    if sites is None:
        return "no sign of two places"
    return "two places" if sites.p <= p_fa and sites.log_factor > 0.0 else "no sign of two places"


def print_sites(found: Json) -> None:
    """One place or two."""
    console = screen()
    say(console, styled((found["cell"], "bold"), (f"  {found['verdict']}", "")))
    if found["why_not"]:
        say(console, found["why_not"], bullet="  - ")
        return
    places = " and ".join(f"{lat:.5f} {lon:.5f}" for lat, lon in found["places"])
    factor = f"two places against one: log factor {found['log_factor']:.1f}, near {places}"
    say(console, factor, bullet="  ")
    drawn = f"p {found['p']:.3g}: share of {found['draws']} walks drawn past one place with a factor as large"
    say(console, drawn, bullet="  ")


def print_verified(verified: Verified) -> None:
    """Each claim with its verdict, both tests and what would have been noticed."""
    console = screen()
    for warning in verified.warnings:
        say(console, warning, "yellow")
    for cell in verified.cells:
        _print_cell(console, cell)
    if verified.without_claim:
        n = len(verified.without_claim)
        says = f"{n} cell{'s' * (n != 1)} heard without a claim: absence from a database is no alarm by itself"
        say(console, f"\n{says}")
    if verified.heard_once:
        n = len(verified.heard_once)
        say(
            console, f"{n} cell{'s' * (n != 1)} heard in one scan only or never surely: passed over"
        )
    tested = sum(cell.p is not None for cell in verified.cells)
    if tested:
        says = f"false-alarm rate {verified.p_fa:g}; false discoveries over {tested} claim{'s' * (tested != 1)}"
        say(console, f"{says} controlled by Benjamini-Hochberg (q)")


def _print_cell(console: Console, cell: CellVerdict) -> None:
    claim = cell.claim
    verdict = (cell.verdict, _STYLES[cell.verdict])
    say(console, styled(("\n", ""), (cell.cell, "bold"), (f"  {cell.n} readings  ", ""), verdict))
    sigma = f" +- {claim.sigma_m:.0f} m" if claim.sigma_m else ""
    away = f", {_distance(cell.distance_m)} from the walk" if cell.distance_m is not None else ""
    at = f"claimed at {claim.lat_deg:.5f} {claim.lon_deg:.5f}{sigma} ({claim.source}){away}"
    say(console, at, bullet="  ")
    for reason in cell.reasons:
        say(console, reason, bullet="  - ")
    if cell.p is None or cell.level is None or cell.q is None:
        return
    tests = (
        f"direct p {cell.p_direct:.3g}, indirect p {cell.p_indirect:.3g} (the claim lies on the edge of the "
        f"{cell.level:.1%} region); followed: {cell.followed}, q {cell.q:.3g}"
    )
    say(console, tests, bullet="  ")
    titles = ["noticed with 95 % (m)", *(f"{one.azimuth_deg:.0f} deg" for one in cell.power)]
    rows = [
        ["  direct", *(_metres(one.direct_m, one.direct_blind_m) for one in cell.power)],
        ["  indirect", *(_metres(one.indirect_m, one.indirect_blind_m) for one in cell.power)],
    ]
    table(console, titles, rows, right=titles[1:])
    if any(one.direct_blind_m or one.indirect_blind_m for one in cell.power):
        say(
            console,
            "* farther out in this direction there is a place that would not be noticed",
            bullet="  ",
        )


def _distance(m: float) -> str:
    return f"{m:.0f} m" if m < 10_000.0 else f"{m / 1000.0:.0f} km"


def _metres(m: float | None, blind_m: float | None) -> str:
    return "none" if m is None else f"{m:.0f}{'*' if blind_m else ''}"


def print_cells(found: Sequence[DbCell]) -> None:
    """Cells of a database."""
    console = screen()
    if not found:
        says = "not in the database, which is no alarm by itself: it lists what others have seen, not what there is"
        say(console, says)
        return
    rows = []
    for cell in found:
        name = f"{cell.mcc}-{cell.net}-{cell.area}-{cell.cell}{' (short identity)' if cell.short_cid else ''}"
        away = "-" if cell.distance_m is None else f"{cell.distance_m:.0f}"
        place = f"{cell.lat:.5f} {cell.lon:.5f}"
        rows.append([name, cell.radio, place, _known(cell.range_m), _known(cell.samples), away])
    titles = ["cell", "type", "place", "range (m)", "observations", "away (m)"]
    table(console, titles, rows, right=titles[3:])


def _known(value: int | None) -> str:
    return "-" if value is None else str(value)


def print_theory(found: Json) -> None:
    """The report's table beside the theory."""
    console = screen()
    trials = f"{found['trials']} trials; receivers: {found['receivers']}"
    say(console, f"false-alarm rate {found['p_fa']:g}, {trials}")
    rates = ["P_FA direct", "P_FA indirect", "P_D direct", "P_D indirect"]
    titles = ["sigma (m)", "claim sigma (m)", "offset (m)", *rates, "indirect from direct"]
    table(console, titles, [_theory_row(row) for row in found["rows"]])
    say(console, "each: theory / simulated", bullet="  ")
    for note in sorted({row["note"] for row in found["rows"] if row["note"]}):
        say(console, note, bullet="  ")
    says = "printed in the report, and the indirect value that the direct one gives by degrees of freedom"
    say(console, f"\n{says}")
    titles = ["direct", "indirect", "3 (ours)", "2", "4", "printed - ours"]
    table(console, titles, [_printed_row(pair) for pair in found["printed"]])
    say(console, "cannot be known")
    for what in found["cannot_be_known"]:
        say(console, what, bullet="  - ")
    _print_ranging(console, found)


def _theory_row(row: Json) -> list[str]:
    rates = (
        row[key] for key in ("false_alarm_direct", "false_alarm_indirect", "direct", "indirect")
    )
    where = (" ".join(f"{v:g}" for v in row[key]) for key in ("claim_sigma_m", "offset_m"))
    return [
        f"{row['sigma_m']:g}",
        *where,
        *map(_rates, rates),
        f"{row['indirect_from_direct']:.3f}",
    ]


def _printed_row(pair: Json) -> list[str]:
    values = (pair[key] for key in ("printed_direct", "printed_indirect"))
    computed = (f"{pair[key]:.3f}" for key in ("dof3", "dof2", "dof4"))
    return [*(f"{v:.2f}" for v in values), *computed, f"{pair['difference']:+.3f}"]


def _print_ranging(console: Console, found: Json) -> None:
    error = found["range_error"]
    says = (
        f"ranging by level at {error['distance_m']:g} m, eta {error['eta']:g}, {error['sigma_db']:g} dB, "
        f"{error['offset_db']:g} dB off: C = {error['slope_db_per_m']:.4f} dB/m"
    )
    say(console, f"\n{says}")
    rows = [
        [
            f"{name} (m)",
            *(
                f"{error[key]:.1f}"
                for key in (f"{name}_m", f"exact_{name}_m", f"simulated_{name}_m")
            ),
        ]
        for name in ("mean", "sigma")
    ]
    table(
        console, ["", "first Taylor term", "exact", "simulated"], rows, right=("exact", "simulated")
    )
    for law, checks in found["normality"].items():
        for check in checks:
            cut = (
                "all values"
                if check["limit_sigmas"] is None
                else f"within {check['limit_sigmas']:g} sigma"
            )
            what = f"normal? {law.replace('_', ' ')}, {cut}: KS {check['distance']:.3f}, p {check['p']:.3f}"
            say(console, what, bullet="  ")


def _rates(rates: Json) -> str:
    return " / ".join("-" if v is None else f"{v:.3f}" for v in rates.values())
