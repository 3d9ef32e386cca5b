"""Every cell of a run as a strip of colours over time: when it was received, and how strong."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from logger.core.arrays import FloatArray
from postproc.pictures.clock import Clock
from postproc.pictures.picture import colour_range_dbm
from postproc.pictures.plots_style import level_bar, level_colours
from postproc.pictures.survey import Levels

_MOST_INTERVALS = 240
"""More would be narrower than a pixel on a telephone."""


class Strips(NamedTuple):
    """Mean level of each cell in each interval, shape (cells, intervals); NaN without a reading."""

    level_dbm: FloatArray
    minutes: float


def strips_of(rows: Sequence[Levels | None], clock: Clock) -> Strips | None:
    """Mean levels of cells over equal intervals from the start to the last reading.

    None without a reading.
    """
    minutes = [np.empty(0) if row is None else clock.minutes(row.t_ns) for row in rows]
    end = max((float(times.max()) for times in minutes if len(times)), default=0.0)
    if end <= 0.0:
        return None
    # two readings of the cell read most often fit in an interval: a gap then is a real silence
    most_readings = max(map(len, minutes))
    count = int(np.clip(most_readings // 2, 1, _MOST_INTERVALS))
    level_dbm = np.full((len(rows), count), np.nan)
    for i, (row, times) in enumerate(zip(rows, minutes, strict=True)):
        if row is not None:
            interval = np.clip((times / end * count).astype(np.int64), 0, count - 1)
            n_readings = np.bincount(interval, minlength=count)
            has_reading = n_readings > 0
            sums = np.bincount(interval, row.level_dbm, count)
            level_dbm[i, has_reading] = sums[has_reading] / n_readings[has_reading]
    return Strips(level_dbm, end)


def draw_strips(figure: Figure, axes: Axes, strips: Strips) -> None:
    """One row for each cell, numbered from 1 at the top."""
    image = axes.imshow(
        strips.level_dbm,
        aspect="auto",
        interpolation="nearest",
        extent=(0.0, strips.minutes, len(strips.level_dbm) + 0.5, 0.5),
        **level_colours(colour_range_dbm(strips.level_dbm)),
    )
    level_bar(figure, axes, image, 4, aspect=12)
    axes.grid(visible=False)
    axes.yaxis.set_major_locator(MaxNLocator(10, integer=True, min_n_ticks=1))
    axes.set_xlabel("minutes since the start")
    axes.set_ylabel("cell no.")
