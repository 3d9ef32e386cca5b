"""The command `view` of `postproc`."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from logger.command_line import FILE, INPUT, json_option, number, print_json
from logger.core.errors import ConfigError
from postproc.options import (
    claims_options,
    estimate,
    only_one,
    processors,
    runs_argument,
    stored_or_estimated,
)
from postproc.verification.cli import ClaimOptions

if TYPE_CHECKING:
    from logger.core.runfile import Run
    from postproc.result import CellResult, Result
    from postproc.verification.verdicts import CellVerdict
    from postproc.view.view_model import ViewModel

_P_FA = 0.05
"""False-alarm rate of the tests of claims, the default of `verify`."""


@dataclass(frozen=True, slots=True)
class _Options:
    """Options of `view`, by the names of the command line."""

    claim: Sequence[str]
    claims: Path | None
    cell: Sequence[str]
    basemap: Path | None
    save: Path | None
    port: int | None
    web: bool
    as_json: bool


@click.command
@runs_argument
@claims_options
@click.option(
    "--cell", multiple=True, metavar="NAME", help="Cell to show in detail (may be repeated)."
)
@click.option(
    "--basemap",
    type=INPUT,
    metavar="FILE",
    help="Map under the plan: PMTiles, MBTiles, or an image with a world file.",
)
@click.option(
    "--save",
    type=FILE,
    metavar="RUN.RRD",
    help="Write the recording instead of opening the viewer.",
)
@click.option("--web", is_flag=True, help="Serve to a browser on this machine, until Ctrl-C.")
@click.option(
    "--port",
    type=number(int, 0, 65_535),
    metavar="N",
    help="Port of --web (default: a free one).",
)
@json_option
def view(paths: Sequence[Path], **options: Any) -> int:
    """Show runs or a saved recording in rerun or in a browser.

    The exit code of --save is 3 if work on a cell failed.
    """
    from logger.core.runfile import read_sound_run
    from postproc.basemap.reading import read_basemap
    from postproc.cell_work import exit_code
    from postproc.view.recording import is_recording
    from postproc.view.scene import write_scene
    from postproc.view.viewer import show

    only_one({"--save": options["save"], "--web": options["web"]})
    chosen = _Options(**options)
    _check(chosen, paths)
    if any(map(is_recording, paths)):
        return _show_recording(chosen, paths)
    runs = [read_sound_run(path) for path in paths]

    def write(path: Path) -> int:
        """Estimate and draw, after it is known that the result can be shown."""
        model = _view_model(chosen, runs)
        basemap = read_basemap(chosen.basemap, model.survey, model.box) if chosen.basemap else None
        if chosen.basemap and basemap is None:
            print(f"{chosen.basemap} is not drawn: the walk has no position", file=sys.stderr)
        failures = write_scene(model, path, basemap=basemap, online=not chosen.web)
        return exit_code([*model.cells, *failures])

    if chosen.web:
        return _serve(chosen, write)
    if chosen.save is None:
        return show(write, runs[0].path.stem)
    code = write(chosen.save)
    if chosen.as_json:
        print_json({"path": chosen.save, "bytes": chosen.save.stat().st_size})
    else:
        print(f"{chosen.save}: `postproc view {chosen.save}` opens it")
    return code


def _show_recording(options: _Options, paths: Sequence[Path]) -> int:
    """Show what `--save` has written: bare `rerun` serves everybody and counts its users."""
    from postproc.view.recording import copy_recording
    from postproc.view.viewer import show

    for name in ("save", "claim", "claims", "cell", "basemap"):
        if getattr(options, name):
            raise ConfigError(f"--{name} goes with a run; {paths[0]} is a recording already")
    write = copy_recording(paths)
    return _serve(options, write) if options.web else show(write, paths[0].stem)


def _serve(options: _Options, write: Callable[[Path], object]) -> int:
    from postproc.view.web import serve

    return serve(
        write, options.port or 0, lambda address: print(f"{address} - Ctrl-C ends it", flush=True)
    )


def _check(options: _Options, paths: Sequence[Path]) -> None:
    """Report mistakes at once, not after the minute that estimating may take."""
    from postproc.atomic_write import check_output
    from postproc.verification.claims import parse_claim

    if options.save is not None:
        if options.save.suffix != ".rrd":
            raise ConfigError(f"{options.save}: a rerun recording is named .rrd")
        check_output(options.save)
    if options.port is not None and not options.web:
        raise ConfigError("--port goes with --web")
    if options.basemap is not None and not options.basemap.is_file():
        raise ConfigError(f"{options.basemap}: no such file")
    for text in options.claim:
        parse_claim(text, None)
    if len(paths) > 1 and (options.claim or options.claims):
        raise ConfigError("claims are tested against one run: give one, or leave the claims out")


def _view_model(options: _Options, runs: Sequence["Run"]) -> "ViewModel":
    from postproc.cell_work import Attempts
    from postproc.progress import with_progress
    from postproc.result import Options
    from postproc.suspicion.run_assessment import conspicuous_first
    from postproc.view.end_to_end import end_to_end
    from postproc.view.timeline import MOST_STEPS, answer_steps
    from postproc.view.view_model import CellDetail, select_cells, view_model

    if len(runs) > 1:  # their times are changed, so they are not those of a stored result
        result = estimate(end_to_end(runs), options.cell)
    else:
        result = stored_or_estimated(runs, options.cell)
    result, conspicuous = conspicuous_first(result)
    cells = select_cells(result, options.cell or conspicuous[:1])
    verdicts = _verdicts(options, result, [cell.cell for cell in cells])

    def detail_of(cell: "CellResult") -> CellDetail:
        steps = answer_steps(cell, Options().prior, processors())
        steps_shown = with_progress(steps, f"answer for {cell.cell} step by step", MOST_STEPS)
        return CellDetail(cell, tuple(steps_shown), verdicts.get(cell.cell, ()))

    tries = Attempts("its answer step by step")
    details = [detail for _, detail in tries.each(cells, lambda cell: cell.cell, detail_of)]
    return view_model(result, details).without(tries.failures.values())


def _verdicts(
    options: _Options, result: "Result", names: Sequence[str]
) -> dict[str, tuple["CellVerdict", ...]]:
    """Verdicts on the claims about the cells in detail, by cell."""
    from postproc.result import Options

    claims = ClaimOptions(options.claim, options.claims, _P_FA)
    verified = claims.test(result, names, Options().prior)
    if verified is None:
        return {}
    if not verified.cells:
        cells = ", ".join(names) or "any cell"
        raise ConfigError(f"{options.claims} claims nothing about {cells}; see --cell")
    return {
        name: tuple(verdict for verdict in verified.cells if verdict.cell == name) for name in names
    }
