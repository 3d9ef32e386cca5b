"""The commands `export`, `import` and `share` of `postproc`."""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import FILE, INPUT, json_option, number, print_json
from logger.core.errors import ConfigError, RunFileError
from postproc.interop.writers import names
from postproc.options import cells_option, run_argument, stored_or_estimated

if TYPE_CHECKING:
    from postproc.interop.estimates import Estimate
    from postproc.interop.importing import Imported, Reading

_MOST_PRINTED = 20
"""Bad rows of an imported file: more would push the result off the screen."""


@click.command
@run_argument
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
@click.option("--estimates", is_flag=True, help="Add the positions and regions of `smooth`.")
@click.option(
    "--all-estimators", is_flag=True, help="Add the other estimators with their ellipses too."
)
@json_option
def export(
    path: Path,
    output: Path,
    format_name: str | None,
    cells: Sequence[str],
    *,
    estimates: bool,
    all_estimators: bool,
    as_json: bool,
) -> int:
    """Write levels, track and estimates in another format.

    The exit code is 3 if the estimate of a cell failed.
    """
    from logger.core.runfile import read_sound_run
    from postproc.atomic_write import check_output
    from postproc.cell_work import exit_code
    from postproc.interop import exporting
    from postproc.interop.estimates import estimates_of
    from postproc.interop.exporting import walk_of_run
    from postproc.scan_counts import observed_cells

    name = exporting.format_of(format_name, output)
    has_estimates = estimates or all_estimators
    if has_estimates and not exporting.has_estimates(name):
        option = "--estimates" if estimates else "--all-estimators"
        able = " or ".join(exporting.formats_with_estimates())
        raise ConfigError(f"{name} stores measurements only; use {option} with {able}")
    run = read_sound_run(path)
    check_output(output)
    walk = walk_of_run(run, list(observed_cells([run], cells)) if cells else None)
    found: list[Estimate] = []
    if has_estimates:
        found = estimates_of(stored_or_estimated([run], cells), walk.utm, every=all_estimators)
    exported = exporting.write_export(walk, found, output, name)
    if as_json:
        print_json(asdict(exported))
        return exit_code(found)
    more = f", estimates of {exported.n_estimates} cells" if has_estimates else ""
    counts = f"{exported.n_levels} levels, {exported.n_fixes} fixes{more}"
    print(f"{exported.path}: {counts} ({name})")
    for reason in exported.left_out:
        print(f"{exported.path}: left out: {reason}", file=sys.stderr)
    return exit_code(found)


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
    metavar="FILE.GPX",
    help="Take the positions from this track, by time.",
)
@click.option("--zone", metavar="ZONE", help="Zone of local times, for example Europe/Berlin.")
@click.option("--member", metavar="NAME", help="Only this file of a zip.")
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
    as_json: bool,
) -> None:
    """Make a run from a recording of another program.

    FILE is recognised by its content; docs/guide/formats.md lists the formats. It may be
    compressed (.gz, .zip); of a zip with several files each becomes a run of its own, named after
    it. Each level needs a position: its own, or that of --track at its time.
    """
    from postproc.atomic_write import check_writable
    from postproc.interop.decompression import members
    from postproc.interop.importing import Reading, import_walk, summary
    from postproc.interop.readers.named_columns import columns_of
    from postproc.interop.track_file import read_track, zone_named

    check_writable(output)
    reading = Reading(
        times=times == "file",
        columns=columns_of(columns) if columns else {},
        track=read_track(track) if track else None,
        zone=zone_named(zone) if zone else None,
    )
    sizes = members(source)
    if member is not None and member not in sizes:
        inside = f"it has {', '.join(list(sizes)[:5])}" if sizes else "it is no zip"
        raise ConfigError(f"{source} has no file {member!r}: {inside}")
    if len(sizes) > 1 and member is None:
        _import_all(source, output, sizes, reading, as_json=as_json)
        return
    imported = import_walk(source, output, reading=reading, member=member)
    _print_left_out(source, imported)
    if as_json:
        print_json(summary(imported))
    else:
        _print_imported(imported)


def _import_all(
    source: Path, output: Path, sizes: dict[str, int], reading: "Reading", *, as_json: bool
) -> None:
    """Import each file of a zip, and say of each what became of it."""
    from postproc.interop.importing import import_members, summary

    runs, left = [], []
    for name, result in import_members(source, output, sizes, reading):
        if isinstance(result, str):
            left.append({"file": name, "why": result})
            print(f"{source}/{name} is left out: {result}", file=sys.stderr)
            continue
        runs.append({"file": name, **summary(result)})
        _print_left_out(Path(f"{source}/{name}"), result)
        if not as_json:
            _print_imported(result)
    if not runs:
        raise RunFileError(f"{source}: none of its {len(sizes)} files could be imported")
    if as_json:
        print_json({"runs": runs, "left_out": left})


def _print_left_out(source: Path, imported: "Imported") -> None:
    for bad in imported.bad_rows[:_MOST_PRINTED]:
        print(f"{source}: line {bad.line}: {bad.why}", file=sys.stderr)
    if imported.n_bad > _MOST_PRINTED:
        more = imported.n_bad - _MOST_PRINTED
        print(f"{source}: ... and {more} more bad rows (--json lists them)", file=sys.stderr)
    if imported.no_clock:
        what = f"its times are no clock's, {imported.no_clock}"
        print(f"{source}: {what}: imported as with --times none", file=sys.stderr)
    if imported.was_sorted:
        print(f"{source}: rows were out of order and have been sorted by time", file=sys.stderr)


def _print_imported(imported: "Imported") -> None:
    again = f", {imported.n_repeated} repeated" if imported.n_repeated else ""
    remarks = f", {imported.n_remarks} remarks" if imported.n_remarks else ""
    counts = f"{imported.n_rows} readings{remarks}, {imported.n_bad} bad rows{again}"
    print(f"{imported.path}: {counts} ({imported.format})")
    for why, n in imported.other:
        print(f"{imported.path}: left out: {n} rows, {why}", file=sys.stderr)
    for why, n in imported.no_level:
        print(f"{imported.path}: left out: {n} levels, {why}", file=sys.stderr)
    if imported.n_unnamed:
        every = ", so no cell can be located" if imported.n_unnamed == imported.n_rows else ""
        unnamed = f"{imported.n_unnamed} readings name no cell{every}"
        print(f"{imported.path}: {unnamed}", file=sys.stderr)


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
    from logger.core.runfile import read_sound_run
    from postproc.atomic_write import check_writable
    from postproc.interop import share as sharing

    check_writable(output)
    shared = sharing.share(read_sound_run(path), output, blur_m)
    if as_json:
        print_json(asdict(shared))
        return
    counts = f"{shared.n_fixes} fixes, {shared.n_scans} scans, {shared.n_readings} readings"
    print(f"{shared.path}: {counts}")
    for line in (
        *(f"  removed  {what}" for what in shared.removed),
        *(f"  kept     {what}" for what in shared.kept),
    ):
        print(line)
