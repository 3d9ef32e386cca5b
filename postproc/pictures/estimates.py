"""Final states of the estimators, as pictures and tables show them beside the posterior."""

from typing import Final, NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.ellipse import Ellipse, ellipse95
from logger.core.locator.rivals import share_text
from postproc.estimators.filters import FilterPath
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.pictures.path_loss import ETA, P0
from postproc.result import CellResult


class Estimator(NamedTuple):
    """Attribute of `CellResult`, name in tables and legends, and colour of an estimator."""

    key: str
    name: str
    colour: Colour


BATCH: Final = Estimator("batch", "least squares", colours.BATCH)
EKF: Final = Estimator("ekf", "EKF", colours.EKF)
BACKWARD: Final = Estimator("backward", "EKF backward", colours.EKF)
RTS: Final = Estimator("rts", "RTS", colours.RTS)
REFERENCE: Final = Estimator("reference", "reference EKF (wrong)", colours.REFERENCE)


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
    """A line in the table of a cell's estimators, in degrees, and metres of the 95 % extent.

    `p0` and `eta` are values with standard deviations. A mode of the posterior has only a position
    and an extent.
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
    utm, posterior, rows = cell.obs.utm, cell.posterior, []
    if posterior is not None:
        position_deg = utm.to_latlon(posterior.x_m, posterior.y_m)
        radius = f"radius {posterior.r95_m:.0f}"
        p0, eta = P0.of_posterior(posterior), ETA.of_posterior(posterior)
        rows.append(EstimatorRow("posterior", position_deg, radius, p0, eta, cell.n))
        modes = posterior.modes if len(posterior.modes) > 1 else ()
        for i, mode in enumerate(modes, 1):
            name = f"position {i}: {share_text(mode.probability)}"
            rows.append(EstimatorRow(name, utm.to_latlon(mode.x_m, mode.y_m), _axes(mode.ellipse)))
    for estimate in final_estimates(cell):
        position_deg = utm.to_latlon(float(estimate.x[0]), float(estimate.x[1]))
        p0, eta = (parameter.of_state(estimate.x, estimate.p) for parameter in (P0, ETA))
        extent = _axes(estimate.ellipse)
        rows.append(
            EstimatorRow(estimate.estimator.name, position_deg, extent, p0, eta, estimate.n)
        )
    return tuple(rows)


def final_estimates(cell: CellResult) -> tuple[Estimate, ...]:
    """Final state of each estimator that has a finite one; positions are UTM."""
    estimates = []
    if (fit := cell.batch) is not None:
        estimates.append(Estimate(BATCH, fit.state, fit.covariance, fit.n))
    for estimator in (EKF, BACKWARD, RTS, REFERENCE):
        filtered: FilterPath | None = getattr(cell, estimator.key)
        if filtered is not None and len(filtered):
            n = filtered.consistency.n if filtered.consistency else len(filtered)
            estimates.append(Estimate(estimator, filtered.x[-1, :4], filtered.p[-1, :4, :4], n))
    return tuple(
        one for one in estimates if np.all(np.isfinite(one.x)) and np.all(np.isfinite(one.p))
    )


def _axes(ellipse: Ellipse) -> str:
    return f"{ellipse.semi_major_m:.0f} × {ellipse.semi_minor_m:.0f}"
