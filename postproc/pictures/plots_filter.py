"""A printed filter: path loss over time, and whether its innovations are consistent."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import NIS_95, Consistency
from postproc.pictures import colours
from postproc.pictures.clock import Clock
from postproc.pictures.geometry import evenly_spaced
from postproc.pictures.path_loss import Parameter
from postproc.pictures.picture import Picture
from postproc.pictures.plots_style import DASHED, MOST_VECTORS, rgb

_LEAST_NIS = 1e-4
"""Smaller values are drawn here: a logarithmic axis has no zero."""


def draw_parameter(axes: Axes, picture: Picture, parameter: Parameter) -> None:
    """P0 or eta of the EKF over time, and of the posterior after the walk, with 2 sigma."""
    focus = picture.focus
    if focus is None or focus.posterior is None:
        return
    mean, sigma = parameter.of_posterior(focus.posterior)
    blue, orange = rgb(colours.POSTERIOR), rgb(colours.EKF)
    axes.axhspan(mean - 2.0 * sigma, mean + 2.0 * sigma, color=blue, alpha=0.13, linewidth=0)
    axes.axhline(mean, color=blue, linewidth=1.2, label="posterior after the walk, ± 2 sigma")
    if focus.ekf is not None:
        shown = evenly_spaced(len(focus.ekf), MOST_VECTORS)
        minutes = picture.survey.clock.minutes(focus.ekf.t_ns[shown])
        value, sigmas = parameter.of_states(focus.ekf.x[shown], focus.ekf.p[shown])
        low, high = value - 2.0 * sigmas, value + 2.0 * sigmas
        axes.fill_between(minutes, low, high, color=orange, alpha=0.22, linewidth=0)
        axes.plot(minutes, value, color=orange, linewidth=1.2, label="EKF, ± 2 sigma")
    axes.set_ylabel(f"{parameter.name} ({parameter.unit})" if parameter.unit else parameter.name)


def draw_nis(axes: Axes, clock: Clock, filtered: FilterPath) -> None:
    """Normalised innovations squared: 95 % of a consistent filter's are below the line."""
    axes.set_title("normalised innovations squared (NIS)")
    with np.errstate(divide="ignore", invalid="ignore"):
        nis = filtered.nis
    finite = np.isfinite(nis)
    minutes, values = clock.minutes(filtered.t_ns[finite]), np.maximum(nis[finite], _LEAST_NIS)
    many = len(values) > MOST_VECTORS
    axes.plot(minutes, values, ".", color=rgb(colours.EKF), markersize=3, rasterized=many)
    green, label = rgb(colours.BOUNDS[0]), f"95 % bound, {NIS_95:g}"
    axes.axhline(NIS_95, color=green, linewidth=1.2, linestyle=DASHED, label=label)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("minutes since the start")
    axes.set_ylabel("NIS")


def draw_autocorrelation(axes: Axes, consistency: Consistency) -> None:
    """Autocorrelation of the innovations: white noise stays within the band at 95 % of the lags."""
    axes.set_title("autocorrelation of the innovations")
    values, bound = consistency.autocorrelation, consistency.white_bound
    green, label = rgb(colours.BOUNDS[0]), "95 % of white noise"
    axes.axhspan(-bound, bound, color=green, alpha=0.2, linewidth=0, label=label)
    lags = np.arange(1, len(values) + 1)
    axes.vlines(lags, 0.0, values, color=rgb(colours.EKF), linewidth=2.5)
    axes.axhline(0.0, color=rgb(colours.MUTED), linewidth=0.8)
    largest = max(map(abs, values), default=0.0)
    limit = min(1.1 * max(largest, 2.0 * bound, 0.2), 1.1)
    axes.set_ylim(-limit, limit)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("lag (readings)")
