"""The report's table beside the theory, in a terminal."""

from rich.console import Console

from postproc.json_text import Json
from postproc.terminal import print_text, screen, table


def print_theory(found: Json) -> None:
    """The report's table beside the theory."""
    console = screen()
    trials = f"{found['trials']} trials; receivers: {found['receivers']}"
    print_text(console, f"false-alarm rate {found['p_fa']:g}, {trials}")
    rates = ["P_FA direct", "P_FA indirect", "P_D direct", "P_D indirect"]
    titles = ["sigma (m)", "claim sigma (m)", "offset (m)", *rates, "indirect from direct"]
    table(console, titles, [_theory_row(row) for row in found["rows"]])
    print_text(console, "each: theory / simulated", bullet="  ")
    for note in sorted({row["note"] for row in found["rows"] if row["note"]}):
        print_text(console, note, bullet="  ")
    print_text(
        console,
        "\nprinted in the report, and the indirect value that follows from the direct one, "
        "by degrees of freedom",
    )
    titles = ["direct", "indirect", "3 (ours)", "2", "4", "printed - ours"]
    table(console, titles, [_printed_row(pair) for pair in found["printed"]])
    print_text(console, "cannot be known")
    for what in found["cannot_be_known"]:
        print_text(console, what, bullet="  - ")
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
    print_text(
        console,
        f"\nranging by level at {error['distance_m']:g} m, eta {error['eta']:g}, "
        f"{error['sigma_db']:g} dB, {error['offset_db']:g} dB off: "
        f"C = {error['slope_db_per_m']:.4f} dB/m",
    )
    ways = ("{}_m", "exact_{}_m", "simulated_{}_m")
    rows = [
        [f"{name} (m)", *(f"{error[way.format(name)]:.1f}" for way in ways)]
        for name in ("mean", "sigma")
    ]
    titles = ["", "first Taylor term", "exact", "simulated"]
    table(console, titles, rows, right=("exact", "simulated"))
    for law, checks in found["normality"].items():
        for check in checks:
            limit = check["limit_sigmas"]
            values = "all values" if limit is None else f"within {limit:g} sigma"
            result = f"KS {check['distance']:.3f}, p {check['p']:.3f}"
            print_text(console, f"normal? {law.replace('_', ' ')}, {values}: {result}", bullet="  ")


def _rates(rates: Json) -> str:
    return " / ".join("-" if v is None else f"{v:.3f}" for v in rates.values())
