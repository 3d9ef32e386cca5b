"""What is in a run, in a terminal."""

from collections.abc import Sequence

from rich.console import Console

from logger.core.printable import printable
from postproc.info import CellCount, Event, Gap, Info
from postproc.terminal import print_text, screen, table

MOST = 10
"""Events, and gaps, that are listed unless all are requested."""
MOST_CELLS = 500
"""More than any city has within a walk."""
_WEIGHT = {"error": 0, "warning": 1}
_STYLES = {"error": "red", "warning": "yellow"}


def print_info(info: Info, *, details: bool = False) -> None:
    """A run on one screen; with `details` every gap and every event."""
    console = screen()
    simulated = ", SIMULATED" if info.simulated else ""
    print_text(console, printable(f"{info.path} ({info.form}), {info.origin}{simulated}"), "bold")
    for title, text, style in _facts(info):
        print_text(console, printable(text), style, bullet=f"{title:8} ")
    _print_cells(console, info.cells if details else info.cells[:MOST_CELLS])
    _print_rest(console, 0 if details else len(info.cells) - MOST_CELLS, "cells")
    most = max(len(info.gaps), len(info.events)) if details else MOST
    _print_gaps(console, info.gaps, most)
    _print_events(console, info.events, most)
    print_text(console, printable(info.digest), bullet="digest   ")


def _dead_reckoning_text(info: Info) -> str:
    n = info.n_fixes_by_dead_reckoning
    return f", {n} of these by dead reckoning, without satellites" if n else ""


def _facts(info: Info) -> list[tuple[str, str, str]]:
    without = (
        f"{info.n_readings_without_fix} without a fix, {info.n_readings_without_identity} of "
        "cells not decoded"
    )
    started = info.started_utc or "at an unknown time (the receiver never reported it)"
    facts = [
        ("started", f"{started}, {info.duration_s:.0f} s", ""),
        ("stopped", info.stopped or "not: the plug was pulled, or it is still being recorded", ""),
        (
            "fixes",
            f"{info.n_fixes}, {info.n_fixes_valid} with a position{_dead_reckoning_text(info)}",
            "",
        ),
        ("readings", f"{info.n_readings} in {info.n_scans} scans, {without}", ""),
        ("live", f"{info.n_live} estimates; raw {info.n_raw_bytes} bytes", ""),
    ]
    if info.missing_frames or info.skipped_bytes or info.meaningless_values:
        damage = f"{info.missing_frames} frames missing, {info.skipped_bytes} bytes damaged"
        if info.meaningless_values:
            damage += f", {info.meaningless_values} values that no recorder writes left out"
        facts.insert(2, ("damage", damage, "red"))
    return facts


def _print_cells(console: Console, cells: Sequence[CellCount]) -> None:
    rows = [
        [
            printable(cell.cell),
            printable(cell.rat or "-"),
            str(cell.n),
            str(cell.n_scans),
            "-" if cell.strongest_dbm is None else f"{cell.strongest_dbm:.0f} dBm",
        ]
        for cell in cells
    ]
    if rows:
        table(
            console,
            ["cell", "type", "readings", "in scans", "strongest"],
            rows,
            right=("readings", "in scans", "strongest"),
        )


def _print_gaps(console: Console, gaps: Sequence[Gap], most: int) -> None:
    longest = sorted(gaps, key=lambda gap: -gap.length_s)[:most]
    for gap in sorted(longest, key=lambda gap: gap.start_s):
        print_text(
            console,
            f"no {gap.of} for {gap.length_s:.0f} s at +{gap.start_s:.0f} s",
            bullet="gap      ",
        )
    _print_rest(console, len(gaps) - len(longest), "shorter gaps")


def _print_events(console: Console, events: Sequence[Event], most: int) -> None:
    """The gravest, in the order of time; of equal ones the first."""
    gravest = sorted(
        enumerate(events), key=lambda entry: (_WEIGHT.get(entry[1].level, 2), entry[0])
    )[:most]
    for _, event in sorted(gravest, key=lambda entry: entry[0]):
        style = _STYLES.get(event.level, "dim")
        print_text(
            console,
            printable(f"{event.source}: {event.text}"),
            style,
            bullet=f"+{event.t_s:.0f} s  ",
        )
    _print_rest(console, len(events) - len(gravest), "events")


def _print_rest(console: Console, n: int, what: str) -> None:
    if n > 0:
        print_text(console, f"... and {n} more {what} (-v lists all)", "dim")
