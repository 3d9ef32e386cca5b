"""The commands `export`, `import` and `share` of `postproc`."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from logger.command_line import (
    FILE,
    INPUT,
    json_option,
    late_modules,
    missing_library,
    number,
    show,
)
from logger.core.errors import ConfigError, RunFileError
from postproc.interop.writers import names
from postproc.options import (
    cells_option,
    grouped_runs,
    run_argument,
    runs_argument,
    stored_or_estimated,
)

with late_modules():
    from logger.core import answer, document, runfile
    from postproc import atomic_write, cell_work, progress, scan_counts
    from postproc.interop import (
        contents,
        exporting,
        importing,
        track_file,
    )
    from postproc.interop import share as sharing
    from postproc.interop.readers import diag, named_columns
    from postproc.suspicion import run_assessment

_MOST_PRINTED = 20
"""Bad rows of an imported file: more would push the result off the screen."""


@click.command
@runs_argument
@click.option(
    "-o",
    "--output",
    type=FILE,
    required=True,
    metavar="FILE",
    help="The suffix selects the format.",
)
@click.option(
    "--format",
    "format_name",
    type=click.Choice(names()),
    help="Default: by the suffix; `import` reads .csv back.",
)
@cells_option
@click.option(
    "--estimates",
    "has_estimates",
    is_flag=True,
    help="Write the cells of all runs instead.",
)
@click.option(
    "--all-estimators", is_flag=True, help="With the other estimators in further columns."
)
@json_option
def export(
    paths: Sequence[Path],
    output: Path,
    format_name: str | None,
    cells: Sequence[str],
    *,
    has_estimates: bool,
    all_estimators: bool,
    as_json: bool,
) -> int:
    """Write levels and track of a run, or cells, in another format.

    The exit code is 3 if an estimate failed.
    """
    has_estimates = has_estimates or all_estimators
    name = exporting.format_of(format_name, output, with_estimates=has_estimates)
    if len(paths) > 1 and not has_estimates:
        raise ConfigError("levels are written one run a file: name one run, or use --estimates")
    atomic_write.check_output(output)
    answers: list[answer.Answer] = []
    if has_estimates:
        groups = grouped_runs(paths, cells)
        with_words = [
            run_assessment.conspicuous_first(
                stored_or_estimated(group.runs, group.cells), progress.with_progress, group.several
            )[0]
            for group in groups
        ]
        exported, answers = exporting.write_answers(with_words, output, name, every=all_estimators)
        counts = document.number_of(exported.n_estimates, "cell")
        if len(groups) > 1:
            counts = f"{counts} of {len(groups)} places: {', '.join(g.name for g in groups)}"
    else:
        run = runfile.read_sound_run(paths[0])
        only = list(scan_counts.observed_cells([run], cells)) if cells else None
        exported = exporting.write_walk(exporting.walk_of_run(run, only), output, name)
        levels = document.number_of(exported.n_levels, "level")
        counts = f"{levels}, {document.number_of(exported.n_fixes, 'fix')}"
    said = document.Document(
        exported,
        body=[f"{exported.path}: {counts} ({name})"],
        remarks=[f"{exported.path}: left out: {reason}" for reason in exported.left_out],
    )
    show(said, as_json=as_json)
    return cell_work.exit_code(answers)


@click.command("import")
@click.argument("source", type=INPUT, metavar="FILE")
@click.option("-o", "--output", type=FILE, required=True, metavar="RUN.H5")
@click.option(
    "--times",
    type=click.Choice(["file", "none"]),
    default="file",
    show_default=True,
    help="none: use the order of the rows if the file has no true times.",
)
@click.option(
    "--columns",
    metavar="NAME=COLUMN,...",
    help="Columns of any other table: lat, lon, level, and time, cid, mcc, ...",
)
@click.option(
    "--track",
    type=INPUT,
    metavar="FILE",
    help="Take the positions from this GPX track, or from Rayhunter's file of positions, by time.",
)
@click.option("--zone", metavar="ZONE", help="Zone of local times, for example Europe/Berlin.")
@click.option("--member", metavar="NAME", help="Only this file of a zip.")
@click.option("--keep-name", is_flag=True, help="The run of a capture names the file.")
@json_option
def import_(
    source: Path,
    output: Path,
    times: str,
    columns: str | None,
    track: Path | None,
    zone: str | None,
    member: str | None,
    *,
    keep_name: bool,
    as_json: bool,
) -> None:
    """Make a run from a recording of another program.

    FILE is recognised by its content; docs/guide/formats.md lists the formats. It may be
    compressed (.gz, .zip); of a zip with several files each becomes a run, named after it. Each
    level needs a position: its own, or that of --track at its time. A capture of a modem needs
    none, but then no cell is located.
    """
    atomic_write.check_writable(output)
    reading = importing.Reading(
        times=times == "file",
        columns=named_columns.columns_of(columns) if columns else {},
        track=track_file.read_track(track) if track else None,
        zone=track_file.zone_named(zone) if zone else None,
        keep_name=keep_name,
    )
    sizes = contents.members(source)
    if member is not None and member not in sizes:
        inside = f"it has {', '.join(list(sizes)[:5])}" if sizes else "it is no zip"
        raise ConfigError(f"{source} has no file {member!r}: {inside}")
    if member is None and len(walks := importing.walks_in(sizes)) > 1:
        _import_all(source, output, walks, reading, as_json=as_json)
        return
    imported = importing.import_walk(source, output, reading=reading, member=member)
    said = document.Document(
        importing.summary(imported),
        body=[_counts(imported)],
        remarks=[*_remarks(str(source), imported)],
    )
    show(said, as_json=as_json)


def _import_all(
    source: Path, output: Path, sizes: dict[str, int], reading: importing.Reading, *, as_json: bool
) -> None:
    runs, left, lines, remarks = [], [], [], []
    for name, result in importing.import_members(source, output, sizes, reading):
        if isinstance(result, str):
            left.append({"file": name, "why": result})
            remarks.append(f"{source}/{name} is left out: {result}")
            continue
        runs.append({"file": name, **importing.summary(result)})
        lines.append(_counts(result))
        remarks += _remarks(f"{source}/{name}", result)
    if not runs:
        for remark in remarks:
            print(remark, file=sys.stderr)
        raise RunFileError(f"{source}: none of its {len(sizes)} files could be imported")
    content = {"runs": runs, "left_out": left}
    show(document.Document(content, body=lines, remarks=remarks), as_json=as_json)


def _counts(imported: importing.Imported) -> str:
    again = f", {imported.n_repeated} repeated" if imported.n_repeated else ""
    remarks = f", {len(imported.left.remarks)} remarks" if imported.left.remarks else ""
    readings = document.number_of(imported.n_rows, "reading")
    bad = document.number_of(imported.left.n_bad, "bad row")
    n = imported.n_positions
    alone = f", {document.number_of(n, 'row')} with a position alone" * bool(n)
    counts = f"{readings}{remarks}{alone}, {bad}{again}"
    return f"{imported.path}: {counts} ({imported.format})"


def _remarks(source: str, imported: importing.Imported) -> Iterator[str]:
    yield from _bad_rows(source, imported.left)
    if imported.no_clock:
        what = f"its times are no clock's, {imported.no_clock}"
        yield f"{source}: {what}: imported as with --times none"
    elif not imported.has_times and imported.format == named_columns.NAME:
        yield f"{source}: without times, only the order of the rows counts"
    if imported.left.doubt:
        yield f"{source}: {imported.left.doubt}: --columns lat=...,lon=... names the right ones"
    if imported.was_sorted:
        yield f"{source}: rows were out of order and have been sorted by time"
    for why, n in imported.left.other:
        where = f" (the first: line {first})" if (first := imported.left.first.get(why)) else ""
        rows = f"left out: {document.number_of(n, 'row')}, {why}{where}"
        what = f"{why}: {n} not read" if imported.sha256 else rows
        # the run names no path of this computer
        advice = f" ({missing_library('pycrate', '[diag]')})" if why == diag.NO_PYCRATE else ""
        yield f"{imported.path}: {what}{advice}"
    if imported.no_track:
        yield f"{imported.path}: no positions: {imported.no_track}"
    for why, n in imported.left.no_level:
        yield f"{imported.path}: left out: {document.number_of(n, 'level')}, {why}"
    if n := imported.left.n_unnamed:
        every = ", so no cell can be located" if n == imported.n_rows else ""
        yield f"{imported.path}: {document.number_of(n, 'reading')} without a cell's name{every}"


def _bad_rows(source: str, left: importing.LeftOut) -> Iterator[str]:
    for bad in left.bad[:_MOST_PRINTED]:
        yield f"{source}: line {bad.line}: {bad.why}"
    if left.n_bad > _MOST_PRINTED:
        more = left.n_bad - _MOST_PRINTED
        yield f"{source}: ... and {more} more bad rows (--json lists them)"


@click.command
@run_argument
@click.option("-o", "--output", type=FILE, required=True, metavar="COPY.H5")
@click.option(
    "--blur-m",
    type=number(float, 0, 1_000_000, unit="m", open_below=True),
    default=200.0,
    show_default=True,
    metavar="M",
    help="Radius around the start and the end that is left out.",
)
@json_option
def share(path: Path, output: Path, blur_m: float, *, as_json: bool) -> None:
    """Write a copy of a run to give away.

    It lacks the start and the end of the walk, the raw bytes and the configuration.
    """
    atomic_write.check_writable(output)
    shared = sharing.share(runfile.read_sound_run(path), output, blur_m)
    numbers = {"fix": shared.n_fixes, "scan": shared.n_scans, "reading": shared.n_readings}
    counts = ", ".join(document.number_of(n, noun) for noun, n in numbers.items())
    parts = [("  removed", what) for what in shared.removed]
    parts += [("  kept", what) for what in shared.kept]
    body: list[document.Part] = [f"{shared.path}: {counts}", *document.facts(parts)]
    show(document.Document(shared, body=body), as_json=as_json)
