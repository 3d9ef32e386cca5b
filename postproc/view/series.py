"""What changes with time: levels, path loss, consistency and accuracy of the estimators."""

from typing import NamedTuple

import numpy as np
import rerun as rr

from logger.core.arrays import FloatArray, IntArray
from postproc.estimators.filters import FilterPath
from postproc.estimators.metrics import NIS_95, NIS_999
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.view.rerun_writer import (
    Sheet,
    band,
    dots,
    ellipse_axes,
    entity,
    line,
    steps,
    two_sigma,
)
from postproc.view.view_model import Story, Subject

MOST_DOTS = 40_000
"""Points are not thinned by the viewer, lines are: above this the other cells are drawn as
lines.
"""
_FAINT = 80
NIS_BOUNDS = ((0.95, NIS_95), (0.999, NIS_999))


class Quantity(NamedTuple):
    """One of the path loss parameters: its place in the state, and what the posterior calls it."""

    path: str
    name: str
    row: int
    mean: str
    sigma: str
    reach: float
    """How far from the posterior's mean the axis may go."""


QUANTITIES = (
    Quantity("p0", "P0", 2, "p0_dbm", "p0_sigma_db", 60.0),
    Quantity("eta", "eta", 3, "eta", "eta_sigma", 4.0),
)


def draw_series(sheet: Sheet, story: Story) -> None:
    """Every plot over time; without readings there is none."""
    draw_levels(sheet, story)
    span = time_span(story)
    if span is None:
        return
    for subject in story.subjects:
        for quantity in QUANTITIES:
            _path_loss(sheet, subject, quantity, span)
        _consistency(sheet, subject, span)
        _area(sheet, subject)
        _accuracy(sheet, story, subject)


def time_span(story: Story) -> IntArray | None:
    """First and last time since boot of anything drawn over time; None when there is nothing."""
    times = [walk.t_ns for walk in story.walks] + [
        levels.t_ns for walk in story.walks for levels in walk.levels
    ]
    times = [t_ns for t_ns in times if len(t_ns)]
    if not times:
        return None
    return np.array([min(int(t[0]) for t in times), max(int(t[-1]) for t in times)])


def filters(subject: Subject) -> list[tuple[str, str, Colour, FilterPath]]:
    """The filters of a cell: key, name, colour, path."""
    both = (
        ("reference", "reference (wrong)", colours.REFERENCE, subject.result.reference),
        ("ekf", "EKF", colours.EKF, subject.result.ekf),
    )
    return [
        (key, name, colour, filtered)
        for key, name, colour, filtered in both
        if filtered is not None
    ]


def axis_range(subject: Subject, quantity: Quantity) -> tuple[float, float] | None:
    """Range that shows the bands, not only their lines, as far as they are near the answer; None
    without one.
    """
    posterior = subject.result.posterior
    if posterior is None:
        return None
    mean = getattr(posterior, quantity.mean)
    ends = [_band(quantity, subject)]
    ekf = subject.result.ekf
    if ekf is not None:
        spread = 2.0 * np.sqrt(np.maximum(ekf.p[:, quantity.row, quantity.row], 0.0))
        ends += [ekf.x[:, quantity.row] - spread, ekf.x[:, quantity.row] + spread]
    ends += [
        estimate.x[[quantity.row]]
        for estimate in subject.picture.estimates
        if estimate.key != "reference"
    ]
    values = np.concatenate(ends)
    near = values[np.isfinite(values) & (np.abs(values - mean) <= quantity.reach)]
    low, high = (float(near.min()), float(near.max())) if len(near) else (mean - 1.0, mean + 1.0)
    margin = 0.05 * max(high - low, 0.1)
    return low - margin, high + margin


def draw_levels(sheet: Sheet, story: Story) -> None:
    """Levels of all cells as they were read: those told in full as lines on top, the others as dots
    below them.
    """
    told = {subject.cell for subject in story.subjects}
    read = [levels for walk in story.walks for levels in walk.levels]
    as_dots = sum(len(levels.t_ns) for levels in read if levels.cell not in told) <= MOST_DOTS
    for levels in sorted(read, key=lambda levels: levels.cell in told):
        path, ink = entity("rssi", levels.cell), story.inks[levels.cell]
        if levels.cell in told:
            sheet.always(path, line(levels.cell, ink, 2.0))
        else:
            # lines are drawn in the order of their names: faint ones leave those below in sight
            sheet.always(
                path, dots(levels.cell, ink) if as_dots else line(levels.cell, (*ink, _FAINT), 1.0)
            )
        sheet.over_time(path, levels.t_ns, rr.Scalars.columns(scalars=levels.level_dbm))


def _path_loss(sheet: Sheet, subject: Subject, quantity: Quantity, span: IntArray) -> None:
    """P0 or eta by every estimator: bands of two sigma for EKF and posterior, lines for the
    others.
    """
    i = quantity.row
    if subject.steps:
        path = entity("series", subject.cell, quantity.path, "posterior")
        sheet.always(path, band("posterior", colours.POSTERIOR))
        mean, sigma = (_of_steps(subject, name) for name in (quantity.mean, quantity.sigma))
        sheet.over_time(path, _times(subject), two_sigma(mean, sigma**2))
    for estimate in subject.picture.estimates:
        if estimate.key in ("batch", "rts"):
            path = entity("series", subject.cell, quantity.path, estimate.key)
            _constant(sheet, path, estimate.name, estimate.colour, float(estimate.x[i]), span)
    for key, name, colour, filtered in filters(subject):
        known = np.isfinite(filtered.x[:, i]) & np.isfinite(filtered.p[:, i, i])
        path, t_ns, value = (
            entity("series", subject.cell, quantity.path, key),
            filtered.t_ns[known],
            filtered.x[known, i],
        )
        if key == "ekf":
            sheet.always(path, band(name, colour))
            sheet.over_time(path, t_ns, two_sigma(value, np.maximum(filtered.p[known, i, i], 0.0)))
        else:
            sheet.always(path, line(name, colour, 1.0))
            sheet.over_time(path, t_ns, rr.Scalars.columns(scalars=value))


def _consistency(sheet: Sheet, subject: Subject, span: IntArray) -> None:
    """Normalised innovations squared: chi-square with one degree of freedom for a filter that knows
    its errors.
    """
    found = filters(subject)
    for key, name, colour, filtered in found:
        with np.errstate(divide="ignore", invalid="ignore"):
            nis = filtered.nis
        known = np.isfinite(nis)
        path = entity("series", subject.cell, "nis", key)
        sheet.always(path, dots(name, colour, 2.0))
        sheet.over_time(path, filtered.t_ns[known], rr.Scalars.columns(scalars=nis[known]))
    if any(len(filtered) for _, _, _, filtered in found):
        for (share, bound), colour in zip(NIS_BOUNDS, colours.BOUNDS, strict=True):
            path = entity("series", subject.cell, "nis", f"bound{share:g}")
            _constant(sheet, path, f"{share * 100:g} %", colour, bound, span)


def _area(sheet: Sheet, subject: Subject) -> None:
    """Areas of 95 % as decimal logarithms: they shrink over many powers of ten, and the viewer has
    no such axis.
    """
    if subject.steps:
        path = entity("series", subject.cell, "area", "posterior")
        sheet.always(path, steps("posterior region", colours.POSTERIOR))
        area_m2 = np.array([step.posterior.region_area_m2 for step in subject.steps])
        sheet.over_time(path, _times(subject), rr.Scalars.columns(scalars=np.log10(area_m2)))
    for key, name, colour, filtered in filters(subject):
        axes, _ = ellipse_axes(filtered.p)
        with np.errstate(divide="ignore", invalid="ignore"):
            lg_area = np.log10(np.pi * axes[:, 0] * axes[:, 1])
        known = np.isfinite(lg_area)
        path = entity("series", subject.cell, "area", key)
        sheet.always(path, line(name, colour))
        sheet.over_time(path, filtered.t_ns[known], rr.Scalars.columns(scalars=lg_area[known]))


def _accuracy(sheet: Sheet, story: Story, subject: Subject) -> None:
    """Radius around the best place that holds 95 %, and in a simulation how far off it is."""
    if not subject.steps:
        return
    path = entity("series", subject.cell, "accuracy", "r95")
    sheet.always(path, steps("posterior", colours.POSTERIOR))
    sheet.over_time(path, _times(subject), rr.Scalars.columns(scalars=_of_steps(subject, "r95_m")))
    if subject.picture.truth_m is not None:
        path = entity("series", subject.cell, "accuracy", "error")
        sheet.always(path, steps("error", colours.TRUTH))
        off = (
            story.local(_of_steps(subject, "x_m"), _of_steps(subject, "y_m"))
            - subject.picture.truth_m
        )
        sheet.over_time(
            path, _times(subject), rr.Scalars.columns(scalars=np.hypot(off[:, 0], off[:, 1]))
        )


def _constant(
    sheet: Sheet, path: str, name: str, colour: Colour, value: float, span: IntArray
) -> None:
    """A value that holds for the whole run, as a level line."""
    sheet.always(path, line(name, colour))
    sheet.over_time(path, span, rr.Scalars.columns(scalars=np.full(2, value)))


def _times(subject: Subject) -> IntArray:
    return np.array([step.t_ns for step in subject.steps], np.int64)


def _of_steps(subject: Subject, name: str) -> FloatArray:
    return np.array([getattr(step.posterior, name) for step in subject.steps], float)


def _band(quantity: Quantity, subject: Subject) -> FloatArray:
    """Ends of the posterior's band over the later half of the walk; at the beginning it is as wide
    as the prior.
    """
    late = subject.steps[len(subject.steps) // 2 :]
    pairs = [
        (getattr(step.posterior, quantity.mean), getattr(step.posterior, quantity.sigma))
        for step in late
    ]
    return np.array([mean + side * sigma for mean, sigma in pairs for side in (-2.0, 2.0)])
