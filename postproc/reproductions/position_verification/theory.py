"""Position verification by ranges to known receivers: direct, and indirect by estimation.

N ranges r_i = |p - q_i| + eps_i, eps ~ N(0, V), V = diag(sigma_i^2); the claimed position c is p +
w, w ~ N(0, W). With A the unit vectors from receivers to position, shape (N, d):

    direct     T = b' (V + A W A')^-1 b ~ chi2(N, delta_direct),    b_i = r_i - |c - q_i|
    indirect   T = Delta' (P + W)^-1 Delta ~ chi2(d, delta_loc),    Delta = c - p^,
                                                                    P = (A' V^-1 A)^-1

p^ results from c by Gauss-Newton steps. Both noncentralities are zero where the claim is true. For
a small offset o they are the same number, o' (P + W)^-1 o, but the indirect test has fewer degrees
of freedom, which is its only advantage. W = 0 gives the plain tests. An unknown
position of d coordinates takes d + 1 receivers to be the only solution; with fewer there is the
direct test alone.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, ncx2

from logger.core.arrays import BoolArray, FloatArray
from logger.core.errors import ConfigError

_MOST_STEPS = 60  # Gauss-Newton converges in some 5; the rest is for poor geometry
_CONVERGED = 1e-6  # of the smallest sigma
_WORST_CONDITION = 1e8  # beyond it half of the digits are lost
_HALVINGS = 8


@dataclass(frozen=True)
class Scene:
    """Receivers (n, d) in metres, d = 2 or 3, sigma of each range (n,), of the claim per axis (d,).

    Raises `ConfigError` for shapes that do not fit, or a sigma that is negative or not finite.
    """

    receivers_m: FloatArray
    sigma_m: FloatArray
    claim_sigma_m: FloatArray

    def __post_init__(self) -> None:
        n, d = self.receivers_m.shape if self.receivers_m.ndim == 2 else (0, 0)
        if n == 0 or d not in {2, 3}:
            raise ConfigError(
                "receivers are points of 2 or 3 coordinates, and there is at least one"
            )
        if self.sigma_m.shape != (n,) or not np.all(_is_sigma(self.sigma_m) & (self.sigma_m > 0)):
            raise ConfigError("each receiver needs a sigma of its range, larger than zero")
        if self.claim_sigma_m.shape != (d,) or not np.all(_is_sigma(self.claim_sigma_m)):
            raise ConfigError(
                f"the claim needs a sigma for each of the {d} coordinates, zero or larger"
            )

    @property
    def dimensions(self) -> int:
        """2 or 3."""
        return int(self.receivers_m.shape[1])


def _is_sigma(values_m: FloatArray) -> BoolArray:
    return np.isfinite(values_m) & (values_m >= 0.0)


class Statistic(NamedTuple):
    """Degrees of freedom and noncentrality of a statistic."""

    dof: int
    noncentrality: float

    def power(self, p_fa: float) -> float:
        """Probability that the test rejects at this false-alarm rate."""
        return detection(p_fa, self.dof, self.noncentrality)


class Simulation(NamedTuple):
    """Share of trials in which each test rejected, and in which the estimate did not converge."""

    direct: float
    indirect: float | None
    not_converged: float


def detection(p_fa: float, dof: int, noncentrality: float) -> float:
    """Probability that a noncentral chi-square exceeds the central one's limit for `p_fa`."""
    if noncentrality <= 0.0:
        return p_fa
    return float(ncx2.sf(chi2.isf(p_fa, dof), dof, noncentrality))


def noncentrality_of(p_fa: float, dof: int, power: float) -> float:
    """The noncentrality that gives this power; 0 where the power is no larger than `p_fa`."""
    low, high = 0.0, 1.0
    while detection(p_fa, dof, high) < power:
        high *= 2.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if detection(p_fa, dof, middle) < power else (low, middle)
    return high


def direct(scene: Scene, true_m: FloatArray, claim_m: FloatArray) -> Statistic:
    """The direct test of a claim (d,) while the transmitter is at `true_m` (d,)."""
    missed = _ranges(scene, true_m) - _ranges(scene, claim_m)
    spread = _direct_covariance(scene, claim_m)
    return Statistic(len(missed), float(missed @ np.linalg.solve(spread, missed)))


def indirect(scene: Scene, true_m: FloatArray, claim_m: FloatArray) -> Statistic | None:
    """The indirect test of the same claim; None where `not_observable` says why."""
    if not_observable(scene, true_m):
        return None
    spread = np.linalg.inv(_information(scene, true_m)) + np.diag(scene.claim_sigma_m**2)
    off = claim_m - true_m
    return Statistic(scene.dimensions, float(off @ np.linalg.solve(spread, off)))


def not_observable(scene: Scene, at_m: FloatArray) -> str | None:
    """Why the receivers do not determine a position there, None where they do."""
    n, d = scene.receivers_m.shape
    if n <= d:
        return (
            f"the indirect test needs {d + 1} receivers in {d} dimensions and has {n}: "
            "the direct test alone"
        )
    if np.linalg.cond(_information(scene, at_m)) > _WORST_CONDITION:
        return (
            "the receivers stand so that a direction is not observed at all: the direct test alone"
        )
    return None


def simulate(
    scene: Scene,
    true_m: FloatArray,
    claim_m: FloatArray,
    p_fa: float,
    trials: int,
    rng: np.random.Generator,
) -> Simulation:
    """Simulate ranges, and compare both statistics with their limits."""
    claims = claim_m + scene.claim_sigma_m * rng.normal(size=(trials, scene.dimensions))
    ranges = _ranges(scene, true_m) + scene.sigma_m * rng.normal(size=(trials, len(scene.sigma_m)))
    exceeded = direct_statistic(scene, ranges, claims) > chi2.isf(p_fa, len(scene.sigma_m))
    if not_observable(scene, true_m):
        return Simulation(float(np.mean(exceeded)), None, 0.0)
    statistic, converged = indirect_statistic(scene, ranges, claims)
    found = float(np.mean(statistic > chi2.isf(p_fa, scene.dimensions)))
    return Simulation(float(np.mean(exceeded)), found, float(np.mean(~converged)))


def direct_statistic(scene: Scene, ranges_m: FloatArray, claims_m: FloatArray) -> FloatArray:
    """T of ranges (t, n) against claims (t, d), shape (t,)."""
    b = ranges_m - _ranges(scene, claims_m)
    return _quadratic(_direct_covariance(scene, claims_m), b)


def indirect_statistic(
    scene: Scene, ranges_m: FloatArray, claims_m: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """T of ranges (t, n) against claims (t, d), shape (t,), and whether the estimate converged.

    The provisional solution is the claim; a step is halved until it does not make the fit worse.
    """
    position = claims_m.copy()
    moved = np.full(len(position), np.inf)
    weight = 1.0 / scene.sigma_m**2
    least_m = _CONVERGED * float(np.min(scene.sigma_m))
    for _ in range(_MOST_STEPS):
        going = np.flatnonzero(moved > least_m)
        if not len(going):
            break
        step = _step(scene, ranges_m[going], position[going], weight)
        position[going] += step
        moved[going] = np.linalg.norm(step, axis=1)
    spread = np.linalg.inv(_information(scene, position)) + np.diag(scene.claim_sigma_m**2)
    return _quadratic(np.asarray(spread, float), claims_m - position), moved <= least_m


def _step(
    scene: Scene, ranges_m: FloatArray, position: FloatArray, weight: FloatArray
) -> FloatArray:
    """Delta = (A' V^-1 A)^-1 A' V^-1 b for positions (t, d), halved where it overshoots."""
    a, b = _directions(scene, position), ranges_m - _ranges(scene, position)
    right = np.einsum("tnd,tn->td", a, weight * b)
    step = np.linalg.solve(_information(scene, position), right[..., None])[..., 0]
    before = np.sum(weight * b**2, axis=1)
    for _ in range(_HALVINGS):
        after = np.sum(weight * (ranges_m - _ranges(scene, position + step)) ** 2, axis=1)
        step = np.where((after > before * (1.0 + 1e-12))[:, None], 0.5 * step, step)
    return np.asarray(step, float)


def _ranges(scene: Scene, position_m: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(position_m[..., None, :] - scene.receivers_m, axis=-1), float)


def _directions(scene: Scene, position_m: FloatArray) -> FloatArray:
    """A, shape (..., n, d)."""
    away = position_m[..., None, :] - scene.receivers_m
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-9), float)


def _information(scene: Scene, position_m: FloatArray) -> FloatArray:
    """A' V^-1 A, shape (..., d, d)."""
    a = _directions(scene, position_m)
    return np.asarray(np.einsum("...ni,n,...nj->...ij", a, scene.sigma_m**-2.0, a), float)


def _direct_covariance(scene: Scene, position_m: FloatArray) -> FloatArray:
    a = _directions(scene, position_m)
    of_claim = np.einsum("...ni,i,...mi->...nm", a, scene.claim_sigma_m**2, a)
    return np.asarray(np.diag(scene.sigma_m**2) + of_claim, float)


def _quadratic(matrix: FloatArray, v: FloatArray) -> FloatArray:
    return np.asarray(
        np.einsum("td,td->t", v, np.linalg.solve(matrix, v[..., None])[..., 0]), float
    )
