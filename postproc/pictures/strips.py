"""Every cell of a run as a strip of colours over time: who was heard when, and how loud."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from logger.core.arrays import FloatArray
from postproc.pictures import colours
from postproc.pictures.picture import Clock, Levels

_MOST_PARTS = 240


class Strips(NamedTuple):
    """Mean level of each cell in each part of the run, shape (cells, parts), NaN where it was not
    heard.
    """

    level_dbm: FloatArray
    minutes: float


def strips_of(rows: Sequence[Levels | None], clock: Clock) -> Strips | None:
    """Levels of cells from the start of the run to the last one, in a few hundred parts at most;
    None without any.
    """
    minutes = [np.empty(0) if row is None else clock.minutes(row.t_ns) for row in rows]
    end = max((float(at.max()) for at in minutes if len(at)), default=0.0)
    if end <= 0.0:
        return None
    # wide enough for two readings of the cell heard most, that silence is a gap and the way of
    # scanning is none
    parts = int(np.clip(max(len(at) for at in minutes) // 2, 1, _MOST_PARTS))
    level_dbm = np.full((len(rows), parts), np.nan)
    for i, (row, at) in enumerate(zip(rows, minutes, strict=True)):
        if row is not None:
            part = np.clip((at / end * parts).astype(np.int64), 0, parts - 1)
            count = np.bincount(part, minlength=parts)
            heard = count > 0
            level_dbm[i, heard] = np.bincount(part, row.level_dbm, parts)[heard] / count[heard]
    return Strips(level_dbm, end)


def draw_strips(figure: Figure, axes: Axes, found: Strips) -> None:
    """The first cell on top, numbered from 1."""
    low, high = np.nanpercentile(found.level_dbm, (2.0, 98.0))
    levels = axes.imshow(
        found.level_dbm,
        aspect="auto",
        interpolation="nearest",
        cmap=ListedColormap(colours.scale(256) / 255.0),
        vmin=float(np.floor(low)),
        vmax=float(max(np.ceil(high), np.floor(low) + 1.0)),
        extent=(0.0, found.minutes, len(found.level_dbm) + 0.5, 0.5),
    )
    bar = figure.colorbar(levels, ax=axes, label="level (dBm)", extend="both", aspect=12)
    bar.locator = MaxNLocator(4, integer=True)
    bar.outline.set_visible(False)
    axes.yaxis.set_major_locator(MaxNLocator(10, integer=True, min_n_ticks=1))
    axes.set_xlabel("minutes since the start")
    axes.set_ylabel("cell no.")
