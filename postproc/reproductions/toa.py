"""Position of a moving object from ranges to anchors: the README of Kalman_Filter_ToA, reproduced.

Source: github.com/Yongseok1221/Kalman_Filter_ToA, README.md as of 2025-12-12.

**Measurements.** With Z_i = |X - a_i| + v_i, v_i ~ N(0, sigma^2), a squared range is

    Z_i^2 = |X|^2 - 2 a_i' X + |a_i|^2 + e_i
    E e_i = sigma^2,    var e_i = 4 sigma^2 |X - a_i|^2 + 2 sigma^4

so that |X|^2 and the bias cancel in differences. With D the matrix of differences (one row e_i -
e_j for each pair i < j)

    z = D (Z^2 - |a|^2) = H X + D e,    H = -2 D a,    R = 4 sigma^2 D diag(Z^2) D'

The README's z, H and R for four anchors are right; its sketch of the anchors is mirrored.
R takes the measured ranges for the true ones: since E Z^2 = |X - a|^2 + sigma^2 it is too large
by 2 sigma^4 D D' on average. The fix of one epoch (LSE) is
X = (H'H)^-1 H' z.

**Process noise**: the error of a prediction from two single fixes, at k = 2.

    w = X - (2 X_1 - X_0),    X the true position, X_0 and X_1 fixes

At constant velocity w is noise of the fixes alone: E[w] = 0 and

    Q = 4 C_1 + C_0,    C_k = covariance of the fix at step k

which is (4.28 sigma^2 + 0.025 sigma^4) I for the README's anchors and path. Its simulated moments,
up to 2.7 % off by sampling, are used where it prints them. On a path that turns, mean and
covariance of the path's second differences are added. The README has no initial P: that of the fix
at k = 1 stands in for it (0.82 sigma^2 + 0.005 sigma^4 there).

**The filter of the README**

    X_pred = A X_k + (X_k - X_(k-1)) + E[w],    P_pred = A P A' + Q,    A = I
    K = P_pred H' (H P_pred H' + R)^-1
    X = X_pred + K (z - H X_pred),    P = P_pred - K H P_pred

The first two steps are single fixes. Q is the whole error of a prediction from two fixes already,
so P is no covariance of the error. S = H P_pred H' + R is singular: six differences of four ranges
have rank 3. With all rows D = T D1 of independent rows D1, S = T S1 T', so

    H' S^+ z = H1' T' (T')^+ S1^-1 T^+ T z1 = H1' S1^-1 z1

**The same task without a singular matrix**: a filter on the squared ranges, of state [x, y, vx,
vy]. R is diagonal and S of full rank. For X ~ N(m, C) the moments of a squared range are exact:

    E Z^2 = |m - a|^2 + tr C + sigma^2
    S     = G C G' + 2 tr(C^2) 1 1' + diag(4 sigma^2 (|m - a|^2 + tr C) + 2 sigma^4)
    G     = 2 (m - a)'

(second-order filter; Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and
Navigation, sec. 10.3). Its motion model is constant velocity without process noise.

**The Cramer-Rao bound**, of one epoch and of all epochs so far. J = sum over ranges of u u' /
sigma^2, u the unit vector from anchor to position; at constant velocity u becomes [u, j u] in the
epoch j before; at an anchor, where a range has no derivative, u is along the path.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.special import ellipe

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from postproc.atomic_write import kind_of, whole_file
from postproc.estimators.metrics import nees
from postproc.reproductions.checks import Check, Json, ours, theirs, under

README_ANCHORS_M = ((0.0, 10.0), (10.0, 10.0), (0.0, 0.0), (10.0, 0.0))
README_PATH_M = tuple((float(k), float(k)) for k in range(11))

_LEAST_SPREAD = 1e-9  # width of the anchors by their length: less is a line, up to rounding


@dataclass(frozen=True, slots=True)
class Anchors:
    """Positions of the anchors in metres, shape (n, 2).

    Raises `ConfigError` unless they span the plane.
    """

    position_m: FloatArray

    def __post_init__(self) -> None:
        is_plane = self.position_m.ndim == 2 and self.position_m.shape[1] == 2
        if not is_plane or not np.all(np.isfinite(self.position_m)):
            raise ConfigError("anchors are positions x,y in metres")
        spread = np.linalg.svd(self.position_m - np.mean(self.position_m, axis=0), compute_uv=False)
        if len(spread) < 2 or spread[1] <= _LEAST_SPREAD * spread[0]:
            raise ConfigError(
                "the anchors stand on one line: a position in the plane takes three that do not"
            )

    def __len__(self) -> int:
        return len(self.position_m)

    @property
    def squared_m2(self) -> FloatArray:
        """Squared distances of the anchors from the origin, shape (n,)."""
        return np.asarray(np.sum(self.position_m**2, axis=1), float)

    def ranges_m(self, path_m: FloatArray) -> FloatArray:
        """True ranges from positions (..., 2), shape (..., n)."""
        return np.asarray(np.linalg.norm(path_m[..., None, :] - self.position_m, axis=-1), float)


@dataclass(frozen=True, slots=True)
class Rows:
    """Differences of squared ranges; `of` has shape (rows, n)."""

    anchors: Anchors
    of: FloatArray

    @property
    def h(self) -> FloatArray:
        """H in metres, shape (rows, 2)."""
        return np.asarray(-2.0 * self.of @ self.anchors.position_m, float)

    def z_m2(self, ranges_m: FloatArray) -> FloatArray:
        """Measurements of ranges (..., n), shape (..., rows)."""
        return np.asarray((ranges_m**2 - self.anchors.squared_m2) @ self.of.T, float)

    def r_m4(self, ranges_m: FloatArray, sigma2_m2: float) -> FloatArray:
        """R of the README from ranges (..., n), shape (..., rows, rows)."""
        variance_m4 = 4.0 * sigma2_m2 * ranges_m[..., None, :] ** 2
        return np.asarray((self.of * variance_m4) @ self.of.T, float)


def all_pairs(anchors: Anchors) -> Rows:
    """Every pair of anchors, in the README's order: n (n - 1) / 2 rows of rank n - 1."""
    return Rows(anchors, np.array([i - j for i, j in combinations(np.eye(len(anchors)), 2)]))


def independent(anchors: Anchors) -> Rows:
    """The first anchor against each other one: n - 1 rows, from which all pairs follow."""
    return Rows(anchors, np.hstack([np.ones((len(anchors) - 1, 1)), -np.eye(len(anchors) - 1)]))


def fix_m(anchors: Anchors, ranges_m: FloatArray) -> FloatArray:
    """Position from ranges (..., n), shape (..., 2)."""
    return np.asarray((ranges_m**2 - anchors.squared_m2) @ _operator(anchors).T, float)


def covariance_m2(anchors: Anchors, at_m: FloatArray, sigma2_m2: float) -> FloatArray:
    """Covariance of the fix at positions (..., 2), shape (..., 2, 2).

    Exact, since the fix is linear in squared ranges.
    """
    operator = _operator(anchors)
    variance_m4 = 4.0 * sigma2_m2 * anchors.ranges_m(at_m) ** 2 + 2.0 * sigma2_m2**2
    return np.asarray((operator * variance_m4[..., None, :]) @ operator.T, float)


def _operator(anchors: Anchors) -> FloatArray:
    """Squared ranges -> position, shape (2, n)."""
    rows = all_pairs(anchors)
    return np.asarray(np.linalg.solve(rows.h.T @ rows.h, rows.h.T @ rows.of), float)


class Process(NamedTuple):
    """E[w] in metres, shape (2,), and Q in square metres, shape (2, 2)."""

    mean_m: FloatArray
    q_m2: FloatArray


_PUBLISHED = {
    0.01: ((-0.0018e-3, -0.8846e-3), ((0.0429, -0.0003), (-0.0003, 0.0425))),
    0.1: ((0.0116, 0.0046), ((0.4215, 0.0), (0.0, 0.4250))),
    1.0: ((-0.0177, 0.0092), ((4.2001, 0.0562), (0.0562, 4.2879))),
    10.0: ((0.0139, 0.1614), ((44.0896, 0.1916), (0.1916, 45.4973))),
    100.0: ((-0.1293, 0.1903), ((692.67, -5.5408), (-5.5408, 691.00))),
}
README_SIGMA2_M2 = tuple(_PUBLISHED)


def readme_values(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> Process | None:
    """The README's values, None for another variance, other anchors or another path."""
    same_anchors = np.array_equal(anchors.position_m, README_ANCHORS_M)
    if not same_anchors or not np.array_equal(path_m, README_PATH_M):
        return None
    if sigma2_m2 not in _PUBLISHED:
        return None
    mean, q = _PUBLISHED[sigma2_m2]
    return Process(np.array(mean), np.array(q))


def closed_form(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> Process:
    """E[w] and Q in closed form for a path (steps, 2) of three steps or more."""
    first, second = covariance_m2(anchors, path_m[:2], sigma2_m2)
    turns_m = np.diff(path_m, 2, axis=0)
    mean_m = np.mean(turns_m, axis=0)
    off_m = turns_m - mean_m
    return Process(mean_m, 4.0 * second + first + off_m.T @ off_m / len(off_m))


class Track(NamedTuple):
    """Estimated positions (runs, steps, 2) in metres, and their P (runs, steps, 2, 2) in m^2."""

    position_m: FloatArray
    p_m2: FloatArray


def by_readme(
    rows: Rows, ranges_m: FloatArray, sigma2_m2: float, process: Process, p1: FloatArray
) -> Track:
    """The README's filter over all pairs, with S inverted on its range, or independent rows.

    `ranges_m` has shape (runs, steps, n) with two steps or more; `p1` (2, 2) is P after the second
    step.
    """
    h, rank = rows.h, len(rows.anchors) - 1
    position = fix_m(rows.anchors, ranges_m)
    p = np.broadcast_to(p1, (*position.shape, 2)).copy()
    z, by_step = rows.z_m2(ranges_m), np.moveaxis(ranges_m, 1, 0)
    for k in range(2, position.shape[1]):
        predicted = 2.0 * position[:, k - 1] - position[:, k - 2] + process.mean_m
        p_predicted = p[:, k - 1] + process.q_m2
        hp = h @ p_predicted
        s = hp @ h.T + rows.r_m4(by_step[k], sigma2_m2)
        gain = np.swapaxes(_solve(s, hp, rank), -1, -2)
        innovation = z[:, k] - predicted @ h.T
        position[:, k] = predicted + (gain @ innovation[..., None])[..., 0]
        p[:, k] = p_predicted - gain @ hp
    return Track(position, p)


def _solve(s: FloatArray, hp: FloatArray, rank: int) -> FloatArray:
    """S^+ H P; where S is singular, the eigenvalues beyond the `rank` largest are rounding."""
    if s.shape[-1] == rank:
        return np.asarray(np.linalg.solve(s, hp), float)
    value, vector = np.linalg.eigh(s)
    basis = vector[..., -rank:]
    return np.asarray(basis @ ((np.swapaxes(basis, -1, -2) @ hp) / value[..., -rank:, None]), float)


_F = np.block([[np.eye(2), np.eye(2)], [np.zeros((2, 2)), np.eye(2)]])


def on_squares(
    anchors: Anchors, ranges_m: FloatArray, sigma2_m2: float, turn_m2: FloatArray
) -> Track:
    """Track from ranges (runs, steps, n), two steps or more.

    `turn_m2` (2, 2) is the variance of a change of velocity from step to step.
    """
    position = fix_m(anchors, ranges_m)
    p = np.empty((*position.shape, 2))
    p[:, :2] = covariance_m2(anchors, position[:, :2], sigma2_m2)
    state = np.concatenate([position[:, 1], position[:, 1] - position[:, 0]], axis=1)
    first, second = p[:, 0], p[:, 1]
    covariance = np.block([[second, second], [second, second + first]])
    q = np.zeros((4, 4))
    q[2:, 2:] = turn_m2
    for k in range(2, position.shape[1]):
        state, covariance = state @ _F.T, _F @ (covariance + q) @ _F.T
        state, covariance = _correct(anchors, state, covariance, ranges_m[:, k] ** 2, sigma2_m2)
        position[:, k], p[:, k] = state[:, :2], covariance[:, :2, :2]
    return Track(position, p)


def _correct(
    anchors: Anchors, state: FloatArray, p: FloatArray, squared_m2: FloatArray, sigma2_m2: float
) -> tuple[FloatArray, FloatArray]:
    off_m = state[:, None, :2] - anchors.position_m
    plane = p[:, :2, :2]
    mean_m2 = np.sum(off_m**2, axis=-1) + np.trace(plane, axis1=1, axis2=2)[:, None]
    g = 2.0 * off_m
    s = g @ plane @ np.swapaxes(g, 1, 2) + 2.0 * np.sum(plane**2, axis=(1, 2))[:, None, None]
    each = np.arange(len(anchors))
    s[:, each, each] += 4.0 * sigma2_m2 * mean_m2 + 2.0 * sigma2_m2**2
    weights = np.swapaxes(np.linalg.solve(s, g), 1, 2)
    innovation = squared_m2 - mean_m2 - sigma2_m2
    # only the position is measured: the gain is P[:, :2] G' S^-1
    cross = p[:, :, :2]
    step = cross @ (weights @ innovation[..., None])
    return state + step[..., 0], p - cross @ (weights @ g) @ np.swapaxes(cross, 1, 2)


_AT_ANCHOR_M = 1e-9  # nearer, the direction is rounding


def epoch_bound_m2(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> FloatArray:
    """Least covariance of a fix from each epoch alone, shape (steps, 2, 2)."""
    u = _directions(anchors, path_m)
    return np.asarray(sigma2_m2 * np.linalg.inv(np.swapaxes(u, 1, 2) @ u), float)


def motion_bound_m2(anchors: Anchors, path_m: FloatArray, sigma2_m2: float) -> FloatArray:
    """Least covariance of each position from all ranges so far, shape (steps, 2, 2).

    The velocity is constant.
    """
    u = _directions(anchors, path_m)
    least = epoch_bound_m2(anchors, path_m, sigma2_m2)
    for k in range(1, len(path_m)):
        age = np.arange(k, -1, -1)[:, None, None]
        g = np.concatenate([u[: k + 1], -age * u[: k + 1]], axis=2).reshape(-1, 4)
        least[k] = sigma2_m2 * np.linalg.inv(g.T @ g)[:2, :2]
    return least


def mean_bound_m(covariance_m2: FloatArray) -> FloatArray:
    """Mean distance from its centre of a plane Gaussian (..., 2, 2), shape (...).

    With variances a >= b along its axes it is sqrt(2 a / pi) E(1 - b / a), E the complete elliptic
    integral of the second kind with parameter m.
    """
    small, large = np.moveaxis(np.linalg.eigvalsh(covariance_m2), -1, 0)
    return np.asarray(np.sqrt(2.0 * large / np.pi) * ellipe(1.0 - small / large), float)


def _directions(anchors: Anchors, path_m: FloatArray) -> FloatArray:
    """Unit vectors from the anchors, shape (steps, n, 2)."""
    off_m = path_m[:, None, :] - anchors.position_m
    along_m = np.gradient(path_m, axis=0)[:, None, :]
    off_m = np.where(anchors.ranges_m(path_m)[..., None] < _AT_ANCHOR_M, along_m, off_m)
    length_m = np.linalg.norm(off_m, axis=-1, keepdims=True)
    return np.asarray(off_m / np.where(length_m > 0.0, length_m, 1.0), float)


_NEES_APART = 0.1  # beyond what 10 000 runs leave to chance
_PINV_APART = 1e-6  # of the error: rounding
_CHUNK = 2000  # runs at once: some 20 MB
_FARTHEST_M = 1e7  # half way around the Earth is 2e7
_FINEST_M, _COARSEST_M = 1e-6, 1e6  # between these the matrices keep their digits
_CONSTANT = 1e-9  # change of a step by the size of the path: less is rounding
_COMPARED_RUNS = 20  # for the pseudo-inverse, which is slow


@dataclass(frozen=True, slots=True)
class Setting:
    """What is simulated: anchors, path (steps, 2), variances of a range in m^2, runs, seed.

    Raises `ConfigError` for a path of fewer than three steps, a variance that is not positive, or
    no run.
    """

    anchors: Anchors
    path_m: FloatArray
    sigma2_m2: tuple[float, ...] = README_SIGMA2_M2
    runs: int = 10_000
    seed: int = 0

    def __post_init__(self) -> None:
        if self.path_m.ndim != 2 or self.path_m.shape[1] != 2 or len(self.path_m) < 3:
            raise ConfigError("the path needs three points x,y or more: the filter starts from two")
        if (
            not np.max(np.abs(np.concatenate([self.path_m, self.anchors.position_m])))
            <= _FARTHEST_M
        ):
            raise ConfigError(
                "anchors and path are positions in metres, at most 10 000 km from the origin"
            )
        is_possible = (_FINEST_M**2 <= s <= _COARSEST_M**2 for s in self.sigma2_m2)
        if not self.sigma2_m2 or not all(is_possible):
            raise ConfigError(
                "the variance of a range is a number of square metres between 1e-12 and 1e12"
            )
        if self.runs < 1 or self.seed < 0:
            raise ConfigError("at least one run, and a seed that is not negative")

    @property
    def has_constant_velocity(self) -> bool:
        """Whether all steps of the path are the same."""
        turns_m = np.diff(self.path_m, 2, axis=0)
        size_m = max(float(np.max(np.abs(self.path_m))), 1.0)
        return bool(np.max(np.abs(turns_m)) <= _CONSTANT * size_m)


@dataclass(frozen=True, slots=True)
class Row:
    """Mean errors in metres at one variance, for each step in arrays of shape (steps,).

    `kf` is the README's filter with the printed Q and E[w] where it has them (`is_printed`),
    `squares` the filter without a singular matrix. `epoch_bound` and `motion_bound` are mean errors
    of Gaussians that reach the Cramer-Rao bound of one epoch and of constant velocity; the latter
    is None for another motion. `kf_nees` and `squares_nees` are the normalised errors squared by
    degree of freedom over the filtered steps: 1 for a covariance that is true. `pinv_difference_m`
    is the largest difference between pseudo-inverse and independent rows over some of the runs.
    """

    sigma2_m2: float
    is_printed: bool
    lse_m: FloatArray
    kf_m: FloatArray
    squares_m: FloatArray
    epoch_bound_m: FloatArray
    motion_bound_m: FloatArray | None
    kf_nees: float
    squares_nees: float
    pinv_difference_m: float


def setting(
    anchors_m: FloatArray | None = None,
    path_m: FloatArray | None = None,
    sigma2_m2: Sequence[float] | None = None,
    runs: int = 10_000,
    seed: int = 0,
) -> Setting:
    """The README's simulation, with the arguments instead of its values.

    Raises `ConfigError` as `Setting` does.
    """
    return Setting(
        Anchors(np.array(README_ANCHORS_M) if anchors_m is None else anchors_m),
        np.array(README_PATH_M) if path_m is None else path_m,
        tuple(README_SIGMA2_M2 if sigma2_m2 is None else sigma2_m2),
        runs,
        seed,
    )


def simulate(setting: Setting) -> Iterator[Row]:
    """One row for each variance, in their order."""
    for number, sigma2_m2 in enumerate(setting.sigma2_m2):
        yield _row(setting, sigma2_m2, np.random.default_rng([setting.seed, number]))


def _row(setting: Setting, sigma2_m2: float, rng: np.random.Generator) -> Row:
    published = readme_values(setting.anchors, setting.path_m, sigma2_m2)
    # squares of coordinates keep their digits near the origin, and no error depends on the origin
    middle_m = np.mean(setting.anchors.position_m, axis=0)
    anchors, path_m = Anchors(setting.anchors.position_m - middle_m), setting.path_m - middle_m
    noise = published or closed_form(anchors, path_m, sigma2_m2)
    p1 = covariance_m2(anchors, path_m[1], sigma2_m2)  # the README publishes none
    pairs, turns_m = all_pairs(anchors), np.diff(path_m, 2, axis=0)
    turn_m2 = turns_m.T @ turns_m / len(turns_m)
    error_m, nees_sum, apart_m = np.zeros((3, len(path_m))), np.zeros(2), 0.0
    for begin in range(0, setting.runs, _CHUNK):
        size = min(_CHUNK, setting.runs - begin), len(path_m), len(anchors)
        ranges_m = anchors.ranges_m(path_m) + np.sqrt(sigma2_m2) * rng.normal(size=size)
        kf = by_readme(independent(anchors), ranges_m, sigma2_m2, noise, p1)
        full_rank = on_squares(anchors, ranges_m, sigma2_m2, turn_m2)
        off_m = np.stack([fix_m(anchors, ranges_m), kf.position_m, full_rank.position_m]) - path_m
        error_m += np.sum(np.linalg.norm(off_m, axis=-1), axis=1)
        nees_sum += (_nees(kf, path_m), _nees(full_rank, path_m))
        pinv = by_readme(pairs, ranges_m[:_COMPARED_RUNS], sigma2_m2, noise, p1)
        apart = np.abs(pinv.position_m - kf.position_m[:_COMPARED_RUNS])
        apart_m = max(apart_m, float(np.max(apart)))
    epoch_m2 = epoch_bound_m2(anchors, path_m, sigma2_m2)
    motion_bound_m = None
    if setting.has_constant_velocity:
        motion_m2 = motion_bound_m2(anchors, path_m, sigma2_m2)
        motion_bound_m = mean_bound_m(motion_m2)
    lse_m, kf_m, squares_m = error_m / setting.runs
    kf_nees, squares_nees = (nees_sum / setting.runs).tolist()
    return Row(
        sigma2_m2=sigma2_m2,
        is_printed=published is not None,
        lse_m=lse_m,
        kf_m=kf_m,
        squares_m=squares_m,
        epoch_bound_m=mean_bound_m(epoch_m2),
        motion_bound_m=motion_bound_m,
        kf_nees=kf_nees,
        squares_nees=squares_nees,
        pinv_difference_m=apart_m,
    )


def _nees(track: Track, path_m: FloatArray) -> float:
    """Sum over the runs of the mean NEES of the filtered steps, by degree of freedom."""
    values = nees(track.position_m[:, 2:] - path_m[2:], track.p_m2[:, 2:])
    return float(np.sum(np.mean(values, axis=1)) / 2.0)


_FORM = "{text!r}: positions are written x,y x,y ... in metres"


def places(text: str) -> FloatArray:
    """Positions from "x,y x,y ..." (or with semicolons between) in metres, shape (n, 2).

    Raises `ConfigError`.
    """
    pairs = [pair.split(",") for pair in text.replace(";", " ").split()]
    if not pairs or any(len(pair) != 2 for pair in pairs):
        raise ConfigError(_FORM.format(text=text))
    try:
        return np.array(pairs, float)
    except ValueError:
        raise ConfigError(_FORM.format(text=text)) from None


def _errors(row: Row) -> dict[str, FloatArray | None]:
    return {
        "lse_m": row.lse_m,
        "kf_m": row.kf_m,
        "squares_m": row.squares_m,
        "bound_epoch_m": row.epoch_bound_m,
        "bound_motion_m": row.motion_bound_m,
    }


def json_form(setting: Setting, rows: Sequence[Row], *, steps: bool) -> Json:
    """All figures, with the errors of each step if `steps`."""
    forms: list[Json] = []
    for row in rows:
        errors = _errors(row)
        forms.append(
            {
                "sigma2": row.sigma2_m2,
                **{name: None if e is None else float(np.mean(e)) for name, e in errors.items()},
                "q_from": "README" if row.is_printed else "derived",
                "kf_nees": row.kf_nees,
                "squares_nees": row.squares_nees,
                "pinv_difference_m": row.pinv_difference_m,
            }
        )
        if steps:
            forms[-1]["steps"] = [
                {"k": k, **{name: None if e is None else float(e[k]) for name, e in errors.items()}}
                for k in range(len(row.lse_m))
            ]
    return {
        "anchors_m": setting.anchors.position_m.tolist(),
        "path_m": setting.path_m.tolist(),
        "runs": setting.runs,
        "seed": setting.seed,
        "rows": forms,
    }


def checks(setting: Setting, rows: Sequence[Row], *, steps: bool) -> list[Check]:
    """What the README means its filter to do, at each variance, and at each step if `steps`."""
    return [check for row in rows for check in _checks_of_row(setting, row, steps=steps)]


def _checks_of_row(setting: Setting, row: Row, *, steps: bool) -> list[Check]:
    count = len(setting.path_m)
    by_step = range(count if steps else 0)
    q_from = "the README's Q" if row.is_printed else "a derived Q"
    return under(
        f"sigma² {row.sigma2_m2:g} m², {q_from}, {len(setting.anchors)} anchors",
        _no_farther(row, slice(None), f"mean over {count} steps and {setting.runs} runs"),
        *(_no_farther(row, slice(k, k + 1), f"step {k}") for k in by_step),
        Check(
            "P is the covariance of the filter's error",
            f"NEES by degree of freedom (1 for a true covariance) {row.kf_nees:.2f}; of the "
            f"filter on squares {row.squares_nees:.2f}",
            theirs(abs(row.kf_nees - 1.0) < _NEES_APART),
        ),
        Check(
            "S can be inverted",
            "it is singular; over independent rows the filter is that of the pseudo-inverse, to "
            f"{row.pinv_difference_m:.1e} m",
            ours(row.pinv_difference_m < _PINV_APART * max(float(np.max(row.kf_m)), 1.0)),
        ),
    )


def _no_farther(row: Row, steps: slice, what: str) -> Check:
    lse, kf, squares, epoch, motion = (
        "-" if error_m is None else f"{np.mean(error_m[steps]):#.4g} m"
        for error_m in _errors(row).values()
    )
    return Check(
        f"{what}: the filter is no farther than each epoch alone",
        f"LSE {lse}, KF of the README {kf}, KF on squares {squares}; "
        f"bound of the epoch {epoch}, of constant velocity {motion}",
        theirs(float(np.mean(row.kf_m[steps])) <= float(np.mean(row.lse_m[steps]))),
    )


_DPI = 150
_SIZE_INCH = (11.0, 4.5)
_LINES = {
    "LSE": ("lse_m", "#b2182b", "-"),
    "KF of the README": ("kf_m", "#2166ac", "-"),
    "KF on squares": ("squares_m", "#1b7837", "-"),
    "bound, one epoch": ("epoch_bound_m", "#555555", "--"),
    "bound, constant velocity": ("motion_bound_m", "#555555", ":"),
}


def draw(setting: Setting, rows: Sequence[Row], path: Path) -> None:
    """Draw the errors by noise, and step by step; format by the suffix (.png, .svg, .pdf).

    Raises `ConfigError` or `RunFileError`.
    """
    figure = Figure(figsize=_SIZE_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    by_noise, by_step = figure.subplots(1, 2)
    ascending, middle = sorted(rows, key=lambda row: row.sigma2_m2), rows[len(rows) // 2]
    sigma_m = np.sqrt([row.sigma2_m2 for row in ascending])
    for label, (name, colour, style) in _LINES.items():
        errors = [getattr(row, name) for row in ascending]
        if all(error is not None for error in errors):
            mean_m = [float(np.mean(error)) for error in errors]
            marker = "." if style == "-" else ""
            by_noise.loglog(sigma_m, mean_m, style, color=colour, label=label, marker=marker)
        error_m = getattr(middle, name)
        if error_m is not None:
            by_step.plot(range(len(error_m)), error_m, style, color=colour)
    _label(by_noise, "mean error over all steps, by the noise", "sigma of a range (m)")
    _label(by_step, f"mean error step by step, sigma² = {middle.sigma2_m2:g} m²", "step k")
    by_noise.set_ylabel("mean error (m)")
    by_noise.legend(fontsize=8)
    by_step.set_ylim(bottom=0.0)
    n_anchors, n_steps = len(setting.anchors), len(setting.path_m)
    figure.suptitle(f"{n_anchors} anchors, {n_steps} steps, {setting.runs} simulated runs")
    with whole_file(path) as part:
        figure.savefig(part, format=kind_of(path), dpi=_DPI)


def _label(axes: Axes, title: str, along: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.set_xlabel(along)
    axes.grid(visible=True, which="both", alpha=0.2)
