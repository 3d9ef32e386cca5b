"""What every picture of a cell shows, in metres east and north of the first fix."""

from dataclasses import dataclass

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.ellipse import radii_text
from logger.core.locator.posterior import Mode, Posterior
from logger.core.locator.rivals import share_text
from postproc.pictures.estimates import Estimate, final_estimates
from postproc.pictures.geometry import Box, plan_box
from postproc.pictures.regions import Rings, regions_of
from postproc.pictures.survey import Survey
from postproc.result import BACKWARD, CellResult, Result

_COLOUR_PERCENTILES = (2.0, 98.0)
"""The scale of levels leaves out the outermost values, or one outlier would take its contrast."""
_DEFAULT_RANGE_DBM = (-110.0, -50.0)


@dataclass(frozen=True, slots=True)
class Picture:
    """A survey and the cell `focus`, as they are drawn; without a fix there is no `box`.

    `regions` are the outlines by name; `estimates` have local positions. `readings_m` (k, 2) are
    the positions of the cell's readings and `level_dbm` (k,) their levels; `level_range_dbm` are
    the ends of the colour scale.
    """

    survey: Survey
    focus: CellResult | None
    readings_m: FloatArray
    level_dbm: FloatArray
    level_range_dbm: tuple[float, float]
    regions: dict[str, Rings]
    estimates: tuple[Estimate, ...]
    truth_m: tuple[float, float] | None
    box: Box | None


def picture_of(survey: Survey, focus: CellResult | None) -> Picture:
    """Gather what is drawn of a cell; without one the picture shows the walks alone."""
    obs = focus.obs if focus else None
    posterior = focus.posterior if focus else None
    readings_m = survey.local(obs.x_m, obs.y_m) if obs else np.empty((0, 2))
    level_dbm = obs.level_dbm if obs else np.empty(0)
    regions = regions_of(posterior, survey.origin_m) if posterior else {}
    truth_m = _truth_m(survey, focus)
    extras = [np.vstack(regions["95"])] if regions else []
    extras += [np.array([truth_m])] if truth_m else []
    walked_m = np.vstack([survey.track_m, readings_m])
    return Picture(
        survey=survey,
        focus=focus,
        readings_m=readings_m,
        level_dbm=level_dbm,
        level_range_dbm=colour_range_dbm(level_dbm),
        regions=regions,
        estimates=_estimates(survey, focus),
        truth_m=truth_m,
        box=plan_box(walked_m, extras) if survey.utm else None,
    )


def focus_of(result: Result) -> CellResult | None:
    """The cell to show unless one is named: located ones first, then the one with most readings."""
    return max(result.cells, key=lambda cell: (cell.verdict == "located", cell.n), default=None)


def headline(result: CellResult) -> str:
    """Verdict and radius or reason, one line."""
    place = result.place
    radii = radii_text(place.r50_m, place.r95_m) if place else ""
    if place and result.verdict == "located":
        return f"located: {radii} of the best position"
    if place and result.verdict == "ambiguous":
        modes = place.likely_modes
        shares = ", ".join(f"{mode.percent}%" for mode in modes[:4])
        return f"ambiguous: {len(modes)} positions fit ({shares}); {radii} of the first"
    reason = result.warnings[0] if result.warnings else "the readings do not determine a position"
    return f"{result.verdict}: {reason}"


def mode_label(posterior: Posterior, mode: Mode) -> str:
    """Probability of one of several modes; "100 %" of a single one would suggest certainty."""
    return share_text(mode.probability) if len(posterior.modes) > 1 else ""


def colour_range_dbm(level_dbm: FloatArray) -> tuple[float, float]:
    """Ends of the colour scale in whole dBm, never equal, without the outermost levels."""
    finite = level_dbm[np.isfinite(level_dbm)]
    if not len(finite):
        return _DEFAULT_RANGE_DBM
    low, high = np.percentile(finite, _COLOUR_PERCENTILES)
    return float(np.floor(low)), float(max(np.ceil(high), np.floor(low) + 1.0))


def _estimates(survey: Survey, focus: CellResult | None) -> tuple[Estimate, ...]:
    """Local estimates that are drawn: the EKF backward has no picture."""
    shift = np.array([*survey.origin_m, 0.0, 0.0])
    return tuple(
        estimate._replace(x=estimate.x - shift)
        for estimate in (final_estimates(focus) if focus else ())
        if estimate.estimator != BACKWARD
    )


def _truth_m(survey: Survey, focus: CellResult | None) -> tuple[float, float] | None:
    """Position of the simulated transmitter; None in a measured walk."""
    if focus is None or survey.utm is None:
        return None
    for walk in survey.walks:
        for truth in walk.run.meta.truth:
            if truth.cell == focus.cell:
                east_m, north_m = survey.position_m(truth.lat_deg, truth.lon_deg).tolist()
                return east_m, north_m
    return None
