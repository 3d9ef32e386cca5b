"""Filters over all readings of a cell, and the states they pass through."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from logger.core import ekf, shadow_ekf
from logger.core.arrays import FloatArray, IntArray
from logger.core.readings import Readings
from logger.core.shadow_ekf import ShadowNoise, ShadowState
from postproc.estimators.metrics import Consistency, consistency

MOST_ROWS = 10_000
"""States kept of a longer walk: more than any picture can show, and 2 MB."""

_ALL = slice(None)
GATE = 4.0
"""Standard deviations: at which RTKLIB's `valcomb` refuses to combine forward with backward."""
AXES = ("east", "north", "P0", "eta")
_FORMATS = ("{:.0f} m", "{:.0f} m", "{:.1f} dB", "{:.2f}")


@dataclass(frozen=True, slots=True)
class FilterPath:
    """States after readings, in the order these were taken: `t_ns` (m,), `x` (m, k), `p` (m, k, k).

    k is 4, or 5 with the shadowing last. `innovation_db` and `innovation_var_db2` have shape (m,);
    they are NaN for a smoother and where no level was expected. `consistency` covers all readings
    used, also those without a row.
    """

    t_ns: IntArray
    x: FloatArray
    p: FloatArray
    innovation_db: FloatArray
    innovation_var_db2: FloatArray
    consistency: Consistency | None = None

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def nis(self) -> FloatArray:
        """Normalised innovation squared, shape (m,).

        Chi-square with one degree of freedom for a consistent filter.
        """
        return self.innovation_db**2 / self.innovation_var_db2


class ShadowPass(NamedTuple):
    """Path and last state of the shadowing EKF; the log-likelihood lacks a constant."""

    path: FilterPath
    end: ShadowState
    log_likelihood: float


def retained_rows(count: int) -> IntArray:
    """Numbers of the readings after which a state is kept."""
    every = max(-(-count // MOST_ROWS), 1)
    return np.arange((count - 1) % every, count, every)


def reference_ekf(obs: Readings) -> FilterPath:
    """The specification's EKF over all readings of a cell, started at the first position.

    States are x, y in metres, P0 in dBm and eta: shape (m, 4) for the m readings that are retained.
    """
    rows, innovation = retained_rows(len(obs)), np.empty((2, len(obs)))
    x, triangles = np.empty((len(rows), 4)), np.empty((len(rows), 10))
    # plain floats: the same bits in a third of the time that scalars of numpy take
    readings = zip(obs.x_m.tolist(), obs.y_m.tolist(), obs.level_dbm.tolist(), strict=True)
    state = ekf.start(obs.places[0])
    row = 0
    for i, reading in enumerate(readings):
        state, innovation[0, i], innovation[1, i] = ekf.step(state, *reading)
        if rows[row] == i:
            x[row] = state.x_m, state.y_m, state.p0_dbm, state.eta
            triangles[row] = state.p
            row += 1
    p = ekf.covariance_matrix(triangles)
    e, variance = innovation[:, rows]
    return FilterPath(obs.t_ns[rows], x, p, e, variance, consistency(*innovation))


def shadow_pass(
    obs: Readings,
    state: ShadowState,
    noise: ShadowNoise,
    *,
    readings: slice = _ALL,
    rows: IntArray | None = None,
    conditionals: FloatArray | None = None,
) -> ShadowPass:
    """Run the shadowing EKF over readings of a cell from a state.

    States are kept after the readings `rows`, ascending to the last; by default `retained_rows`.
    `conditionals` (n, 6) is filled for `rts.smooth`. Readings with a level of NaN only move the
    receiver; `FilterPath.consistency` does not count them.
    """
    columns = (obs.x_m, obs.y_m, obs.position_sigma_m, obs.level_dbm, obs.limit)
    of_readings = zip(*(values[readings].tolist() for values in columns), strict=True)
    level_dbm = obs.level_dbm[readings]
    count = len(level_dbm)
    rows = retained_rows(count) if rows is None else rows
    innovation = np.empty((2, count))
    x, factors = np.empty((len(rows), 5)), np.empty((len(rows), 15))
    start, row = state, 0
    for i, reading in enumerate(of_readings):
        state, innovation[0, i], innovation[1, i] = shadow_ekf.step(state, noise, *reading)
        if conditionals is not None:
            conditionals[i] = _shadowing_given_rest(state, start)
        if rows[row] == i:
            x[row] = state.x_m, state.y_m, state.p0_dbm, state.eta, state.shadow_db
            factors[row] = state.factors
            row += 1
    e, variance = innovation
    log_likelihood = -0.5 * float(np.nansum(np.log(variance) + e**2 / variance))
    p = shadow_ekf.covariance_matrix(factors)
    used = consistency(*innovation[:, np.isfinite(level_dbm)])
    path = FilterPath(obs.t_ns[readings][rows], x, p, e[rows], variance[rows], used)
    return ShadowPass(path, state, log_likelihood)


def _shadowing_given_rest(state: ShadowState, start: ShadowState) -> tuple[float, ...]:
    """a, b and v of s = a + b' (rest - rest at the start) + N(0, v).

    b solves b U_rest = row s of U.
    """
    v, _, _, _, _, bx, by, b0, be, xy, x0, xe, y0, ye, oe = state.factors
    by -= bx * xy
    b0 -= bx * x0 + by * y0
    be -= bx * xe + by * ye + b0 * oe
    of_position = bx * (state.x_m - start.x_m) + by * (state.y_m - start.y_m)
    of_power = b0 * (state.p0_dbm - start.p0_dbm) + be * (state.eta - start.eta)
    return state.shadow_db - of_position - of_power, bx, by, b0, be, v


class Comparison(NamedTuple):
    """Differences backward - forward of the last [x, y, P0, eta].

    Both use the same readings, so a consistent pair differs by far less than its covariances allow.
    Of a pair that differs by more than `GATE` one is wrong: it is never averaged. `sigmas` are the
    differences divided by their combined standard deviations.
    """

    difference: tuple[float, float, float, float]
    sigmas: tuple[float, float, float, float]

    @property
    def largest(self) -> float:
        """Largest difference on any axis in combined standard deviations."""
        return max(abs(sigmas) for sigmas in self.sigmas)

    @property
    def agrees(self) -> bool:
        """Whether no axis differs by more than `GATE` combined standard deviations."""
        return self.largest <= GATE

    @property
    def warning(self) -> str | None:
        """Warning for a pair that does not agree."""
        if self.agrees:
            return None
        columns = zip(AXES, _FORMATS, self.difference, self.sigmas, strict=True)
        beyond = [
            f"{name} by {form.format(abs(difference))} ({abs(sigmas):.1f} sigma)"
            for name, form, difference, sigmas in columns
            if abs(sigmas) > GATE
        ]
        return (
            "the EKF forward and the EKF backward contradict each other, so trust neither: "
            f"{', '.join(beyond)}"
        )


def compare(forward: FilterPath, backward: FilterPath) -> Comparison:
    """Last state of a filter over the walk against that of one over the reversed walk."""
    difference = backward.x[-1, :4] - forward.x[-1, :4]
    variance = np.diagonal(forward.p[-1])[:4] + np.diagonal(backward.p[-1])[:4]
    sigmas = difference / np.sqrt(variance)
    return Comparison(tuple(difference.tolist()), tuple(sigmas.tolist()))
