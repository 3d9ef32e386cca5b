"""What a survey says of its loggers, over several cities: coverage, offsets, lies."""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from benchmarks.synthetic_city.surveys import (
    OPTIONS,
    SCANS,
    draw_survey,
    error_m,
    estimates_of,
    holds,
)
from benchmarks.synthetic_city.walks import Walker, draw_walkers
from benchmarks.synthetic_city.world import draw_city
from postproc.survey.agreement import liars, report
from postproc.survey.alignment import align
from postproc.survey.cell_location import LocatedCell, joined_readings
from postproc.survey.tasks import RunChoice, compare_loggers, tasks_of


def coverage(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Coverage and errors of 100 walks of 20 loggers in each city."""
    hits, errors_m, scores = [], [], []
    for seed in range(1, options.cities + 1):
        city, walkers = draw_city(12, seed), draw_walkers(20, seed)
        survey = draw_survey(folder / f"{seed}", city, walkers, 100 * SCANS * 4)
        located = [cell for cell in estimates_of(survey) if cell.x_m is not None]
        hits += [holds(city, cell) for cell in located]
        errors_m += [error_m(city, cell) for cell in located]
        scores += [value for cell in located for value in _offset_scores(cell, walkers)]
    low, high = wilson95(sum(hits), len(hits))
    yield (
        f"{len(hits)} cells of {options.cities} cities, 20 loggers: coverage {np.mean(hits):.3f} "
        f"({low:.3f} to {high:.3f})"
    )
    yield f"  error: median {np.median(errors_m):.0f} m, 90 % {np.quantile(errors_m, 0.9):.0f} m"
    inside = np.mean(np.array(scores) < 4.0)
    yield f"  {len(scores)} offsets: {inside:.2f} within two sigmas"


def wilson95(hits: int, n: int) -> tuple[float, float]:
    """Interval of a share (E. B. Wilson, JASA 22, 1927)."""
    interval = binomtest(hits, n).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def lies(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Two loggers that lie beyond doubt, and one that might be an odd modem."""
    shift_m, named, noted = [], [], []
    for seed in range(1, options.cities + 1):
        city, lying = draw_city(12, seed), draw_walkers(20, seed)
        # a liar is otherwise an average modem
        usual_db = float(np.median([walker.offset_db for walker in lying]))
        lying[3] = Walker(lying[3].name, usual_db, lie_db=20.0)
        lying[8] = Walker(lying[8].name, usual_db, lie_m=500.0)
        lying[14] = Walker(lying[14].name, usual_db, lie_db=12.0)
        survey = draw_survey(folder / f"{seed}", city, lying, 100 * SCANS * 4)
        tasks = tasks_of(survey, survey.cells(), RunChoice(), OPTIONS)
        loggers = report([one for task in tasks for one in compare_loggers(task)])
        accused = liars(loggers)
        named.append(set(accused) == {lying[3].name, lying[8].name})
        # an honest one of a hundred is as far off
        odd = {
            one.name for one in lying if 11.0 < abs(one.offset_db + one.lie_db - usual_db) < 15.0
        }
        noted.append({one.logger for one in loggers if one.remark} == odd)
        honest = estimates_of(survey, RunChoice(without=frozenset(accused)))
        alone = frozenset({lying[3].name, lying[8].name})
        without = {cell.cell: cell for cell in estimates_of(survey, RunChoice(without=alone))}
        shift_m += [
            float(np.hypot(cell.x_m - without[cell.cell].x_m, cell.y_m - without[cell.cell].y_m))
            for cell in honest
            if cell.x_m is not None and cell.cell in without
        ]
    yield f"+ 20 dB and 500 m off left out, nobody else: {sum(named)} of {len(named)} cities"
    yield f"  + 12 dB noted, nobody else: {sum(noted)} of {len(noted)} cities"
    yield f"  positions are those without the liars' runs to {max(shift_m):.1e} m"


def offsets(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Errors of the offsets of 20 modems in units of their sigmas, over many cities.

    All of a cell are against one modem, so cells count, and not offsets.
    """
    scores = []
    for seed in range(1, 4 * options.cities + 1):
        city, walkers = draw_city(12, seed), draw_walkers(20, seed)
        survey = draw_survey(folder / f"{seed}", city, walkers, 100 * SCANS * 4)
        true_db = {walker.name: walker.offset_db for walker in walkers}
        for one in survey.cells():
            parts = survey.observations(one.area, [one.cell])[one.cell]
            modems = [survey.runs[digest].modem for digest in parts]
            found = align(joined_readings(parts, modems).usable())
            names = list(dict.fromkeys(modems))
            error_db = found.offset_db - [true_db[name] - true_db[names[0]] for name in names]
            known = np.isfinite(found.sigma_db) & (found.sigma_db > 0.0)
            if np.any(known):
                scores.append(float(np.mean((error_db[known] / found.sigma_db[known]) ** 2)))
    sigma = np.std(scores) / np.sqrt(len(scores))
    yield (
        f"offsets in {len(scores)} cells of {4 * options.cities} cities: NEES "
        f"{np.mean(scores):.2f} +- {sigma:.2f} for each offset (1 is right)"
    )


def _offset_scores(cell: LocatedCell, walkers: list[Walker]) -> list[float]:
    """Squared errors of the offsets against the first, in units of their variances."""
    true_db = {walker.name: walker.offset_db for walker in walkers}
    first, *others = cell.offsets or (None,)
    return [
        float(((one.offset_db - true_db[one.modem] + true_db[first.modem]) / one.sigma_db) ** 2)
        for one in others
        if first is not None and one.offset_db is not None and one.sigma_db
    ]
