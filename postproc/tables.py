"""Results of `smooth` in a terminal: a line for each cell, and all that is known of those that were
asked for.
"""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from logger.core.locator.rivals import share_text
from postproc.json_text import Json
from postproc.terminal import Cell, fits, say, screen, styled, table

TITLES = {
    "batch": "least squares",
    "ekf": "EKF",
    "ekf_backward": "EKF backward",
    "rts": "RTS",
    "reference_ekf": "reference EKF*",
}
_STYLES = {"located": "green", "ambiguous": "yellow", "cannot tell": "red"}
_ORDER = tuple(_STYLES)


def print_summary(found: Json, *, details: bool) -> None:
    """What was found, as `results` gives it: one line for each cell, or with `details` all that is
    known of it.
    """
    console = screen()
    runs = found.get("runs") or [found["run"]]
    _print_warnings(console, runs, found.get("warnings", ()))
    cells = sorted(found["cells"], key=lambda cell: _ORDER.index(cell["verdict"]))
    if not cells:
        return
    if not details:
        _print_lines(console, cells)
        say(
            console,
            "\nThe reasons and all details of one cell: --cell NAME; of every cell: -v",
            "dim",
        )
        return
    for cell in cells:
        _print_cell(console, cell)
    if any(cell["reference_ekf"]["lat"] is not None for cell in cells):
        says = "the specification's filter, kept for reference: its place and its ellipse are not to be trusted"
        say(console, f"\n* {says}")


def _print_warnings(console: Console, runs: Sequence[Json], warnings: Sequence[str]) -> None:
    if any(run["simulated"] for run in runs):
        say(console, "This is a simulated run: the error to the known truth is shown.")
    for run in runs:
        which = f"{run['path']}: " if len(runs) > 1 else ""
        for warning in run["warnings"]:
            say(console, f"{which}{warning}", "red")
    for warning in warnings:
        say(console, warning, "yellow")


def _print_lines(console: Console, cells: Sequence[Json]) -> None:
    """One line for each cell, or one sentence where a line is too short for that."""
    simulated = any(cell["truth"] for cell in cells)
    titles = [
        "cell",
        "readings",
        "verdict",
        "place",
        "95 % within",
        *(["error"] if simulated else []),
    ]
    rows = [_in_one_line(cell) for cell in cells]
    if fits(console, titles, rows):
        table(console, titles, rows, right=("readings", "95 % within", "error"))
        return
    for cell in cells:
        say(console, _in_one_sentence(cell), bullet="- ")


def _in_one_sentence(cell: Json) -> Text:
    name, n, verdict, place, within, off = map(str, _in_one_line(cell))
    where = {"located": f" at {place}, 95 % within {within}", "ambiguous": f", {place}"}.get(
        cell["verdict"], ""
    )
    more = f"{where}, {n} readings{f', error {off}' if off else ''}"
    return styled((f"{name}: ", ""), (verdict, _STYLES[cell["verdict"]]), (more, ""))


def _in_one_line(cell: Json) -> list[Cell]:
    verdict = Text(cell["verdict"], _STYLES[cell["verdict"]])
    place, within = "", ""
    if cell["verdict"] == "located":
        place, within = _place(cell["best"]), _metres(cell["best"]["r95_m"])
    elif cell["verdict"] == "ambiguous":
        place = f"{sum(mode['percent'] is not None for mode in cell['modes'])} places"
    truth = cell["truth"]
    known = cell["verdict"] == "located" and truth is not None and truth["error_m"] is not None
    off = [_metres(truth["error_m"]) if known and truth else ""]
    return [cell["cell"], str(cell["n"]), verdict, place, within, *off]


def _print_cell(console: Console, cell: Json) -> None:
    verdict = (cell["verdict"], _STYLES[cell["verdict"]])
    in_scans = (
        ""
        if cell["n_scans"] is None
        else f", heard in {cell['n_scans']} scan{'s' * (cell['n_scans'] != 1)}"
    )
    say(
        console,
        styled(
            ("\n", ""), (cell["cell"], "bold"), (f"  {cell['n']} readings{in_scans}  ", ""), verdict
        ),
    )
    for warning in cell["warnings"]:
        say(console, warning, bullet="  - ")
    _print_estimators(console, cell)
    if timing := cell.get("timing"):
        says = f"timing advance: read at {timing['places']} places, {timing['disagree']} disagree"
        say(console, says, bullet="  ")
    if cell.get("without"):
        _print_by_run(console, cell)
    _print_truth(console, cell["truth"])


def _print_estimators(console: Console, cell: Json) -> None:
    rows: list[list[str]] = []
    if cell["best"]["lat"] is not None:
        rows.append(
            _row("posterior", cell["best"] | {"n": cell["n"]}, f"r {cell['best']['r95_m']:.0f}")
        )
    for i, mode in enumerate(cell["modes"], 1):
        share = (
            f"{mode['percent']}%"
            if mode["percent"] is not None
            else share_text(mode["probability"])
        )
        rows.append([f"  place {i}: {share}", _place(mode), _axes(mode["ellipse95"])])
    for name, title in TITLES.items():
        if cell[name]["converged"] is False:
            rows.append([title, "did not converge"])
        elif cell[name]["lat"] is not None:
            bounded = cell[name].get("bounded") is not False
            rows.append(
                _row(
                    title,
                    cell[name],
                    _axes(cell[name]["ellipse95"]) if bounded else "",
                    bounded=bounded,
                )
            )
    table(console, ["estimator", "place", "95 % (m)", "P0 (dBm)", "eta", "n"], rows, right=("n",))


def _row(title: str, e: Json, extent: str, *, bounded: bool = True) -> list[str]:
    """What a fit without bounds says of its own uncertainty is no number."""
    if not bounded:
        return [title, _place(e), "no bounds", f"{e['p0_dbm']:.1f}", f"{e['eta']:.2f}", str(e["n"])]
    power = f"{e['p0_dbm']:.1f} ± {e['p0_sigma_db']:.1f}"
    return [title, _place(e), extent, power, f"{e['eta']:.2f} ± {e['eta_sigma']:.2f}", str(e["n"])]


def _print_by_run(console: Console, cell: Json) -> None:
    """What each run gave: its level against the first, and the answer without it."""
    rows = []
    for gave, without in zip(cell["offsets"], cell["without"], strict=True):
        best, offset = without["best"], gave["offset_db"]
        level = (
            "-"
            if offset is None
            else f"{offset:+.1f} ± {gave['sigma_db']:.1f}"
            if gave["sigma_db"]
            else "0"
        )
        place = (_place(best), f"r {best['r95_m']:.0f}") if best else ("-", "-")
        rows.append([gave["run"], str(gave["n"]), level, *place, without["verdict"]])
    table(
        console, ["run", "n", "reads (dB)", "without it", "95 % (m)", "verdict"], rows, right=("n",)
    )


def _place(e: Json) -> str:
    return f"{e['lat']:.5f} {e['lon']:.5f}"


def _axes(ellipse: Json) -> str:
    return f"{ellipse['semi_major_m']:.0f} x {ellipse['semi_minor_m']:.0f}"


def _metres(m: float) -> str:
    return f"{m:.0f} m"


def _print_truth(console: Console, truth: Json | None) -> None:
    if truth is not None and truth["error_m"] is not None:
        inside = "inside" if truth["inside_region95"] else "OUTSIDE"
        says = (
            f"truth: best place is {truth['error_m']:.0f} m off, truth is {inside} the 95 % region"
        )
        say(console, says, bullet="  ")
