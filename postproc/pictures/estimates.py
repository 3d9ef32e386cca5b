"""Final states of the estimators, as pictures and tables show them beside the posterior."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.ellipse import Ellipse, ellipse95
from logger.core.locator.rivals import share_text
from postproc.estimators.filters import FilterPath
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.path_loss import ETA, P0
from postproc.result import BATCH, ESTIMATORS, REFERENCE, CellResult, Estimator


class Estimate(NamedTuple):
    """Final state of one estimator after `n` readings.

    `x` (4,) is a position in metres, P0 in dBm and eta; `p` (4, 4) its covariance.
    """

    estimator: Estimator
    x: FloatArray
    p: FloatArray
    n: int

    @property
    def ellipse(self) -> Ellipse:
        """95 % ellipse."""
        return ellipse95(*self.p[[0, 0, 1], [0, 1, 1]].tolist())


class EstimatorRow(NamedTuple):
    """A line in the table of a cell's estimators, in degrees, and metres of the extent.

    `p0` and `eta` are values with standard deviations. The extent is the 95 % ellipse, of the
    posterior the radii of 50 % and 95 %. A mode of the posterior has only a position and an extent.
    """

    name: str
    position_deg: tuple[float, float]
    extent: str
    p0: tuple[float, float] | None = None
    eta: tuple[float, float] | None = None
    n: int | None = None


def estimator_rows(cell: CellResult) -> tuple[EstimatorRow, ...]:
    """The posterior, its modes where there are several, and the final state of each estimator."""
    if cell.obs is None:
        return ()
    utm, posterior, place, rows = cell.obs.utm, cell.posterior, cell.place, []
    if posterior is not None and place is not None:
        radii = f"radius {place.r50_m:.0f}; {place.r95_m:.0f}"
        p0, eta = P0.of_posterior(posterior), ETA.of_posterior(posterior)
        rows.append(EstimatorRow("posterior", (place.lat, place.lon), radii, p0, eta, cell.n))
        modes = place.modes if len(place.modes) > 1 else ()
        for i, mode in enumerate(modes, 1):
            name = f"position {i}: {share_text(mode.probability)}"
            rows.append(EstimatorRow(name, (mode.lat, mode.lon), _axes(mode.ellipse95)))
    for estimate in final_estimates(cell):
        position_deg = utm.to_latlon(float(estimate.x[0]), float(estimate.x[1]))
        p0, eta = (parameter.of_state(estimate.x, estimate.p) for parameter in (P0, ETA))
        extent = _axes(estimate.ellipse)
        rows.append(
            EstimatorRow(
                legend_of(estimate.estimator)[0], position_deg, extent, p0, eta, estimate.n
            )
        )
    return tuple(rows)


def final_estimates(cell: CellResult) -> tuple[Estimate, ...]:
    """Final state of each estimator that has a finite one; positions are UTM."""
    estimates = []
    if (fit := cell.batch) is not None:
        estimates.append(Estimate(BATCH, fit.state, fit.covariance, fit.n))
    for estimator in ESTIMATORS:
        path = getattr(cell, estimator.key)
        if isinstance(path, FilterPath) and len(path):
            n = path.consistency.n if path.consistency else len(path)
            estimates.append(Estimate(estimator, path.x[-1, :4], path.p[-1, :4, :4], n))
    return tuple(
        estimate
        for estimate in estimates
        if np.all(np.isfinite(estimate.x)) and np.all(np.isfinite(estimate.p))
    )


def legend_of(estimator: Estimator) -> tuple[str, Colour]:
    """Label and colour in a legend or table, which has no footnote about the reference EKF."""
    label = f"{estimator.name} (wrong)" if estimator == REFERENCE else estimator.name
    return label, colours.ESTIMATORS[estimator.key]


def _axes(ellipse: Ellipse) -> str:
    return f"{ellipse.semi_major_m:.0f} × {ellipse.semi_minor_m:.0f}"
