"""The answer in words, as markdown."""

from math import sqrt

import numpy as np

from logger.core.ellipse import ellipse95
from logger.core.geo import Utm
from logger.core.timebase import utc_text
from postproc.pictures.picture import Picture, headline
from postproc.smooth import CellResult

_COLOURS = (
    "Orange is the EKF, teal RTS, red least squares, blue the posterior (thin: 95 %, thick: 50 % region), "
    "grey the reference EKF, violet the truth of a simulation. Readings are blue where weak, red where strong."
)


def report(picture: Picture) -> str:
    """Verdict, warnings and the estimators side by side."""
    parts = [_head(picture), _list(picture.smoothed.warnings)]
    focus = picture.focus
    if focus is not None:
        parts += [f"**{headline(focus)}**", _list(_further(focus)), _table(picture), _truth(picture)]
        if focus.posterior is not None:
            prior = focus.posterior.prior
            parts.append(
                f"Believed before the walk: P0 {prior.p0_dbm:.0f} ± {prior.p0_sigma_db:.0f} dBm, "
                f"eta {prior.eta:.1f} ± {prior.eta_sigma:.1f}, scatter about {prior.sigma_db:.0f} dB, "
                f"no farther than {prior.reach_m / 1000:.0f} km."
            )
    parts.append(_COLOURS)
    return "\n\n".join(part for part in parts if part)


def _head(picture: Picture) -> str:
    run = picture.run
    simulated = "SIMULATED run" if run.meta.truth else "Run"
    timebase = picture.clock.timebase
    when = utc_text(timebase.utc_ns(run.meta.started_ns)) if timebase else "unknown date"
    focus = picture.focus
    cell = f"Cell {_plain(focus.cell)}, {focus.n} readings" if focus else "No cell"
    return f"# {cell}\n\n{simulated} `{run.path.name}`, {when}, {len(picture.levels)} cells heard"


def _further(focus: CellResult) -> tuple[str, ...]:
    """Warnings that the headline does not already tell."""
    return tuple(text for text in focus.warnings if text not in headline(focus))


def _list(lines: tuple[str, ...]) -> str:
    return "\n".join(f"- {_plain(text)}" for text in lines)


def _table(picture: Picture) -> str:
    focus, track = picture.focus, picture.track
    if focus is None or track is None or (focus.posterior is None and not picture.estimates):
        return ""
    rows = ["| | latitude | longitude | 95 % (m) | P0 (dBm) | eta |", "|---|---|---|---|---|---|"]
    posterior = focus.posterior
    if posterior is not None:
        place = _place(track.utm, posterior.x_m, posterior.y_m)
        p0, eta = (posterior.p0_dbm, posterior.p0_sigma_db), (posterior.eta, posterior.eta_sigma)
        size = f"radius {posterior.r95_m:.0f}"
        rows.append(f"| posterior | {place} | {size} | {_with_sigma(p0, 1)} | {_with_sigma(eta, 2)} |")
    for estimate in picture.estimates:
        east, north = picture.origin_m
        place = _place(track.utm, east + float(estimate.x[0]), north + float(estimate.x[1]))
        axes = ellipse95(estimate.p[0, 0], estimate.p[0, 1], estimate.p[1, 1])
        sigmas = np.sqrt(np.maximum(np.diagonal(estimate.p), 0.0)).tolist()
        p0, eta = ((float(estimate.x[i]), sigmas[i]) for i in (2, 3))
        size = f"{axes.semi_major_m:.0f} x {axes.semi_minor_m:.0f}"
        rows.append(f"| {estimate.name} | {place} | {size} | {_with_sigma(p0, 1)} | {_with_sigma(eta, 2)} |")
    return "\n".join(rows)


def _truth(picture: Picture) -> str:
    posterior = picture.focus.posterior if picture.focus else None
    if picture.truth_m is None or posterior is None:
        return ""
    (east, north), (true_x, true_y) = picture.origin_m, picture.truth_m
    off_m = sqrt((posterior.x_m - east - true_x) ** 2 + (posterior.y_m - north - true_y) ** 2)
    return f"Simulated: the best place is {off_m:.0f} m from the truth."


def _place(utm: Utm, x_m: float, y_m: float) -> str:
    lat, lon = utm.to_latlon(x_m, y_m)
    return f"{lat:.6f} | {lon:.6f}"


def _with_sigma(value: tuple[float, float], decimals: int) -> str:
    return f"{value[0]:.{decimals}f} ± {value[1]:.{decimals}f}"


def _plain(text: str) -> str:
    """Text in which nothing is markup."""
    return "".join(f"\\{c}" if c in "\\`*_[]<>#|" else c for c in text)
