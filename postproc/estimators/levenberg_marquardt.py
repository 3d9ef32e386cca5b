"""Levenberg-Marquardt search of a least-squares minimum with few unknowns.

The damping follows Nielsen, IMM-REP-1999-05: it falls by the quality of a step that improved, and
grows faster with each that did not. (scipy has the same method, but half a second of imports.)
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray

_FIRST_DAMPING = 1e-3  # of the largest diagonal element: starts are near their minimum
_LEAST_GAIN = 1e-8  # relative: a cost that falls by less is that of the minimum
_LEAST_STEP = 1e-8  # in units of the scale
_MOST_DAMPING = 1e30  # no step improves: the cost is flat to the last bit, or not finite

_ArrayFunction = Callable[[FloatArray], FloatArray]


class Ending(NamedTuple):
    """Where a search ended, half the sum of squares there, and whether that is a minimum."""

    x: FloatArray
    cost: float
    converged: bool


def minimise(
    misfit: _ArrayFunction,
    slope: _ArrayFunction,
    start: FloatArray,
    scale: Sequence[float],
    most_steps: int,
    is_lost: Callable[[FloatArray], bool] | None = None,
) -> Ending:
    """Minimum of |misfit|^2 / 2 over the unknowns, shape (k,), from a start.

    `misfit` maps the unknowns to shape (n,), `slope` to its derivative (n, k). `scale` has the
    usual size of a step in each unknown. A search that `is_lost` ends without a minimum.
    """
    unit = np.asarray(scale, float)
    x, e = np.asarray(start, float), misfit(start)
    cost, damping, growth = 0.5 * float(e @ e), 0.0, 2.0
    normal = gradient = np.empty(0)
    is_new = True
    for _ in range(most_steps):
        if is_new:
            jacobian = slope(x) * unit
            normal, gradient = jacobian.T @ jacobian, jacobian.T @ e
            damping = damping or _FIRST_DAMPING * float(np.max(np.diag(normal)))
        step = -np.linalg.solve(normal + damping * np.eye(len(x)), gradient)
        if float(np.max(np.abs(step))) < _LEAST_STEP:
            return Ending(x, cost, converged=True)
        further = x + unit * step
        e_further = misfit(further)
        gain = cost - 0.5 * float(e_further @ e_further)
        promised = 0.5 * float(step @ (damping * step - gradient))
        is_new = gain > 0.0
        if is_new:
            x, e, cost = further, e_further, cost - gain
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain / promised - 1.0) ** 3)
            growth = 2.0
            if is_lost is not None and is_lost(x):
                return Ending(x, cost, converged=False)
            if gain < _LEAST_GAIN * cost:
                return Ending(x, cost, converged=True)
        else:
            damping, growth = damping * growth, 2.0 * growth
            if not damping < _MOST_DAMPING:
                return Ending(x, cost, converged=bool(np.isfinite(cost)))
    return Ending(x, cost, converged=False)
