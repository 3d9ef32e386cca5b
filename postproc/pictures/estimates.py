"""Final states of the estimators, as pictures and tables show them beside the posterior."""

from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.ellipse import Ellipse, ellipse95
from postproc.estimators.filters import FilterPath
from postproc.pictures import colours
from postproc.pictures.colours import Colour
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
