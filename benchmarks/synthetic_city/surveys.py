"""Surveys of a synthetic city, and how its estimates compare with the truth."""

from pathlib import Path

import numpy as np
import shapely

from benchmarks.synthetic_city.walks import Walker, draw_walk
from benchmarks.synthetic_city.world import ORIGIN_M, ZONE, City
from logger.core.places import Utm
from postproc.result import Options
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey
from postproc.survey.location import EVERY_RUN
from postproc.survey.parquet_batch import Batch
from postproc.survey.tasks import RunChoice, locate_cells, runs_of, tasks_of

SCANS = 800
"""Of a walk: 40 minutes."""
OPTIONS = Options()
"""Those of `postproc survey`."""


def draw_survey(folder: Path, city: City, walkers: list[Walker], n_readings: int) -> Survey:
    """Walks until there are so many readings, 20 loggers in turn."""
    survey = Survey.open_or_make(folder)
    batch, number, written = Batch(), 0, 0
    while written + batch.n_rows < n_readings:
        walk = draw_walk(city, walkers[number % len(walkers)], number, SCANS, city.seed)
        batch.take(walk)
        number += 1
        if batch.is_full:
            written += batch.n_rows
            batch.write(folder, f"{len(list((folder / 'readings').rglob('*'))):06d}")
            batch = Batch()
    if batch.walks:
        batch.write(folder, "999999")
    return Survey.open(survey.folder)


def estimates_of(survey: Survey, choice: RunChoice = EVERY_RUN) -> list[LocatedCell]:
    """All cells, in this process."""
    tasks = tasks_of(survey, survey.cells(runs_of(survey, choice)), choice, OPTIONS)
    return [cell for task in tasks for cell in locate_cells(task)]


def station_of(city: City, cell: str) -> int:
    """Number of the station with this name."""
    return city.names.index(cell)


def error_m(city: City, cell: LocatedCell) -> float:
    """Distance of the estimate from the station."""
    x_m, y_m = city.position_m[station_of(city, cell.cell)] + ORIGIN_M
    return float(np.hypot((cell.x_m or np.nan) - x_m, (cell.y_m or np.nan) - y_m))


def holds(city: City, cell: LocatedCell) -> bool:
    """Whether the 95 % region contains the station."""
    x_m, y_m = city.position_m[station_of(city, cell.cell)] + ORIGIN_M
    lat_deg, lon_deg = Utm(ZONE).to_latlon(float(x_m), float(y_m))
    return bool(shapely.from_wkb(cell.region_wkb).contains(shapely.Point(lon_deg, lat_deg)))
