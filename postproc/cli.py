"""The command `postproc`: what a walker types at the desk."""

import argparse
import json
import os
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from logger.core.errors import ConfigError, FieldLoggerError
from postproc.interop import cli as interop

if TYPE_CHECKING:
    from logger.core.locator.prior import Prior
    from logger.core.runfile import Run
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
    info.add_argument("--verify", action="store_true", help="check that it is whole and as it was sealed; 3 if not")
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

    imports = add("import", "make a run of what another program recorded", run=False)
    interop.add_import(imports)
    imports.set_defaults(command=interop.import_)

    exports = add("export", "write levels, track and estimates for maps, tables and cell databases")
    interop.add_export(exports)
    exports.set_defaults(command=_export)

    share = add("share", "a copy to give away: without the ends of the walk, raw bytes and configuration")
    interop.add_share(share)
    share.set_defaults(command=interop.share)

    view = add("view", "show a run in rerun")
    view.add_argument("--save", type=Path, metavar="RUN.RRD", help="write the recording instead of opening the viewer")
    view.add_argument("--cell", metavar="NAME", help="cell to show (default: the one with most to tell)")
    view.set_defaults(command=_view)

    plot = add("plot", "draw a run as a picture")
    plot.add_argument("-o", "--output", type=Path, metavar="RUN.PNG", help="default: beside the run")
    plot.add_argument("--cell", metavar="NAME", help="cell to show (default: the one with most to tell)")
    plot.set_defaults(command=_plot)

    recover = add("recover", "make HDF5 of what a pulled plug left behind; exit 3 where something was lost", run=False)
    recover.add_argument("path", type=Path, metavar="PATH", help="a journal, or a folder of runs")
    recover.set_defaults(command=_recover)

    _add_toa(commands.add_parser("toa", help="place by ranges to anchors: the README's Kalman filter, simulated"))
    what = "check the specification, item by item: claim, what we measured, verdict"
    _add_validate(commands.add_parser("validate", help=what))

    _add_verify(add("verify", "test claimed positions of cells: consistent, rejected or cannot tell, with the power"))
    _add_verify_theory(commands.add_parser("verify-theory", help="position verification by theory, and by simulation"))
    _add_celldb(commands.add_parser("celldb", help="OpenCelliD and Mozilla exports as one indexed file"))
    return parser


def _add_toa(toa: argparse.ArgumentParser) -> None:
    simulate = toa.add_subparsers(required=True, metavar="COMMAND").add_parser("simulate", help="mean errors by noise")
    simulate.add_argument("--runs", type=int, default=10_000, metavar="N", help="simulated runs (default: 10000)")
    simulate.add_argument("--seed", type=int, default=0, metavar="N")
    simulate.add_argument("--anchors", metavar='"X,Y X,Y ..."', help="anchors in metres (default: the README's four)")
    simulate.add_argument("--path", metavar='"X,Y X,Y ..."', help="places of the object (default: (k, k), k = 0..10)")
    simulate.add_argument(
        "--sigma2", type=float, nargs="+", metavar="M2", help="variances of a range (default: 0.01 ... 100)"
    )
    simulate.add_argument("--steps", action="store_true", help="errors of each step as well")
    simulate.add_argument("--plot", type=Path, metavar="FILE", help="draw the errors (.png, .svg, .pdf)")
    simulate.add_argument("--json", action="store_true")
    simulate.set_defaults(command=_toa_simulate)


def _add_validate(validate: argparse.ArgumentParser) -> None:
    validate.add_argument("--quick", action="store_true", help="fewer simulated runs: a few seconds")
    form = validate.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true")
    form.add_argument("--page", action="store_true", help="print VALIDATION.md, without what differs by machine")
    validate.set_defaults(command=_validate)


def _add_verify(verify: argparse.ArgumentParser) -> None:
    what = verify.add_mutually_exclusive_group(required=True)
    what.add_argument("--claim", metavar="LAT,LON[,SIGMA_M]", help="claimed position, of --cell or of every cell")
    what.add_argument(
        "--claims", type=Path, metavar="FILE", help="CSV (cell,lat,lon[,sigma_m]), cell export or cells.db"
    )
    what.add_argument("--sites", action="store_true", help="is --cell heard from one place or from two?")
    _southern(verify)
    verify.add_argument("--cell", metavar="NAME", help="only this cell")
    verify.add_argument("--against", type=Path, metavar="RUN", help="with --sites: a second run of the same cell")
    verify.add_argument("--pfa", type=float, default=0.05, metavar="P", help="false-alarm rate (default: 0.05)")
    verify.add_argument("--environment", default="any", help="prior: any (default), open, suburban or urban")
    verify.add_argument("--height", type=float, metavar="M", help="antenna above the receiver (default: 5 m)")
    verify.add_argument("--json", action="store_true")
    verify.set_defaults(command=_verify_claims)


def _southern(parser: argparse.ArgumentParser) -> None:
    """Let an argument begin with the minus of a coordinate, as a latitude south of the equator does."""
    parser._negative_number_matcher = re.compile(r"-[\d.]")  # noqa: SLF001 (argparse has no other way)


def _add_verify_theory(theory: argparse.ArgumentParser) -> None:
    _southern(theory)
    theory.add_argument("--pfa", type=float, default=0.05, metavar="P", help="false-alarm rate (default: 0.05)")
    theory.add_argument("--receivers", nargs="+", metavar="X,Y[,Z]", help="metres from the true place (default: ours)")
    theory.add_argument("--sigma", type=float, nargs="+", metavar="M", help="of a range (default: 100 and 20000 m)")
    theory.add_argument("--trials", type=int, default=20_000, metavar="N", help="simulated claims (default: 20000)")
    theory.add_argument("--seed", type=int, default=0, metavar="N")
    theory.add_argument("--json", action="store_true")
    theory.set_defaults(command=_verify_theory)


def _add_celldb(celldb: argparse.ArgumentParser) -> None:
    commands = celldb.add_subparsers(required=True, metavar="COMMAND")
    imports = commands.add_parser("import", help="add exports to a database file")
    imports.add_argument(
        "file", type=Path, nargs="+", metavar="FILE", help="world, country or MLS export, .gz or plain"
    )
    imports.add_argument("-o", "--output", type=Path, required=True, metavar="CELLS.DB")
    imports.add_argument("--json", action="store_true")
    imports.set_defaults(command=_celldb_import)
    lookup = commands.add_parser("lookup", help="cells by identity or around a place")
    _southern(lookup)
    lookup.add_argument("db", type=Path, metavar="CELLS.DB")
    which = lookup.add_mutually_exclusive_group(required=True)
    which.add_argument("--cell", metavar="MCC-MNC-AREA-CID")
    which.add_argument("--near", metavar="LAT,LON[,RADIUS_M]", help="nearest first, at most 100 (default: 1000 m)")
    lookup.add_argument("--json", action="store_true")
    lookup.set_defaults(command=_celldb_lookup)


def _info(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import read_run
    from postproc import tables
    from postproc.info import describe
    from postproc.results import as_json

    if arguments.verify:
        return _verify(arguments)
    info = describe(read_run(arguments.run))
    if arguments.json:
        print(as_json(info))
    else:
        tables.print_info(info)
        print(f"digest   {info.digest}")
    return 0


def _verify(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from logger.core.runfile import SOMETHING_LOST
    from postproc.info import verify

    checks = verify(arguments.run)
    if arguments.json:
        print(json.dumps([asdict(check) for check in checks], indent=2))
    else:
        for check in checks:
            print(f"{'ok' if check.holds else 'FAIL':4}  {check.what}: {check.text}")
    return 0 if all(check.holds for check in checks) else SOMETHING_LOST


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


def _export(arguments: argparse.Namespace) -> int:
    from postproc.results import summary
    from postproc.smooth import smooth_run

    def summarise(run: "Run", only: Sequence[str] | None) -> dict[str, Any]:
        return summary(smooth_run(run, only, progress=_progress, processes=_processes()))

    return interop.export(arguments, summarise)


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


def _toa_simulate(arguments: argparse.Namespace) -> int:
    from postproc.toa import report
    from postproc.toa.simulate import setting, simulate

    wanted = setting(
        report.places(arguments.anchors) if arguments.anchors is not None else None,
        report.places(arguments.path) if arguments.path is not None else None,
        arguments.sigma2,
        arguments.runs,
        arguments.seed,
    )
    rows = list(_progress(simulate(wanted), "simulating", len(wanted.sigma2_m2)))
    if arguments.json:
        print(report.as_json(wanted, rows, steps=arguments.steps))
    else:
        report.print_rows(wanted, rows, steps=arguments.steps)
    if arguments.plot is not None:
        from postproc.toa.picture import draw

        draw(wanted, rows, arguments.plot)
    return 0


def _validate(arguments: argparse.Namespace) -> int:
    from postproc.validate import report
    from postproc.validate.suite import GROUPS, QUICK, THOROUGH

    effort = QUICK if arguments.quick else THOROUGH
    groups = _progress(GROUPS, "checking the specification", len(GROUPS))
    found = [check for group in groups for check in group(effort)]
    if arguments.json:
        print(report.as_json(found))
    elif arguments.page:
        print(report.page(found), end="")
    else:
        report.print_checks(found)
    return 0 if all(check.verdict != "fails" for check in found) else 1


def _recover(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import SOMETHING_LOST, recover

    found = []
    for recovered in recover(arguments.path):
        found.append(recovered)
        print(recovered, flush=True)
        if recovered.loss:
            print(f"postproc: {recovered.loss}", file=sys.stderr)
    return SOMETHING_LOST if any(recovered.loss for recovered in found) else 0


def _verify_claims(arguments: argparse.Namespace) -> int:
    from logger.core.locator.prior import prior_for
    from logger.core.runfile import read_run
    from postproc.results import as_json
    from postproc.smooth import heard_cells
    from postproc.verify import claims, tables
    from postproc.verify.run import Verification

    run, prior = read_run(arguments.run), prior_for(arguments.environment, height_m=arguments.height)
    if arguments.sites:
        return _verify_sites(arguments, run, prior)
    if arguments.against is not None:
        raise ConfigError("--against goes with --sites")
    heard = heard_cells([run], arguments.cell and [arguments.cell])
    if arguments.claim is not None:
        found = [claims.parse_claim(arguments.claim, arguments.cell)]
    else:
        found = claims.read_claims(arguments.claims, list(heard))
    verification = Verification(run, found, arguments.pfa, prior)
    tested = list(_progress(verification.each(), "verifying", len(verification.pairs)))
    verified = verification.adjusted(tested)
    if arguments.json:
        print(as_json(tables.as_dict(verified)))
    else:
        tables.print_verified(verified)
    return 0


def _verify_sites(arguments: argparse.Namespace, run: "Run", prior: "Prior") -> int:
    from logger.core.runfile import read_run
    from postproc.results import as_json
    from postproc.smooth import heard_cells
    from postproc.verify import tables
    from postproc.verify.run import sites_of

    other = read_run(arguments.against) if arguments.against is not None else None
    heard = heard_cells([run], arguments.cell and [arguments.cell])
    if other is not None and not arguments.cell:
        both = heard_cells([other], None)
        heard = {cell: n for cell, n in heard.items() if cell in both}
    cells = _progress(heard, "one place or two", len(heard))
    found = [tables.sites_dict(cell, *sites_of(run, cell, other, prior), arguments.pfa) for cell in cells]
    if arguments.json:
        print(as_json({"p_fa": arguments.pfa, "cells": found}))
    else:
        for cell_found in found:
            tables.print_sites(cell_found)
    return 0


def _verify_theory(arguments: argparse.Namespace) -> int:
    from postproc.results import as_json
    from postproc.verify import report, tables

    receivers = report.places(arguments.receivers) if arguments.receivers else None
    sigmas_m = arguments.sigma or report.SIGMAS_M
    found = report.summary(arguments.pfa, receivers, sigmas_m, arguments.trials, arguments.seed)
    if arguments.json:
        print(as_json(found))
    else:
        tables.print_theory(found)
    return 0


def _celldb_import(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from postproc.results import as_json
    from postproc.verify.celldb import CellImport

    work = CellImport(arguments.file, arguments.output)
    for _ in _progress(work, "importing", 100 * len(arguments.file)):
        pass
    imported = work.imported
    if imported is None:
        return 1
    for bad in imported.bad_rows:
        print(f"{bad.file}: row {bad.row} is no cell: {bad.text}", file=sys.stderr)
    if arguments.json:
        print(as_json(asdict(imported) | {"path": str(imported.path)}))
    else:
        print(
            f"{imported.path}: {imported.n_cells} cells; {imported.n_rows} rows read, {imported.n_bad} bad, "
            f"{imported.n_replaced} replaced by newer ones"
        )
    return 0


def _celldb_lookup(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from postproc.results import as_json
    from postproc.verify import tables
    from postproc.verify.asked import place_of
    from postproc.verify.celldb import CellDb

    database = CellDb(arguments.db)
    found = database.by_identity(arguments.cell) if arguments.cell else database.near(*place_of(arguments.near))
    database.close()
    if arguments.json:
        print(as_json({"cells": [asdict(cell) for cell in found], "absence_is_an_alarm": False}))
    else:
        tables.print_cells(found)
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
