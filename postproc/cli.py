"""The command `postproc`: what a walker types at the desk."""

import argparse
import json
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from logger.core.errors import ConfigError, FieldLoggerError

if TYPE_CHECKING:
    from postproc.smooth import Wishes

T = TypeVar("T")


def main(argv: list[str] | None = None) -> int:
    """Run a command; a user's mistake is one line on stderr and exit 2."""
    arguments = _parser().parse_args(argv)
    try:
        code: int = arguments.command(arguments)
    except FieldLoggerError as error:
        print(f"postproc: {error}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith(("logger", "postproc")):
            raise
        # the plain install is the logger; the desk's libraries are an extra
        print(f"postproc: {error.name} is missing; install the desk: pip install 'cellwalk[post]'", file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    except KeyboardInterrupt:
        return 130
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="postproc", description="Find where the cells of a recorded walk stand.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, what: str, *, run: bool = True, several: bool = False) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=what)
        if run:
            which, count = "run-....h5, or a journal that was cut", "+" if several else None
            command.add_argument("run", type=Path, nargs=count, metavar="RUN", help=which)
        return command

    info = add("info", "what is in a run, its gaps, how it stopped")
    info.add_argument("--json", action="store_true")
    info.set_defaults(command=_info)

    replay = add("replay", "compute the live estimate again and compare it with the recorded one")
    replay.add_argument("--json", action="store_true")
    replay.set_defaults(command=_replay)

    smooth = add("smooth", "estimate where each cell stands, and how sure that is; several runs together", several=True)
    smooth.add_argument("--cell", action="append", metavar="NAME", help="only this cell (may be repeated)")
    smooth.add_argument("--environment", default="any", help="prior: any (default), open, suburban or urban")
    smooth.add_argument("--height", type=float, metavar="M", help="antenna above the receiver (default: 5 m)")
    losses = ("linear", "soft_l1", "huber", "cauchy")
    smooth.add_argument("--loss", choices=losses, default="linear", help="loss of the least-squares fit")
    smooth.add_argument("--json", action="store_true")
    smooth.set_defaults(command=_smooth)

    imports = add("import", "make a run of a CSV walk", run=False)
    imports.add_argument("csv", type=Path, metavar="WALK.CSV")
    imports.add_argument("-o", "--output", type=Path, required=True, metavar="RUN.H5")
    imports.add_argument("--json", action="store_true")
    imports.set_defaults(command=_import)

    view = add("view", "show a run in rerun")
    view.add_argument("--save", type=Path, metavar="RUN.RRD", help="write the recording instead of opening the viewer")
    view.add_argument("--cell", metavar="NAME", help="cell to show (default: the one with most to tell)")
    view.set_defaults(command=_view)

    plot = add("plot", "draw a run as a picture")
    plot.add_argument("-o", "--output", type=Path, metavar="RUN.PNG", help="default: beside the run")
    plot.add_argument("--cell", metavar="NAME", help="cell to show (default: the one with most to tell)")
    plot.set_defaults(command=_plot)

    recover = add("recover", "make HDF5 of a journal that a pulled plug left behind")
    recover.set_defaults(command=_recover)
    return parser


def _info(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import read_run
    from postproc import tables
    from postproc.info import describe
    from postproc.results import as_json

    info = describe(read_run(arguments.run))
    if arguments.json:
        print(as_json(info))
    else:
        tables.print_info(info)
    return 0


def _replay(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from logger.core.runfile import read_run
    from postproc.replay import replay

    found = replay(read_run(arguments.run))
    if arguments.json:
        print(json.dumps(asdict(found) | {"equal": found.equal}, indent=2))
    elif not found.n_recorded and not found.n_replayed:
        print("the run holds no live estimate: there was never a decoded 2G cell together with a fix")
    elif found.equal:
        print(f"replay equals live: {found.n_equal} estimates, to the last bit")
    else:
        print(
            f"replay differs from live: {found.n_recorded} recorded, {found.n_replayed} replayed, "
            f"{found.n_equal} equal; first difference at record {found.first_difference}, "
            f"largest {found.largest_m:.3g} m"
        )
    return 0 if found.equal else 1


def _smooth(arguments: argparse.Namespace) -> int:
    from logger.core.locator.prior import prior_for
    from logger.core.runfile import read_run
    from postproc import results
    from postproc.smooth import Wishes, smooth_run

    wishes = Wishes(prior_for(arguments.environment, height_m=arguments.height), arguments.loss)
    if len(arguments.run) > 1:
        return _smooth_together(arguments, wishes)
    run = read_run(arguments.run[0])
    smoothed = smooth_run(run, arguments.cell, wishes=wishes, progress=_progress, processes=_processes())
    found = results.summary(smoothed)
    _print_results(found, as_json=arguments.json)
    # printed first: a run on a card that cannot be written has an answer too
    results.write(smoothed, found, results.path_beside(arguments.run[0]))
    return 0


def _smooth_together(arguments: argparse.Namespace, wishes: "Wishes") -> int:
    from logger.core.runfile import read_run
    from postproc import results
    from postproc.together import smooth_together

    runs = [read_run(path) for path in arguments.run]
    together = smooth_together(runs, arguments.cell, wishes=wishes, progress=_progress, processes=_processes())
    found = results.summary_together(together)
    _print_results(found, as_json=arguments.json)
    results.write_together(together, found, results.path_beside(arguments.run[0], together=True))
    return 0


def _print_results(found: dict[str, Any], *, as_json: bool) -> None:
    from postproc import results, tables

    if as_json:
        print(results.as_json(found))
    else:
        tables.print_summary(found)


def _import(arguments: argparse.Namespace) -> int:
    from postproc.interop.walk_csv import import_walk, summary

    if not arguments.output.parent.is_dir():
        raise ConfigError(f"{arguments.output.parent}: no such folder")
    imported = import_walk(arguments.csv, arguments.output)
    for bad in imported.bad_rows[:20]:
        print(f"{arguments.csv}: line {bad.line}: {bad.why}", file=sys.stderr)
    if len(imported.bad_rows) > 20:
        print(
            f"{arguments.csv}: ... and {len(imported.bad_rows) - 20} more bad rows (--json names all)", file=sys.stderr
        )
    if imported.was_sorted:
        print(f"{arguments.csv}: rows were out of order and have been sorted by time", file=sys.stderr)
    if arguments.json:
        print(json.dumps(summary(imported), indent=2))
    else:
        print(f"{imported.path}: {imported.n_rows} readings, {len(imported.bad_rows)} bad rows")
    return 0


def _view(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import read_run
    from postproc.pictures.scene import open_viewer, write_scene
    from postproc.smooth import smooth_run

    if arguments.save is not None and arguments.save.suffix != ".rrd":
        raise ConfigError(f"{arguments.save}: a rerun recording is named .rrd")
    only = arguments.cell and [arguments.cell]
    smoothed = smooth_run(read_run(arguments.run), only, progress=_progress, processes=_processes())
    if arguments.save is None:
        return open_viewer(smoothed)
    write_scene(smoothed, arguments.save)
    print(arguments.save)
    return 0


def _plot(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import read_run
    from postproc.pictures.plots import draw_run
    from postproc.smooth import smooth_run

    only = arguments.cell and [arguments.cell]
    smoothed = smooth_run(read_run(arguments.run), only, progress=_progress, processes=_processes())
    target = arguments.output or arguments.run.with_suffix(".png")
    draw_run(smoothed, target)
    print(target)
    return 0


def _recover(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import finish_journal, read_run

    read_run(arguments.run)
    run = finish_journal(arguments.run)
    damage = read_run(run).damage
    print(run)
    if damage.missing_frames or damage.skipped_bytes:
        lost = f"{damage.missing_frames} frames missing, {damage.skipped_bytes} bytes damaged"
        print(f"{arguments.run}: {lost}", file=sys.stderr)
    return 0


def _processes() -> int:
    return os.cpu_count() or 1


def _progress(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    """Show a bar on stderr while the items are worked on, if somebody is looking."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(items, what, total, console=console, transient=True, disable=not console.is_terminal)


if __name__ == "__main__":
    sys.exit(main())
