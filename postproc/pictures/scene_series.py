"""What changes with time: levels, path loss, consistency and accuracy of the filters, events."""

from typing import NamedTuple

import numpy as np
import rerun as rr

from logger.core.arrays import IntArray
from postproc.estimators.filtered import Filtered
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.picture import Picture
from postproc.pictures.scene_sheet import Sheet, band, dots, ellipse_axes, entity, line, two_sigma

_MOST_DOTS = 40_000
"""Points are not thinned by the viewer, lines are: above this the other cells are drawn as lines."""
CHI2_BOUNDS = ((0.95, 3.841), (0.999, 10.828))
"""Chi-square with one degree of freedom."""
_LEVELS = {b"info": "INFO", b"warning": "WARN", b"error": "ERROR"}


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


def draw_series(sheet: Sheet, picture: Picture) -> None:
    """Every plot over time; without readings there is none."""
    _levels(sheet, picture)
    _events(sheet, picture)
    span = time_span(picture)
    if picture.focus is None or span is None:
        return
    for quantity in QUANTITIES:
        _path_loss(sheet, picture, quantity, span)
    for key, name, colour, filtered in filters(picture):
        _consistency(sheet, key, name, colour, filtered)
        _accuracy(sheet, picture, key, name, colour, filtered)
    if any(len(filtered) for _, _, _, filtered in filters(picture)):
        for (share, bound), colour in zip(CHI2_BOUNDS, colours.BOUNDS, strict=True):
            _constant(sheet, f"nis/bound{share:g}", f"chi-square {share * 100:g} %", colour, bound, span)
    if picture.focus.posterior is not None:
        r95_m = picture.focus.posterior.r95_m
        _constant(sheet, "accuracy/posterior", "posterior 95 % radius", colours.POSTERIOR, r95_m, span)


def time_span(picture: Picture) -> IntArray | None:
    """First and last time since boot of anything drawn over time; None when there is nothing."""
    times = [levels.t_ns for levels in picture.levels]
    if picture.track is not None:
        times.append(picture.track.t_ns)
    times = [t_ns for t_ns in times if len(t_ns)]
    if not times:
        return None
    return np.array([min(int(t[0]) for t in times), max(int(t[-1]) for t in times)])


def filters(picture: Picture) -> list[tuple[str, str, Colour, Filtered]]:
    """The filters of the focus: key, name, colour, path."""
    focus = picture.focus
    both = (
        ("reference", "reference EKF (wrong)", colours.REFERENCE, focus.reference if focus else None),
        ("ekf", "EKF", colours.EKF, focus.ekf if focus else None),
    )
    return [(key, name, colour, filtered) for key, name, colour, filtered in both if filtered is not None]


def axis_range(picture: Picture, quantity: Quantity) -> tuple[float, float] | None:
    """Range that shows the bands, not only their lines, as far as they are near the posterior; None without one."""
    posterior = picture.focus.posterior if picture.focus else None
    if posterior is None:
        return None
    mean, sigma = getattr(posterior, quantity.mean), getattr(posterior, quantity.sigma)
    ends = [np.array([mean - 2.0 * sigma, mean + 2.0 * sigma])]
    ekf = picture.focus.ekf if picture.focus else None
    if ekf is not None:
        spread = 2.0 * np.sqrt(np.maximum(ekf.p[:, quantity.row, quantity.row], 0.0))
        ends += [ekf.x[:, quantity.row] - spread, ekf.x[:, quantity.row] + spread]
    ends += [estimate.x[[quantity.row]] for estimate in picture.estimates if estimate.key != "reference"]
    values = np.concatenate(ends)
    near = values[np.isfinite(values) & (np.abs(values - mean) <= quantity.reach)]
    low, high = (float(near.min()), float(near.max())) if len(near) else (mean - 1.0, mean + 1.0)
    margin = 0.05 * max(high - low, 0.1)
    return low - margin, high + margin


def _levels(sheet: Sheet, picture: Picture) -> None:
    """Levels of all cells as they were read; the focus on top."""
    name = picture.focus.cell if picture.focus else None
    others = [levels for levels in picture.levels if levels.cell != name]
    as_dots = sum(len(levels.t_ns) for levels in others) <= _MOST_DOTS
    for i, levels in enumerate(others):
        colour = colours.OTHERS[i % len(colours.OTHERS)]
        path = entity("rssi", levels.cell)
        sheet.always(path, dots(levels.cell, colour) if as_dots else line(levels.cell, colour, 1.0))
        sheet.over_time(path, levels.t_ns, rr.Scalars.columns(scalars=levels.level_dbm))
    for levels in picture.levels:
        if levels.cell == name:
            path = entity("rssi", levels.cell)
            sheet.always(path, line(levels.cell, colours.WALKER, 2.0))
            sheet.over_time(path, levels.t_ns, rr.Scalars.columns(scalars=levels.level_dbm))


def _path_loss(sheet: Sheet, picture: Picture, quantity: Quantity, span: IntArray) -> None:
    """P0 or eta by every estimator: bands of two sigma for EKF and posterior, lines for the others."""
    focus, i = picture.focus, quantity.row
    if focus is None:
        return
    posterior = focus.posterior
    if posterior is not None:
        mean, sigma = getattr(posterior, quantity.mean), getattr(posterior, quantity.sigma)
        path = f"{quantity.path}/posterior"
        sheet.always(path, band(f"{quantity.name} posterior", colours.POSTERIOR))
        sheet.over_time(path, span, two_sigma(np.full(2, mean), np.full(2, sigma**2)))
    for estimate in picture.estimates:
        if estimate.key in ("batch", "rts"):
            path = f"{quantity.path}/{estimate.key}"
            _constant(sheet, path, f"{quantity.name} {estimate.name}", estimate.colour, float(estimate.x[i]), span)
    for key, name, colour, filtered in filters(picture):
        known = np.isfinite(filtered.x[:, i]) & np.isfinite(filtered.p[:, i, i])
        path, t_ns, value = f"{quantity.path}/{key}", filtered.t_ns[known], filtered.x[known, i]
        if key == "ekf":
            sheet.always(path, band(f"{quantity.name} {name}", colour))
            sheet.over_time(path, t_ns, two_sigma(value, np.maximum(filtered.p[known, i, i], 0.0)))
        else:
            sheet.always(path, line(f"{quantity.name} {name}", colour, 1.0))
            sheet.over_time(path, t_ns, rr.Scalars.columns(scalars=value))


def _consistency(sheet: Sheet, key: str, name: str, colour: Colour, filtered: Filtered) -> None:
    """Normalised innovations squared: chi-square with one degree of freedom for a filter that knows its errors."""
    with np.errstate(divide="ignore", invalid="ignore"):
        nis = filtered.nis
    known = np.isfinite(nis)
    sheet.always(f"nis/{key}", dots(f"NIS {name}", colour, 2.0))
    sheet.over_time(f"nis/{key}", filtered.t_ns[known], rr.Scalars.columns(scalars=nis[known]))


def _accuracy(sheet: Sheet, picture: Picture, key: str, name: str, colour: Colour, filtered: Filtered) -> None:
    """What a filter says of its accuracy, and in a simulation how far off it is."""
    known = np.all(np.isfinite(filtered.p), axis=(1, 2)) & np.all(np.isfinite(filtered.x), axis=1)
    t_ns, x = filtered.t_ns[known], filtered.x[known]
    axes, _ = ellipse_axes(filtered.p[known])
    for part, column, width in (("semi-major", 0, 2.0), ("semi-minor", 1, 1.0)):
        path = f"accuracy/{key}/{part}"
        sheet.always(path, line(f"{name}: {part} 95 %", colour, width))
        sheet.over_time(path, t_ns, rr.Scalars.columns(scalars=axes[:, column]))
    if picture.truth_m is not None and len(t_ns):
        places = picture.local(x[:, 0], x[:, 1])
        error = np.hypot(places[:, 0] - picture.truth_m[0], places[:, 1] - picture.truth_m[1])
        sheet.always(
            f"accuracy/{key}/error", line(f"{name}: true error", colours.TRUTH if key == "ekf" else colours.PALE_TRUTH)
        )
        sheet.over_time(f"accuracy/{key}/error", t_ns, rr.Scalars.columns(scalars=error))


def _constant(sheet: Sheet, path: str, name: str, colour: Colour, value: float, span: IntArray) -> None:
    """A value that holds for the whole run, as a level line."""
    sheet.always(path, line(name, colour))
    sheet.over_time(path, span, rr.Scalars.columns(scalars=np.full(2, value)))


def _events(sheet: Sheet, picture: Picture) -> None:
    """The notes of the run."""
    notes = picture.run.tables["notes"]
    notes = notes[np.argsort(notes["t_ns"], kind="stable")]
    if not len(notes):
        return
    texts = [f"{_text(row['source'])}: {_text(row['text']) or _text(row['code'])}" for row in notes]
    levels = [_LEVELS.get(level, "INFO") for level in notes["level"].tolist()]
    sheet.over_time("events", notes["t_ns"], rr.TextLog.columns(text=texts, level=levels))


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")
