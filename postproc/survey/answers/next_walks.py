"""Where walking would tell most, for several walkers at once."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import hypot

from logger.core.errors import ConfigError, EstimationError
from logger.core.guidance.street_atlas import Line
from logger.core.locator.pipeline import locate
from logger.core.places import Places
from postproc.ground import places_of
from postproc.guidance.next_walk import NextWalk, next_walk
from postproc.progress import with_progress
from postproc.result import Options
from postproc.survey.alignment import align
from postproc.survey.cell_location import LocatedCell, joined_readings, thin
from postproc.survey.dataset import Survey
from postproc.survey.tasks import RunChoice, runs_of

_TRIED_EACH = 3
"""Cells that are considered for each walker."""
_APART_M = 500.0
"""Between the places of two walkers; nearer, one route serves both cells."""


def next_walks(
    survey: Survey,
    located: Sequence[LocatedCell],
    choice: RunChoice,
    options: Options,
    n_walkers: int,
    starts: Sequence[Places] = (),
    lines: Iterable[Line] = (),
) -> dict[int, NextWalk]:
    """A walk for each walker, by number: unsure cells with most readings, by nats for each km.

    `starts` are where the walkers are, in turn. Cells that are located need no walk. Raises
    `ConfigError` where no cell is unsure.
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
                walks.append(_walk(survey, cell, choice, options, start, lines))
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
    choice: RunChoice,
    options: Options,
    start: Places | None,
    lines: Iterable[Line],
) -> NextWalk:
    parts = survey.observations(cell.area, [cell.cell], runs_of(survey, choice))[cell.cell]
    parts = places_of(parts)[cell.place - 1]
    obs = joined_readings(parts, [survey.runs[digest].modem for digest in parts])
    usable = thin(align(obs.usable()).obs)
    if usable.modem is not None:  # forecasts are of one modem
        offsets = locate(usable, options.prior).offsets
        if offsets is not None:
            usable = replace(usable.on_one_scale(offsets.mean_db), modem=None)
    return next_walk(usable, options.prior, start, lines)


def _is_apart(cell: LocatedCell, walk: NextWalk) -> bool:
    if cell.cell == walk.answer.cell or cell.x_m is None or cell.y_m is None:
        return False
    apart_m = hypot(cell.x_m - walk.posterior.x_m, cell.y_m - walk.posterior.y_m)
    return cell.zone != walk.start.utm.zone or apart_m > _APART_M
