"""What every picture of a cell shows, in metres east and north of the first fix."""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from logger.core.arrays import BoolArray, FloatArray
from logger.core.certainty import OnMap, share_text, whole_percents
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import HALF, LEVEL, Squares
from logger.core.model import path_loss
from logger.core.model.path_loss import log_distance_db
from logger.core.suspicion.rule import WORDS
from postproc.estimators.least_squares_rows import each_reading
from postproc.estimators.residuals import state_at_place
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.survey import Box, Survey, plan_box
from postproc.result import (
    BACKWARD,
    REFERENCE,
    CellResult,
    Estimate,
    Estimator,
    Result,
    rings_of,
)

Rings = list[FloatArray]
"""Outline of a region: closed rings (k, 2), outer ones counterclockwise, holes clockwise."""


def regions_of(posterior: Posterior, origin_m: FloatArray) -> dict[str, Rings]:
    """Outlines of the 95 % and the 50 % region; the latter is empty where it would not be true."""
    regions = {"95": region_rings(posterior.squares, LEVEL, origin_m), "50": list[FloatArray]()}
    if posterior.is_strongest_inside:
        regions["50"] = region_rings(posterior.squares, HALF, origin_m)
    return regions


def region_rings(cells: Squares, share: float, origin_m: FloatArray) -> Rings:
    """Outline of the smallest region with this `share` of the probability, in m from `origin_m`."""
    return [ring - origin_m for ring in rings_of(cells, share)]


class Parameter(NamedTuple):
    """`row` is its index in a state; `mean` and `sigma` are attributes of the posterior."""

    name: str
    unit: str
    decimals: int
    row: int
    mean: str
    sigma: str

    def of_posterior(self, posterior: Posterior) -> tuple[float, float]:
        """Mean and standard deviation."""
        return getattr(posterior, self.mean), getattr(posterior, self.sigma)

    def of_states(self, x: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and standard deviations of states (..., k) with covariances (..., k, k)."""
        variance = p[..., self.row, self.row]
        return x[..., self.row], np.sqrt(np.maximum(variance, 0.0))

    def of_state(self, x: FloatArray, p: FloatArray) -> tuple[float, float]:
        """Value and standard deviation of one state (k,) with covariance (k, k)."""
        value, sigma = self.of_states(x, p)
        return float(value), float(sigma)

    def text(self, mean: float, sigma: float) -> str:
        """For example "-35.0 ± 2.0 dBm"."""
        unit = f" {self.unit}" if self.unit else ""
        return f"{mean:.{self.decimals}f} ± {sigma:.{self.decimals}f}{unit}"


P0: Final = Parameter("P0", "dBm", 1, 2, "p0_dbm", "p0_sigma_db")
ETA: Final = Parameter("eta", "", 2, 3, "eta", "eta_sigma")


def legend_of(estimator: Estimator) -> tuple[str, Colour]:
    """Label and colour in a legend or table, which has no footnote about the reference EKF."""
    label = f"{estimator.name} (wrong)" if estimator == REFERENCE else estimator.name
    return label, colours.ESTIMATORS[estimator.key]


@dataclass(frozen=True, slots=True)
class Fit:
    """Level and residual of each reading (n,) by its distance from the most likely position.

    `distance_m` is the model's, with the antenna's height and the receiver's error; the model is
    `p0_dbm - 10 eta lg distance_m`. `uncensored` are the readings within the modem's scale;
    `residual_db` is level minus model, NaN for the others, and `sigma_db` its root mean square.
    """

    distance_m: FloatArray
    level_dbm: FloatArray
    residual_db: FloatArray
    uncensored: BoolArray
    p0_dbm: float
    eta: float
    sigma_db: float

    def model_dbm(self, distance_m: FloatArray) -> FloatArray:
        """Level expected at distances, shape as given."""
        return path_loss.level_dbm(self.p0_dbm, self.eta, log_distance_db(distance_m, 0.0))


def fit_of(cell: CellResult) -> Fit | None:
    """The fit of a cell's answer; None where it has no position."""
    posterior, obs = cell.posterior, cell.obs
    if posterior is None or obs is None:
        return None
    obs = obs.usable()
    if posterior.offsets is not None:
        obs = obs.on_one_scale(posterior.offsets.mean_db)
    state, height_m = state_at_place(posterior, obs), posterior.prior.height_m
    x_m, y_m, p0_dbm, eta = state.tolist()
    uncensored = np.asarray(obs.limit == 0, np.bool_)
    residual_db = np.where(uncensored, -each_reading(obs, height_m).residuals(state), np.nan)
    sigma_db = float(np.sqrt(np.mean(residual_db[uncensored] ** 2)))
    distance_db = log_distance_db(x_m - obs.x_m, y_m - obs.y_m, height_m, obs.position_sigma_m)
    distance_m = path_loss.distance_m(distance_db)
    return Fit(distance_m, obs.level_dbm, residual_db, uncensored, p0_dbm, eta, sigma_db)


_COLOUR_PERCENTILES = (2.0, 98.0)
"""The scale of levels leaves out the outermost values, or one outlier would take its contrast."""
_DEFAULT_RANGE_DBM = (-110.0, -50.0)


@dataclass(frozen=True, slots=True)
class Picture:
    """A survey and the cell `focus`, as they are drawn; without a fix there is no `box`.

    `estimates` have local positions; `level_range_dbm` are the ends of the colour scale.
    """

    survey: Survey
    focus: CellResult | None
    level_range_dbm: tuple[float, float]
    regions: dict[str, Rings]
    estimates: tuple[Estimate, ...]
    truth_m: FloatArray | None
    box: Box | None

    @property
    def readings_m(self) -> FloatArray:
        """Local positions of the cell's readings, shape (k, 2)."""
        return _readings_m(self.survey, self.focus)

    @property
    def level_dbm(self) -> FloatArray:
        """Levels of the cell's readings, shape (k,)."""
        return _level_dbm(self.focus)


def _readings_m(survey: Survey, focus: CellResult | None) -> FloatArray:
    obs = focus.obs if focus else None
    return survey.local(obs.places) if obs else np.empty((0, 2))


def _level_dbm(focus: CellResult | None) -> FloatArray:
    return focus.obs.level_dbm if focus and focus.obs else np.empty(0)


def picture_of(survey: Survey, focus: CellResult | None) -> Picture:
    """Gather what is drawn of a cell; without one the picture shows the walks alone."""
    posterior = focus.posterior if focus else None
    regions = regions_of(posterior, survey.origin_m) if posterior else {}
    truth_m = _truth_m(survey, focus)
    extras = [np.vstack(regions["95"])] if regions else []
    extras += [] if truth_m is None else [truth_m[None]]
    walked_m = np.vstack([survey.track_m, _readings_m(survey, focus)])
    return Picture(
        survey=survey,
        focus=focus,
        level_range_dbm=colour_range_dbm(_level_dbm(focus)),
        regions=regions,
        estimates=_estimates(survey, focus),
        truth_m=truth_m,
        box=plan_box(walked_m, extras) if survey.utm else None,
    )


def focus_of(result: Result) -> CellResult | None:
    """The cell to show unless one is named: suspicious ones first, then located, most readings."""

    def rank(cell: CellResult) -> tuple[int, ...]:
        word = result.words.get(cell.cell)
        return WORDS.index(word.word) if word else 0, cell.verdict == "located", cell.n

    return max(result.cells, key=rank, default=None)


def headline(result: CellResult) -> str:
    """Verdict and radius or reason, one line."""
    place = result.place
    if place and result.verdict == "located":
        return f"located: {place.radii('the best position')}"
    if place and result.verdict == "ambiguous":
        modes = place.likely_modes
        shares = ", ".join(mode.share for mode in modes[:4])
        return f"ambiguous: {len(modes)} positions fit ({shares}); {place.radii('the first')}"
    reason = result.warnings[0] if result.warnings else "the readings do not determine a position"
    return f"{result.verdict}: {reason}"


def mode_labels(posterior: Posterior) -> list[str]:
    """Probability of each of several modes; that of a single one would suggest certainty."""
    texts = [share_text(percent / 100.0) for percent in whole_percents(posterior.likely_modes)]
    return texts if len(texts) > 1 else [""] * len(texts)


def colour_range_dbm(level_dbm: FloatArray) -> tuple[float, float]:
    """Ends of the colour scale in whole dBm, never equal, without the outermost levels."""
    finite = level_dbm[np.isfinite(level_dbm)]
    if not len(finite):
        return _DEFAULT_RANGE_DBM
    low, high = np.percentile(finite, _COLOUR_PERCENTILES)
    return float(np.floor(low)), float(max(np.ceil(high), np.floor(low) + 1.0))


def _estimates(survey: Survey, focus: CellResult | None) -> tuple[Estimate, ...]:
    """Local estimates that are drawn: finite ones, and not the EKF backward."""
    shift = np.array([*survey.origin_m, 0.0, 0.0])
    return tuple(
        estimate._replace(x=estimate.x - shift)
        for estimate in (focus.estimates if focus else ())
        if estimate.estimator != BACKWARD
        and np.all(np.isfinite(estimate.x))
        and np.all(np.isfinite(estimate.p))
    )


def _truth_m(survey: Survey, focus: CellResult | None) -> FloatArray | None:
    if focus is None or survey.utm is None:
        return None
    for walk in survey.walks:
        for truth in walk.run.meta.truth:
            if truth.cell == focus.cell:
                return survey.position_m(OnMap(lat=truth.lat_deg, lon=truth.lon_deg))
    return None
