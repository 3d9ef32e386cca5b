"""The commands `export`, `import` and `share` of `postproc`."""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from logger.core.arguments import file_path, input_path, number
from logger.core.errors import ConfigError
from postproc.atomic_write import check_output, check_writable

if TYPE_CHECKING:
    from logger.core.runfile import Run
    from postproc.interop.estimates import Estimate
    from postproc.interop.levels import Walked

Summarise = Callable[["Run", Sequence[str] | None], dict[str, Any]]
"""Estimates of a run's cells, or of those named, as `postproc smooth --json` prints them."""

_MOST_TOLD = 20


def add_export(command: argparse.ArgumentParser) -> None:
    names = (
        "kml",
        "geojson",
        "gpx",
        "csv",
        "wigle",
        "opencellid-csv",
        "opencellid-json",
        "parquet",
    )
    command.add_argument(
        "-o",
        "--output",
        type=file_path,
        required=True,
        metavar="FILE",
        help="its suffix names the format",
    )
    command.add_argument(
        "--format", choices=names, help="default: by the suffix; .csv is what `import` reads back"
    )
    command.add_argument(
        "--cell", action="append", metavar="NAME", help="only this cell (may be repeated)"
    )
    command.add_argument(
        "--estimates", action="store_true", help="the answers of `smooth` too: places and regions"
    )
    what = "and what the other estimators say, with their ellipses, to compare"
    command.add_argument("--all-estimators", action="store_true", help=what)
    command.add_argument("--json", action="store_true")


def add_import(command: argparse.ArgumentParser) -> None:
    what = "our CSV, WiGLE CSV, OpenCelliD or Tower Collector, Kismet log, Network Survey CSV or GeoPackage"
    command.add_argument(
        "source", type=input_path, metavar="FILE", help=f"{what}; also as .gz or .zip"
    )
    command.add_argument("-o", "--output", type=file_path, required=True, metavar="RUN.H5")
    times = "none: take the order of the rows, where the file has no true times"
    command.add_argument("--times", choices=("file", "none"), default="file", help=times)
    command.add_argument("--json", action="store_true")


def add_share(command: argparse.ArgumentParser) -> None:
    command.add_argument("-o", "--output", type=file_path, required=True, metavar="COPY.H5")
    command.add_argument(
        "--blur-m",
        type=number("--blur-m", 0.0, 1e6, unit="m", open_below=True),
        default=200.0,
        metavar="M",
        help="radius around begin and end (default: 200)",
    )
    command.add_argument("--json", action="store_true")


def export(arguments: argparse.Namespace, summarise: Summarise) -> int:
    """Write a run in another format."""
    from logger.core.runfile import read_sound_run
    from postproc.interop import exporting
    from postproc.interop.levels import walked
    from postproc.smoothing import observed_cells

    name = exporting.format_of(arguments.format, arguments.output)
    wanted = arguments.estimates or arguments.all_estimators
    if wanted and not exporting.FORMATS[name].has_estimates:
        which = "--estimates" if arguments.estimates else "--all-estimators"
        raise ConfigError(f"{name} holds measurements only; {which} goes with kml, geojson and gpx")
    run = read_sound_run(arguments.run)
    check_output(arguments.output)
    walk = walked(run, list(observed_cells([run], arguments.cell)) if arguments.cell else None)
    found = _estimates(arguments, run, walk, summarise) if wanted else []
    told = exporting.export(walk, found, arguments.output, name)
    if arguments.json:
        print(json.dumps(asdict(told), indent=2, default=str))
        return 0
    more = f", estimates of {told.n_estimates} cells" if wanted else ""
    print(f"{told.path}: {told.n_levels} levels, {told.n_fixes} fixes{more} ({name})")
    for what in told.left_out:
        print(f"{told.path}: left out: {what}", file=sys.stderr)
    return 0


def _estimates(
    arguments: argparse.Namespace, run: "Run", walk: "Walked", summarise: Summarise
) -> "list[Estimate]":
    """As `postproc smooth` has left them beside the run, or computed now."""
    from postproc.interop.estimates import estimates, stored_estimates
    from postproc.results import path_beside
    from postproc.smoothing import observed_cells

    cells = list(observed_cells([run], arguments.cell))
    beside = path_beside(arguments.run)
    every = arguments.all_estimators
    stored = stored_estimates(beside, run.meta.run_id, cells, walk.utm, every=every)
    if stored is None:
        return estimates(summarise(run, arguments.cell), walk.utm, every=every)
    print(f"estimates are those of {beside}", file=sys.stderr)
    return stored


def import_(arguments: argparse.Namespace) -> int:
    """Make a run of a foreign file."""
    from postproc.interop.importing import import_walk, summary

    check_writable(arguments.output)
    imported, source = (
        import_walk(arguments.source, arguments.output, times=arguments.times == "file"),
        arguments.source,
    )
    for bad in imported.bad_rows[:_MOST_TOLD]:
        print(f"{source}: line {bad.line}: {bad.why}", file=sys.stderr)
    if len(imported.bad_rows) > _MOST_TOLD:
        more = len(imported.bad_rows) - _MOST_TOLD
        print(f"{source}: ... and {more} more bad rows (--json names all)", file=sys.stderr)
    if imported.was_sorted:
        print(f"{source}: rows were out of order and have been sorted by time", file=sys.stderr)
    if arguments.json:
        print(json.dumps(summary(imported), indent=2))
        return 0
    other = f", {imported.n_other} rows that are no cells" if imported.n_other else ""
    again = f", {imported.n_repeated} repeated" if imported.n_repeated else ""
    counts = f"{imported.n_rows} readings, {len(imported.bad_rows)} bad rows{again}{other}"
    print(f"{imported.path}: {counts} ({imported.format})")
    return 0


def share(arguments: argparse.Namespace) -> int:
    """Write a copy that may be given away."""
    from logger.core.runfile import read_sound_run
    from postproc.interop import share as sharing

    check_writable(arguments.output)
    told = sharing.share(read_sound_run(arguments.run), arguments.output, arguments.blur_m)
    if arguments.json:
        print(json.dumps(asdict(told), indent=2, default=str))
        return 0
    print(f"{told.path}: {told.n_fixes} fixes, {told.n_scans} scans, {told.n_readings} readings")
    for what in told.removed:
        print(f"  removed  {what}")
    for what in told.kept:
        print(f"  kept     {what}")
    return 0
