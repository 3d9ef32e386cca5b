"""Results and runs as tables in a terminal."""

from rich.console import Console
from rich.table import Table

from postproc.info import Info
from postproc.results import Json

TITLES = {
    "batch": "least squares",
    "ekf": "EKF",
    "ekf_backward": "EKF backward",
    "rts": "RTS",
    "reference_ekf": "reference EKF*",
}
_STYLES = {"located": "green", "ambiguous": "yellow", "cannot tell": "red"}


def _console() -> Console:
    """A terminal as wide as it is; a file or a pipe takes lines of any length."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=200)


def print_info(info: Info) -> None:
    """A run on one screen."""
    console = _console()
    console.print(f"[bold]{info.path}[/bold] ({info.form}), {info.origin}{', SIMULATED' if info.simulated else ''}")
    console.print(f"started  {info.started_utc or 'at an unknown time (GPS never told it)'}, {info.duration_s:.0f} s")
    console.print(f"stopped  {info.stopped or 'not: the plug was pulled, or it is still being recorded'}")
    if info.missing_frames or info.skipped_bytes:
        console.print(f"[red]damage   {info.missing_frames} frames missing, {info.skipped_bytes} bytes damaged[/red]")
    console.print(f"fixes    {info.n_fixes}, {info.n_fixes_valid} with a position")
    console.print(
        f"readings {info.n_readings} in {info.n_scans} scans, {info.n_readings_without_fix} without a fix, "
        f"{info.n_readings_without_identity} of cells that were not decoded"
    )
    console.print(f"live     {info.n_live} estimates; raw {info.n_raw_bytes} bytes")
    for gap in info.gaps[:20]:
        console.print(f"gap      no {gap.of} for {gap.length_s:.0f} s at +{gap.start_s:.0f} s")
    _print_cells(console, info)
    for event in info.events:
        style = {"warning": "yellow", "error": "red"}.get(event.level, "dim")
        console.print(f"+{event.t_s:.0f} s  {event.source}: {event.text}", style=style, markup=False)


def _print_cells(console: Console, info: Info) -> None:
    table = Table("cell", "type", "readings", "strongest", box=None)
    for cell in info.cells:
        strongest = "-" if cell.strongest_dbm is None else f"{cell.strongest_dbm:.0f} dBm"
        table.add_row(cell.cell, cell.rat or "-", str(cell.n), strongest)
    if info.cells:
        console.print(table)


def print_summary(found: Json) -> None:
    """Each cell with its answer, and the estimators side by side; `found` as `results` gives it."""
    console = _console()
    runs = found.get("runs") or [found["run"]]
    if any(run["simulated"] for run in runs):
        console.print("This is a simulated run: the table shows the error to the known truth.")
    for run in runs:
        which = f"{run['path']}: " if len(runs) > 1 else ""
        for warning in run["warnings"]:
            console.print(f"[red]cannot tell: {which}{warning}[/red]")
    for warning in found.get("warnings", ()):
        console.print(f"[yellow]{warning}[/yellow]")
    for cell in found["cells"]:
        _print_cell(console, cell)
    if any(cell["reference_ekf"]["lat"] is not None for cell in found["cells"]):
        console.print(
            "\n* the specification's filter, kept for reference: its place and its ellipse are not to be trusted"
        )


def _print_cell(console: Console, cell: Json) -> None:
    style = _STYLES[cell["verdict"]]
    console.print(f"\n[bold]{cell['cell']}[/bold]  {cell['n']} readings  [{style}]{cell['verdict']}[/{style}]")
    for warning in cell["warnings"]:
        console.print(f"  - {warning}", markup=False)
    console.print(_estimators(cell))
    if timing := cell.get("timing"):
        console.print(f"  timing advance: read at {timing['places']} places, {timing['disagree']} disagree")
    if cell.get("without"):
        console.print(_by_run(cell))
    _print_truth(console, cell["truth"])


def _estimators(cell: Json) -> Table:
    table = Table("estimator", "place", "95 % (m)", "P0 (dBm)", "eta", "n", box=None, padding=(0, 1), pad_edge=False)
    for column in table.columns:
        column.no_wrap = True
    if cell["best"]["lat"] is not None:
        _add(table, "posterior", cell["best"] | {"n": cell["n"]}, f"r {cell['best']['r95_m']:.0f}")
    for i, mode in enumerate(cell["modes"], 1):
        table.add_row(f"  place {i}: {mode['probability']:.0%}", _place(mode), _axes(mode["ellipse95"]))
    for name, title in TITLES.items():
        if cell[name]["lat"] is not None:
            _add(table, title, cell[name], _axes(cell[name]["ellipse95"]))
    return table


def _by_run(cell: Json) -> Table:
    """What each run gave: its level against the first, and the answer without it."""
    table = Table("run", "n", "reads (dB)", "without it", "95 % (m)", "", box=None, padding=(0, 1), pad_edge=False)
    for gave, without in zip(cell["offsets"], cell["without"], strict=True):
        best, offset = without["best"], gave["offset_db"]
        level = "-" if offset is None else f"{offset:+.1f} ± {gave['sigma_db']:.1f}" if gave["sigma_db"] else "0"
        place = (_place(best), f"r {best['r95_m']:.0f}") if best else ("-", "-")
        table.add_row(gave["run"], str(gave["n"]), level, *place, without["verdict"])
    return table


def _add(table: Table, title: str, e: Json, extent: str) -> None:
    power = f"{e['p0_dbm']:.1f} ± {e['p0_sigma_db']:.1f}"
    exponent = f"{e['eta']:.2f} ± {e['eta_sigma']:.2f}"
    table.add_row(title, _place(e), extent, power, exponent, str(e["n"]))


def _place(e: Json) -> str:
    return f"{e['lat']:.5f} {e['lon']:.5f}"


def _axes(ellipse: Json) -> str:
    return f"{ellipse['semi_major_m']:.0f} x {ellipse['semi_minor_m']:.0f}"


def _print_truth(console: Console, truth: Json | None) -> None:
    if truth is not None and truth["error_m"] is not None:
        inside = "inside" if truth["inside_region95"] else "OUTSIDE"
        console.print(f"  truth: best place is {truth['error_m']:.0f} m off, truth is {inside} the 95 % region")
