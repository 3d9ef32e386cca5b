"""The comparison of two runs: their walks in one UTM zone, and what changed between them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from logger.core.errors import EstimationError
from logger.core.places import Utm
from logger.core.readings import Observations
from logger.core.runfile import Run
from postproc.comparison.changes import FALSE_WORDS, CellChange, Comparison, compare
from postproc.comparison.ground import BLOCK_M, Grid
from postproc.json_text import Json
from postproc.multi_run import check_different, in_one_zone, modems_of
from postproc.walk import observe_run

_DECIMALS = 6
"""Of degrees: 0.1 m."""


@dataclass(frozen=True, slots=True)
class ComparedRuns:
    """Two runs and their comparison; `utm` is the zone of the blocks."""

    a: Path
    b: Path
    same_modem: bool
    warnings: tuple[str, ...]
    utm: Utm
    comparison: Comparison


def compare_runs(a: Run, b: Run) -> ComparedRuns:
    """Compare two runs.

    Raises `ConfigError` for one run twice, `EstimationError` for a run without a position,
    `GeoError` for runs too far apart.
    """
    check_different([a, b])
    observed = in_one_zone([observe_run(a), observe_run(b)])
    walks: list[Observations] = []
    for run in observed:
        if run.observations is None:
            raise EstimationError(f"{run.run.path}: {run.warnings[0]}")
        walks.append(run.observations)
    numbers = modems_of([a, b])
    same_modem = numbers[0] == numbers[1]
    compared = compare(walks[0].cells, walks[1].cells, same_modem=same_modem)
    warnings = tuple(f"{run.run.path}: {text}" for run in observed for text in run.warnings)
    return ComparedRuns(a.path, b.path, same_modem, warnings, walks[0].track.utm, compared)


def document_of(compared: ComparedRuns) -> Json:
    """The comparison as JSON: positions of blocks in degrees, levels in dB."""
    comparison = compared.comparison
    return {
        "a": str(compared.a),
        "b": str(compared.b),
        "same_modem": compared.same_modem,
        "warnings": compared.warnings,
        "block_m": BLOCK_M,
        "common_blocks": comparison.n_common_blocks,
        "offset_db": comparison.offset_db,
        "tests": comparison.n_tests,
        "false_words_per_pair": FALSE_WORDS,
        "cells": [_cell_document(cell, compared.utm, comparison.grid) for cell in comparison.cells],
    }


def _cell_document(cell: CellChange, utm: Utm, grid: Grid) -> Json:
    lat_deg, lon_deg = utm.to_latlon_arrays(*grid.centres_m(cell.block))
    columns: tuple[Any, ...] = (
        np.round(lat_deg, _DECIMALS).tolist(),
        np.round(lon_deg, _DECIMALS).tolist(),
        np.round(cell.difference_db, 1).tolist(),
    )
    blocks = [
        {"lat": lat, "lon": lon, "difference_db": db} for lat, lon, db in zip(*columns, strict=True)
    ]
    return {
        "cell": cell.cell,
        "rat": cell.rat or None,
        "word": cell.word,
        "text": cell.text,
        "readings_a": cell.n_a,
        "readings_b": cell.n_b,
        "blocks": cell.n_blocks,
        "change_db": cell.change_db,
        "sigma_db": cell.sigma_db,
        "contrast_db": cell.contrast_db,
        "p": cell.p,
        "where": blocks if cell.is_change else [],
        "error": cell.error,
    }
