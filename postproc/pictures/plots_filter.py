"""A filter on paper: path loss over time, and whether its innovations are what it expects."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from logger.core.arrays import FloatArray
from logger.core.locator.posterior import Posterior
from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import NIS_95, Consistency
from postproc.pictures import colours
from postproc.pictures.picture import Picture
from postproc.pictures.plots_style import MOST_VECTORS, rgb, thinned

_LEAST_NIS = 1e-4


class Parameter(NamedTuple):
    """One of the path loss parameters: its name, its unit and its row in the state."""

    name: str
    unit: str
    row: int


P0 = Parameter("P0", "dBm", 2)
ETA = Parameter("eta", "", 3)


def draw_parameter(axes: Axes, picture: Picture, parameter: Parameter) -> None:
    """P0 or eta by the EKF as it walks, with 2 sigma, and what the posterior says after the whole
    walk.
    """
    focus = picture.focus
    if focus is None or focus.posterior is None:
        return
    mean, sigma = of_posterior(focus.posterior, parameter)
    blue = rgb(colours.POSTERIOR)
    axes.axhspan(mean - 2 * sigma, mean + 2 * sigma, color=blue, alpha=0.13, linewidth=0)
    axes.axhline(mean, color=blue, linewidth=1.2, label="posterior of the whole walk, ± 2 sigma")
    if focus.ekf is not None:
        shown = thinned(len(focus.ekf), MOST_VECTORS)
        minutes = picture.clock.minutes(focus.ekf.t_ns[shown])
        value, spread = (
            focus.ekf.x[shown, parameter.row],
            _two_sigma(focus.ekf, parameter.row)[shown],
        )
        orange = rgb(colours.EKF)
        axes.fill_between(
            minutes, value - spread, value + spread, color=orange, alpha=0.22, linewidth=0
        )
        axes.plot(minutes, value, color=orange, linewidth=1.2, label="EKF, ± 2 sigma")
    axes.set_ylabel(f"{parameter.name} ({parameter.unit})" if parameter.unit else parameter.name)
    axes.grid(visible=True)


def draw_nis(axes: Axes, picture: Picture, filtered: FilterPath) -> None:
    """Innovations squared by what the filter expects of them: 95 % of an honest filter's lie below
    the line.
    """
    axes.set_title("innovations squared, normalised (NIS)")
    with np.errstate(divide="ignore", invalid="ignore"):
        nis = filtered.nis
    known = np.isfinite(nis)
    minutes, many = (
        picture.clock.minutes(filtered.t_ns[known]),
        np.count_nonzero(known) > MOST_VECTORS,
    )
    axes.plot(
        minutes,
        np.maximum(nis[known], _LEAST_NIS),
        ".",
        color=rgb(colours.EKF),
        markersize=3,
        rasterized=bool(many),
    )
    label = f"95 % bound, {NIS_95:g}"
    axes.axhline(
        NIS_95, color=rgb(colours.BOUNDS[0]), linewidth=1.2, linestyle=(0, (4, 3)), label=label
    )
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("minutes since the start")
    axes.set_ylabel("NIS")
    axes.grid(visible=True)


def draw_autocorrelation(axes: Axes, seen: Consistency) -> None:
    """Of innovations: white ones stay within the band at 95 % of the lags."""
    axes.set_title("autocorrelation of the innovations")
    lags = np.arange(1, len(seen.autocorrelation) + 1)
    green = rgb(colours.BOUNDS[0])
    axes.axhspan(
        -seen.white_bound,
        seen.white_bound,
        color=green,
        alpha=0.2,
        linewidth=0,
        label="95 % of white noise",
    )
    axes.vlines(lags, 0.0, seen.autocorrelation, color=rgb(colours.EKF), linewidth=2.5)
    axes.axhline(0.0, color=rgb(colours.MUTED), linewidth=0.8)
    largest = max(map(abs, seen.autocorrelation), default=0.0)
    reach = min(1.1 * max(largest, 2.0 * seen.white_bound, 0.2), 1.1)
    axes.set_ylim(-reach, reach)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("lag (readings)")
    axes.grid(visible=True)


def of_posterior(posterior: Posterior, parameter: Parameter) -> tuple[float, float]:
    """Mean and sigma of a parameter after the whole walk."""
    if parameter is P0:
        return posterior.p0_dbm, posterior.p0_sigma_db
    return posterior.eta, posterior.eta_sigma


def _two_sigma(filtered: FilterPath, row: int) -> FloatArray:
    return np.asarray(2.0 * np.sqrt(np.maximum(filtered.p[:, row, row], 0.0)), float)
