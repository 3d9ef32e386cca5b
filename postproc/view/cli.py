"""The command `view` of `postproc`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from logger.command_line import FILE, json_option, late_modules, number, show
from logger.core.errors import ConfigError
from postproc.options import (
    basemap_option,
    claims_options,
    estimate,
    only_one,
    processors,
    runs_argument,
    stored_or_estimated,
)
from postproc.verification.cli import tested_claims

with late_modules():
    from logger.core import document, runfile
    from postproc import atomic_write, cell_work, progress
    from postproc import result as estimation
    from postproc.basemap import reading
    from postproc.suspicion import ordering
    from postproc.verification import claims as claiming
    from postproc.verification import verdicts
    from postproc.view import end_to_end, recording, scene, timeline, view_model, viewer, web

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
@basemap_option
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
    only_one({"--save": options["save"], "--web": options["web"]})
    chosen = _Options(**options)
    _check(chosen, paths)
    if any(map(recording.is_recording, paths)):
        return _show_recording(chosen, paths)
    runs = [runfile.read_sound_run(path) for path in paths]

    def write(path: Path) -> int:
        """Estimate and draw, after it is known that the result can be shown."""
        model = _view_model(chosen, runs)
        basemap = None
        if chosen.basemap:
            basemap = reading.read_basemap(chosen.basemap, model.survey, model.box)
        if chosen.basemap and basemap is None:
            print(f"{chosen.basemap} is not drawn: the walk has no position", file=sys.stderr)
        failures = scene.write_scene(model, path, basemap=basemap, online=not chosen.web)
        return cell_work.exit_code([*model.cells, *failures])

    if chosen.web:
        return _serve(chosen, write)
    if chosen.save is None:
        return viewer.show(write, runs[0].path.stem)
    code = write(chosen.save)
    content = {"path": chosen.save, "bytes": chosen.save.stat().st_size}
    text = f"{chosen.save}: `postproc view {chosen.save}` opens it"
    show(document.Document(content, body=[text]), as_json=chosen.as_json)
    return code


def _show_recording(options: _Options, paths: Sequence[Path]) -> int:
    """Show what `--save` has written: bare `rerun` serves everybody and counts its users."""
    for name in ("save", "claim", "claims", "cell", "basemap"):
        if getattr(options, name):
            raise ConfigError(f"--{name} goes with a run; {paths[0]} is a recording already")
    write = recording.copy_recording(paths)
    return _serve(options, write) if options.web else viewer.show(write, paths[0].stem)


def _serve(options: _Options, write: Callable[[Path], object]) -> int:
    return web.serve(
        write, options.port or 0, lambda address: print(f"{address} - Ctrl-C ends it", flush=True)
    )


def _check(options: _Options, paths: Sequence[Path]) -> None:
    """Report mistakes at once, not after the minute that estimating may take."""
    if options.save is not None:
        if options.save.suffix != ".rrd":
            raise ConfigError(f"{options.save}: a rerun recording is named .rrd")
        atomic_write.check_output(options.save)
    if options.port is not None and not options.web:
        raise ConfigError("--port goes with --web")
    if options.basemap is not None and not options.basemap.is_file():
        raise ConfigError(f"{options.basemap}: no such file")
    for text in options.claim:
        claiming.parse_claim(text, None)
    if len(paths) > 1 and (options.claim or options.claims):
        raise ConfigError("claims are tested against one run: give one, or leave the claims out")


def _view_model(options: _Options, runs: Sequence[runfile.Run]) -> view_model.ViewModel:
    if len(runs) > 1:  # their times are changed, so they are not those of a stored result
        result = estimate(end_to_end.end_to_end(runs), options.cell)
    else:
        result = stored_or_estimated(runs, options.cell)
    result, conspicuous = ordering.conspicuous_first(result)
    cells = view_model.select_cells(result, options.cell or conspicuous[:1])
    tested = _verdicts(options, result, [cell.cell for cell in cells])

    def detail_of(cell: estimation.CellResult) -> view_model.CellDetail:
        steps = timeline.answer_steps(cell, estimation.Options().prior, processors())
        steps_shown = progress.with_progress(
            steps, f"answer for {cell.cell} step by step", timeline.MOST_STEPS
        )
        return view_model.CellDetail(cell, tuple(steps_shown), tested.get(cell.cell, ()))

    tries = cell_work.Attempts("its answer step by step")
    details = [detail for _, detail in tries.each(cells, lambda cell: cell.cell, detail_of)]
    return view_model.view_model(result, details).without(tries.failures.values())


def _verdicts(
    options: _Options, result: estimation.Result, names: Sequence[str]
) -> dict[str, tuple[verdicts.CellVerdict, ...]]:
    """Verdicts on the claims about the cells in detail, by cell."""
    prior = estimation.Options().prior
    verified = tested_claims(result, names, prior, _P_FA, options.claim, options.claims)
    if verified is None:
        return {}
    if not verified.cells:
        cells = ", ".join(names) or "any cell"
        raise ConfigError(f"{options.claims} claims nothing about {cells}; see --cell")
    return {
        name: tuple(verdict for verdict in verified.cells if verdict.cell == name) for name in names
    }
