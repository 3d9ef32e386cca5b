"""The summary of `smooth` in a terminal: a line per cell, or every detail of the cells."""

from collections.abc import Sequence
from functools import partial

from msgspec import UNSET
from rich.console import Console
from rich.text import Text

from logger.core.answer import Mode, Position
from logger.core.ellipse import RADII, Ellipse
from logger.core.locator.alternatives import alternatives_text
from logger.core.locator.rivals import share_text
from postproc.cell_work import Failure, attempt
from postproc.result import ESTIMATORS, REFERENCE
from postproc.result_json import (
    Best,
    Cell,
    FinalState,
    LeastSquares,
    RunSummary,
    Summary,
    SummaryOfRun,
    TruthCheck,
)
from postproc.terminal import fits, print_text, screen, styled_text, table

_COLUMNS = ("likely", "surely")
"""Short for `RADII`, so that a line fits into 80 columns."""
_STYLES = {"located": "green", "ambiguous": "yellow", "cannot tell": "red"}
_ORDER = tuple(_STYLES)
_REFERENCE_NOTE = (
    "the filter of the specification, for comparison: neither its position nor its ellipse can be "
    "trusted"
)


def print_summary(summary: Summary, *, details: bool) -> list[Failure]:
    """One line for each cell, or with `details` its reasons and every estimator.

    Returns what could not be printed.
    """
    console = screen()
    if isinstance(summary, SummaryOfRun):
        _print_warnings(console, [summary.run], [])
    else:
        _print_warnings(console, summary.runs, summary.warnings)
    cells = sorted(summary.cells, key=lambda cell: _ORDER.index(cell.verdict))
    if not cells:
        return []
    if not details:
        failures = _print_lines(console, cells)
        more = "The reasons and all details of one cell: --cell NAME; of every cell: -v"
        print_text(console, f"\n{more}", "dim")
        return failures
    printed = [
        attempt(cell.cell, "its details", partial(_print_cell, console, cell)) for cell in cells
    ]
    failures = [failure for failure in printed if failure is not None]
    for failure in failures:
        _print_failure(console, failure.cell, failure.reason)
    if any(cell.reference_ekf.lat is not None for cell in cells):
        print_text(console, f"\n* {_REFERENCE_NOTE}")
    return failures


def _print_failure(console: Console, cell: str, reason: str) -> None:
    print_text(console, styled_text((f"{cell}: ", ""), (reason, "red")))


def _print_warnings(console: Console, runs: Sequence[RunSummary], warnings: Sequence[str]) -> None:
    if any(run.simulated for run in runs):
        print_text(console, "This is a simulated run: the error to the known truth is shown.")
    for run in runs:
        which = f"{run.path}: " if len(runs) > 1 else ""
        for warning in run.warnings:
            print_text(console, f"{which}{warning}", "red")
    for warning in warnings:
        print_text(console, warning, "yellow")


def _print_lines(console: Console, cells: Sequence[Cell]) -> list[Failure]:
    """One line for each cell, or one sentence where the terminal is too narrow for the table.

    Below stands why an estimate failed.
    """
    titles = ["cell", "readings", "verdict", "position", *_COLUMNS]
    if any(cell.truth for cell in cells):
        titles.append("error")
    lines = [attempt(cell.cell, "its line", partial(_line, cell)) for cell in cells]
    failures = [line for line in lines if isinstance(line, Failure)]
    rows = [
        _line_without_answer(cell) if isinstance(line, Failure) else line
        for cell, line in zip(cells, lines, strict=True)
    ]
    if fits(console, titles, rows):
        table(console, titles, rows, right=("readings", *_COLUMNS, "error"))
    else:
        for row in rows:
            print_text(console, _sentence(row), bullet="- ")
    for cell in cells:
        for reason in cell.warnings if cell.error else ():
            _print_failure(console, cell.cell, reason)
    for failure in failures:
        _print_failure(console, failure.cell, failure.reason)
    return failures


def _sentence(row: Sequence[str | Text]) -> Text:
    name, n, verdict, position, likely, surely, error = map(str, row)
    radii = f"{RADII[0]} {likely}, {RADII[1]} {surely}"
    where = {"located": f" at {position}, {radii}", "ambiguous": f", {position}"}
    more = f"{where.get(verdict, '')}, {n} readings{f', error {error}' if error else ''}"
    return styled_text((f"{name}: ", ""), (verdict, _STYLES[verdict]), (more, ""))


def _line(cell: Cell) -> list[str | Text]:
    position = likely = surely = error = ""
    if cell.verdict == "located":
        position = _position(cell.best)
        likely, surely = _metres(cell.best.r50_m), _metres(cell.best.r95_m)
        error = _metres(cell.truth.error_m) if cell.truth else ""
    elif cell.verdict == "ambiguous":
        position = f"{sum(mode.percent is not None for mode in cell.modes)} positions"
    verdict = Text(cell.verdict, _STYLES[cell.verdict])
    return [cell.cell, str(cell.n), verdict, position, likely, surely, error]


def _line_without_answer(cell: Cell) -> list[str | Text]:
    return [cell.cell, str(cell.n), Text(cell.verdict, _STYLES[cell.verdict]), "", "", "", ""]


def _print_cell(console: Console, cell: Cell) -> None:
    scans = ""
    if cell.n_scans is not None:
        scans = f", observed in {cell.n_scans} scan{'s' * (cell.n_scans != 1)}"
    verdict = (cell.verdict, _STYLES[cell.verdict])
    counts = (f"  {cell.n} readings{scans}  ", "")
    print_text(console, styled_text(("\n", ""), (cell.cell, "bold"), counts, verdict))
    for warning in cell.warnings:
        print_text(console, warning, bullet="  - ")
    _print_estimators(console, cell)
    if cell.alternatives:
        print_text(console, alternatives_text(cell.alternatives), bullet="  ")
    if cell.timing is not UNSET:
        points = f"read at {cell.timing.places} points, {cell.timing.disagree} disagree"
        print_text(console, f"timing advance: {points}", bullet="  ")
    if cell.without:
        _print_runs(console, cell)
    _print_truth(console, cell.truth)


def _print_estimators(console: Console, cell: Cell) -> None:
    rows: list[list[str]] = []
    if cell.best.lat is not None:
        best = cell.best
        rows.append(["posterior", _position(best), _radii(best), *_parameters(best), str(cell.n)])
    for i, mode in enumerate(cell.modes, 1):
        share = share_text(mode.probability) if mode.percent is None else f"{mode.percent}%"
        rows.append([f"  position {i}: {share}", _position(mode), _axes(mode.ellipse95)])
    for estimator in ESTIMATORS:
        title = f"{estimator.name}*" if estimator == REFERENCE else estimator.name
        state: FinalState | LeastSquares = getattr(cell, estimator.json_key)
        if state.converged is False:
            rows.append([title, "did not converge"])
        elif state.lat is not None:
            rows.append([title, _position(state), *_extent_and_parameters(state), str(state.n)])
    table(
        console,
        ["estimator", "position", "50 %; 95 % (m)", "P0 (dBm)", "eta", "n"],
        rows,
        right=("n",),
    )


def _extent_and_parameters(state: FinalState | LeastSquares) -> list[str]:
    """Extent, P0 and eta; a fit that the readings do not bound has no uncertainty to print."""
    if isinstance(state, LeastSquares) and state.bounded is False:
        return ["no bounds", f"{state.p0_dbm:.1f}", f"{state.eta:.2f}"]
    return [_axes(state.ellipse95), *_parameters(state)]


def _parameters(state: Best | FinalState | LeastSquares) -> list[str]:
    return [
        f"{state.p0_dbm:.1f} ± {state.p0_sigma_db:.1f}",
        f"{state.eta:.2f} ± {state.eta_sigma:.2f}",
    ]


def _print_runs(console: Console, cell: Cell) -> None:
    """What each run contributes: its level against the first, and the answer without it."""
    rows = []
    for share, rest in zip(cell.offsets or (), cell.without or (), strict=True):
        level = "-" if share.offset_db is None else "0"
        if share.offset_db is not None and share.sigma_db:
            level = f"{share.offset_db:+.1f} ± {share.sigma_db:.1f}"
        position = (_position(rest.best), _radii(rest.best)) if rest.best else ("-", "-")
        rows.append([share.run, str(share.n), level, *position, rest.verdict])
    titles = ["run", "n", "reads (dB)", "without it", "50 %; 95 % (m)", "verdict"]
    table(console, titles, rows, right=("n",))


def _position(position: Best | Mode | Position | FinalState | LeastSquares) -> str:
    return f"{position.lat:.5f} {position.lon:.5f}"


def _radii(best: Best | Position) -> str:
    return f"r {best.r50_m:.0f}; {best.r95_m:.0f}"


def _axes(ellipse: Ellipse | None) -> str:
    return f"{ellipse.semi_major_m:.0f} x {ellipse.semi_minor_m:.0f}" if ellipse else ""


def _metres(m: float | None) -> str:
    return "" if m is None else f"{m:.0f} m"


def _print_truth(console: Console, truth: TruthCheck | None) -> None:
    if truth is None or truth.error_m is None:
        return
    side = "inside" if truth.inside_region95 else "OUTSIDE"
    error = f"best position is {truth.error_m:.0f} m off"
    print_text(console, f"truth: {error}, truth is {side} the 95 % region", bullet="  ")
