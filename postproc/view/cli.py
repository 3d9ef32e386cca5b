"""The command `view` of `postproc`."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import click

from logger.command_line import FILE, json_option, late_modules, number, run_now, show
from logger.core.errors import ConfigError
from postproc.options import (
    area_options,
    basemap_option,
    claims_options,
    estimate,
    only_one,
    prior_options,
    processors,
    runs_argument,
    stored_or_estimated,
    within_option,
)
from postproc.verification.cli import tested_claims

with late_modules():
    from logger.core import document, runfile
    from logger.core.model import prior as priors
    from postproc import atomic_write, cell_work, multi_run, progress
    from postproc import basemap as basemaps
    from postproc import result as estimation
    from postproc.pictures import survey as surveys
    from postproc.suspicion import run_assessment
    from postproc.verification import claims as claiming
    from postproc.view import scene, view_model, viewer

_P_FA = 0.05
"""False-alarm rate of the tests of claims, the default of `verify`."""


@click.command
@runs_argument
@claims_options
@click.option(
    "--cell",
    "cells",
    multiple=True,
    metavar="NAME",
    help="Cell to show in detail (repeatable).",
)
@prior_options
@area_options
@within_option
@basemap_option
@click.option(
    "--save",
    type=FILE,
    metavar="RUN.RRD",
    help="Write the recording instead of opening the viewer.",
)
@click.option(
    "--web", "is_served", is_flag=True, help="Serve to a browser on this machine, until Ctrl-C."
)
@click.option(
    "--port",
    type=number(int, 0, 65_535),
    metavar="N",
    help="Port of --web (default: a free one).",
)
@json_option
def view(
    paths: Sequence[Path],
    claim: Sequence[str],
    claims: Path | None,
    cells: Sequence[str],
    prior: priors.Prior,
    basemap: Path | None,
    save: Path | None,
    port: int | None,
    *,
    within_m: float,
    is_served: bool,
    as_json: bool,
) -> int:
    """Show runs or a saved recording in rerun or in a browser.

    The exit code of --save is 3 if work on a cell failed.
    """
    options = estimation.Options(prior, within_m=within_m)
    of_a_run = {
        "save": save,
        "claim": claim,
        "claims": claims,
        "cell": cells,
        "basemap": basemap,
    }
    only_one({"--save": save, "--web": is_served})
    if port is not None and not is_served:
        raise ConfigError("--port goes with --web")
    if any(map(viewer.is_recording, paths)):
        for name, value in of_a_run.items():
            if value:
                raise ConfigError(f"--{name} goes with a run; {paths[0]} is a recording already")
        if options != estimation.Options():
            raise ConfigError(f"{paths[0]} is a recording already: its estimates do not change")
        # bare `rerun` serves everybody and counts its users
        return _show_in_viewer(
            viewer.copy_recording(paths), paths[0].stem, port, is_served=is_served
        )
    run_now(scene)
    _check(save, basemap, claim)
    runs = multi_run.named_apart([runfile.read_sound_run(path) for path in paths])

    def write(path: Path) -> int:
        """Estimate and draw, after it is known that the result can be shown."""
        model = _view_model(runs, cells, options, claim, claims)
        ground = basemaps.ground_under(basemap, model.survey, model.box)
        failures = scene.write_scene(model, path, basemap=ground, online=not is_served)
        return cell_work.exit_code([*model.cells, *failures])

    if save is None:
        return _show_in_viewer(write, runs[0].path.stem, port, is_served=is_served)
    code = write(save)
    content = {"path": save, "bytes": save.stat().st_size}
    text = f"{save}: `postproc view {save}` opens it"
    show(document.Document(content, body=[text]), as_json=as_json)
    return code


def _show_in_viewer(
    write: Callable[[Path], object], name: str, port: int | None, *, is_served: bool
) -> int:
    if not is_served:
        return viewer.show(write, name)
    return viewer.serve(
        write, port or 0, lambda address: print(f"{address} - Ctrl-C ends it", flush=True)
    )


def _check(save: Path | None, basemap: Path | None, claim: Sequence[str]) -> None:
    """Report mistakes at once, not after the minute that estimating may take."""
    if save is not None:
        if save.suffix != ".rrd":
            raise ConfigError(f"{save}: a rerun recording is named .rrd")
        atomic_write.check_output(save)
    basemaps.check_basemap(basemap)
    for text in claim:
        claiming.parse_claim(text, None)


def _view_model(
    runs: Sequence[runfile.Run],
    names: Sequence[str],
    options: estimation.Options,
    claim: Sequence[str],
    claims: Path | None,
) -> view_model.ViewModel:
    if len(runs) > 1:  # their times are changed, so they are not those of a stored result
        result = estimate(view_model.end_to_end(runs), names, options)
    else:
        result = stored_or_estimated(runs, names, options)
    result, conspicuous = run_assessment.conspicuous_first(result)
    cells = view_model.select_cells(result, names or conspicuous[:1])
    detailed = [cell.cell for cell in cells]
    # the claims about all cells, as for verify: their number adjusts q
    verified = tested_claims(result, names or [None], options.prior, _P_FA, claim, claims)
    if verified is not None:
        if not any(tested.cell in detailed for tested in verified.cells):
            about = ", ".join(detailed) or "any cell"
            raise ConfigError(f"{claims} claims nothing about {about}; see --cell")
        if verified.not_observed:
            print(verified.not_observed_text, file=sys.stderr)

    survey = surveys.survey_of(result)

    def view_of(cell: estimation.CellResult) -> view_model.CellView:
        prior = cell.posterior.prior if cell.posterior else options.prior
        of_cell = dataclasses.replace(options, prior=prior)
        steps = view_model.answer_steps(cell, of_cell, processors())
        steps_shown = progress.with_progress(
            steps, f"answer for {cell.cell} step by step", view_model.MOST_STEPS
        )
        claims_of_cell = verified.of_cell(cell.cell) if verified else []
        return view_model.cell_view(survey, cell, list(steps_shown), claims_of_cell)

    tries = cell_work.Attempts("its view")
    views = [view for _, view in tries.each(cells, lambda cell: cell.cell, view_of)]
    return view_model.view_model(result, survey, views, tries.failures.values())
