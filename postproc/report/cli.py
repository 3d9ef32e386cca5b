"""The command `report` of `postproc`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import click

from logger.command_line import FILE, PATH, json_option, late_modules, run_now, show
from postproc.options import (
    area_options,
    basemap_option,
    cells_option,
    claims_options,
    false_alarm_option,
    grouped_runs,
    prior_options,
    runs_argument,
    stored_or_estimated,
    within_option,
)
from postproc.verification.cli import tested_claims

with late_modules():
    from logger.core import document
    from logger.core.model import prior as priors
    from postproc import atomic_write, ground, progress
    from postproc import basemap as basemaps
    from postproc import result as estimation
    from postproc.report import rendering
    from postproc.suspicion import run_assessment


@click.command
@runs_argument
@click.option(
    "-o", "--output", type=FILE, metavar="RUN.HTML", help="Default: beside the (first) run."
)
@cells_option
@click.option(
    "--pictures",
    "picture_folder",
    type=PATH,
    metavar="DIR",
    help="Write the pictures too, each as PNG and SVG.",
)
@basemap_option
@claims_options
@false_alarm_option
@prior_options
@area_options
@within_option
@json_option
def report(
    paths: Sequence[Path],
    output: Path | None,
    cells: Sequence[str],
    picture_folder: Path | None,
    basemap: Path | None,
    claim: Sequence[str],
    claims: Path | None,
    p_fa: float,
    prior: priors.Prior,
    within_m: float,
    *,
    as_json: bool,
) -> int:
    """Write one page on a run, or on the runs of each place together.

    The exit code is 3 if work on a cell failed.
    """
    run_now(rendering)
    target = output or paths[0].with_suffix(".html")
    atomic_write.check_output(target)
    if picture_folder is not None:
        atomic_write.check_folder(picture_folder)
    basemaps.check_basemap(basemap)
    options = estimation.Options(prior, within_m=within_m)
    groups = grouped_runs(paths, cells, prior.area)
    codes, documents = [], []
    for group in groups:
        start_s, file, folder = perf_counter(), target, picture_folder
        if len(groups) > 1:
            own = output or group.runs[0].path.with_suffix(".html")
            file = own.with_stem(f"{own.stem}-{group.file_name}")
            folder = picture_folder and picture_folder / group.file_name
        result, conspicuous = run_assessment.conspicuous_first(
            stored_or_estimated(group.runs, group.cells, options),
            progress.with_progress,
            group.several,
        )
        findings = [f"{cell} is {ground.several_text(at)}" for cell, at in group.several.items()]
        page = rendering.make_report(
            replace(result, warnings=(*findings, *result.warnings)),
            tested_claims(result, group.cells or [None], prior, p_fa, claim, claims),
            most=max(rendering.MOST_DETAILED, len(group.cells)),
            first=conspicuous,
            basemap=basemap,
            progress=progress.with_progress,
        )
        if basemap is not None and page.cell_map is None:
            print(f"{basemap} is not drawn: no cell is located or ambiguous", file=sys.stderr)
        documents.append(_write_page(page, file, folder, start_s))
        codes.append(page.exit_code)
    said = ground.document_of_groups(groups, documents)
    show(said, as_json=as_json)
    return max(codes)


def _write_page(
    page: rendering.Report, target: Path, picture_folder: Path | None, start_s: float
) -> document.Document:
    size = page.write(target)
    pictures = []
    if picture_folder:
        writing = page.write_figures(picture_folder)
        pictures = list(progress.with_progress(writing, "writing pictures", page.n_pictures))
    took_s = perf_counter() - start_s
    more = f", {len(pictures)} pictures in {picture_folder}" if pictures else ""
    detailed = f"{document.number_of(len(page.cells), 'cell')} in detail"
    content = {
        "path": target,
        "bytes": size,
        "cells": page.cells,
        "pictures": pictures,
        "seconds": round(took_s, 2),
    }
    text = f"{target}: {detailed}, {size / 1e6:.2f} MB in {took_s:.1f} s{more}"
    return document.Document(content, body=[text])
