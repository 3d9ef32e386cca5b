"""Where walking would tell most, for several walkers at once."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import hypot

from logger.core.errors import ConfigError, EstimationError
from logger.core.guidance.street_atlas import Line
from logger.core.places import Places
from postproc.ground import places_of
from postproc.guidance.next_walk import NextWalk, next_walk
from postproc.progress import with_progress
from postproc.result import Options
from postproc.survey.alignment import align
from postproc.survey.cell_location import LocatedCell, in_time_order, joined_readings, thin
from postproc.survey.dataset import Survey

_TRIED_EACH = 3
"""Cells that are considered for each walker."""
_APART_M = 500.0
"""Between the places of two walkers; nearer, one route serves both cells."""


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
    the walkers are, in turn. Raises `ConfigError` where no cell is unsure.
    """
    unsure = [cell for cell in located if cell.verdict != "located" and cell.x_m is not None]
    if not unsure:
        raise ConfigError("every cell that has a position is located: no walk is needed")
    unsure.sort(key=lambda cell: (-cell.n_readings, cell.cell))
    chosen: dict[int, NextWalk] = {}
    for walker in range(n_walkers):
        start = starts[walker % len(starts)] if starts else None
        free = [cell for cell in unsure if all(_is_apart(cell, walk) for walk in chosen.values())]
        tried = free[:_TRIED_EACH]
        walks = []
        for cell in with_progress(tried, "planning", len(tried), [one.cell for one in tried]):
            try:
                runs = [run for one in located if one.cell == cell.cell for run in one.runs]
                walks.append(_walk(survey, cell, runs, options, start, lines))
            except (ConfigError, EstimationError):  # no route, or no place
                continue
        if walks:
            chosen[walker + 1] = max(walks, key=lambda walk: walk.routes[0].nats_per_km)
    if not chosen:
        raise ConfigError("no route leads to any of the unsure cells")
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


def _is_apart(cell: LocatedCell, walk: NextWalk) -> bool:
    if cell.cell == walk.answer.cell or cell.x_m is None or cell.y_m is None:
        return False
    apart_m = hypot(cell.x_m - walk.posterior.x_m, cell.y_m - walk.posterior.y_m)
    return cell.zone != walk.start.utm.zone or apart_m > _APART_M
