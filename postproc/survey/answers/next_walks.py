"""Where walking would tell most, for several walkers at once."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from logger.core.errors import ConfigError, EstimationError
from logger.core.guidance.street_atlas import Line
from logger.core.places import Places
from postproc.ground import away_m, places_of
from postproc.guidance.next_walk import FARTHEST_START_M, NextWalk, next_walk
from postproc.progress import with_progress
from postproc.result import Options
from postproc.survey.alignment import align
from postproc.survey.cell_location import LocatedCell, in_time_order, joined_readings, thin
from postproc.survey.dataset import Survey

_TRIED_EACH = 3
"""Cells that are considered for each walker."""
_APART_M = 500.0
"""Between the places of two walkers; nearer, one route serves both cells."""
NONE_LEFT = f"no unsure cell is left near the start and {_APART_M:.0f} m from those of the others"


def next_walks(
    survey: Survey,
    located: Sequence[LocatedCell],
    options: Options,
    n_walkers: int,
    starts: Sequence[Places] = (),
    lines: Iterable[Line] = (),
) -> dict[int, NextWalk]:
    """A walk for each walker, by number: unsure cells with most readings, by nats for each km.

    The answer of each is that of `located`; cells that are located need no walk. `starts` are where
    the walkers are, in turn: cells far from there are for others. Raises `ConfigError` where no
    cell is unsure, or none near a start.
    """
    unsure = [cell for cell in located if cell.verdict != "located" and cell.x_m is not None]
    if not unsure:
        raise ConfigError("every cell that has a position is located: no walk is needed")
    unsure.sort(key=lambda cell: (-cell.n_readings, cell.cell))
    at_deg = np.array([(cell.lat_deg, cell.lon_deg) for cell in unsure], float).T
    is_taken = np.zeros(len(unsure), np.bool_)
    chosen: dict[int, NextWalk] = {}
    for walker in range(n_walkers):
        start = starts[walker % len(starts)] if starts else None
        is_free = ~is_taken
        if start is not None:
            is_free &= away_m(at_deg, start.on_map) <= FARTHEST_START_M
        tried = [unsure[k] for k in np.flatnonzero(is_free)[:_TRIED_EACH].tolist()]
        walks = []
        for cell in with_progress(tried, "planning", len(tried), [one.cell for one in tried]):
            try:
                runs = [run for one in located if one.cell == cell.cell for run in one.runs]
                walks.append(_walk(survey, cell, runs, options, start, lines))
            except (ConfigError, EstimationError):  # no route, or no place
                continue
        if walks:
            best = max(walks, key=lambda walk: walk.routes[0].nats_per_km)
            chosen[walker + 1] = best
            assert best.answer.place is not None  # of a posterior
            is_taken |= away_m(at_deg, best.answer.place) <= _APART_M
    if not chosen:
        far = f" within {FARTHEST_START_M / 1000:.0f} km of --from; latitude comes first"
        raise ConfigError(f"no route leads to any of the unsure cells{far if starts else ''}")
    return chosen


def _walk(
    survey: Survey,
    cell: LocatedCell,
    runs: Sequence[str],
    options: Options,
    start: Places | None,
    lines: Iterable[Line],
) -> NextWalk:
    parts = survey.observations(cell.area, [cell.cell], runs)[cell.cell]
    parts = in_time_order(places_of(parts)[cell.place - 1], survey.runs)
    obs = joined_readings(parts, [survey.runs[digest].modem for digest in parts])
    walk = next_walk(thin(align(obs.usable()).obs), options.prior, start, lines)
    answer = replace(walk.answer, verdict=cell.verdict, reasons=cell.reasons)
    return walk._replace(answer=answer)
