"""Mean errors over many simulated runs, as the README has them.

They are means over all steps, the first two being single fixes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from postproc.estimators.metrics import nees
from postproc.reproductions.toa import bound, kalman, process, squares
from postproc.reproductions.toa.lse import fix_m
from postproc.reproductions.toa.model import README_ANCHORS_M, README_PATH_M, Anchors

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
    sigma2_m2: tuple[float, ...] = process.README_SIGMA2_M2
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
        tuple(process.README_SIGMA2_M2 if sigma2_m2 is None else sigma2_m2),
        runs,
        seed,
    )


def simulate(setting: Setting) -> Iterator[Row]:
    """One row for each variance, in their order."""
    for number, sigma2_m2 in enumerate(setting.sigma2_m2):
        yield _row(setting, sigma2_m2, np.random.default_rng([setting.seed, number]))


def _row(setting: Setting, sigma2_m2: float, rng: np.random.Generator) -> Row:
    published = process.readme_values(setting.anchors, setting.path_m, sigma2_m2)
    # squares of coordinates keep their digits near the origin, and no error depends on the origin
    middle_m = np.mean(setting.anchors.position_m, axis=0)
    anchors, path_m = Anchors(setting.anchors.position_m - middle_m), setting.path_m - middle_m
    noise = published or process.closed_form(anchors, path_m, sigma2_m2)
    error_m, nees_sum, apart_m = np.zeros((3, len(path_m))), np.zeros(2), 0.0
    for begin in range(0, setting.runs, _CHUNK):
        size = min(_CHUNK, setting.runs - begin), len(path_m), len(anchors)
        ranges_m = anchors.ranges_m(path_m) + np.sqrt(sigma2_m2) * rng.normal(size=size)
        sums = _sums(anchors, path_m, sigma2_m2, noise, ranges_m)
        error_m += sums.error_m
        nees_sum += sums.nees
        apart_m = max(apart_m, sums.apart_m)
    epoch_m2 = bound.of_epochs_m2(anchors, path_m, sigma2_m2)
    motion_bound_m = None
    if setting.has_constant_velocity:
        motion_m2 = bound.of_constant_velocity_m2(anchors, path_m, sigma2_m2)
        motion_bound_m = bound.mean_error_m(motion_m2)
    lse_m, kf_m, squares_m = error_m / setting.runs
    kf_nees, squares_nees = (nees_sum / setting.runs).tolist()
    return Row(
        sigma2_m2=sigma2_m2,
        is_printed=published is not None,
        lse_m=lse_m,
        kf_m=kf_m,
        squares_m=squares_m,
        epoch_bound_m=bound.mean_error_m(epoch_m2),
        motion_bound_m=motion_bound_m,
        kf_nees=kf_nees,
        squares_nees=squares_nees,
        pinv_difference_m=apart_m,
    )


class _Sums(NamedTuple):
    """Sums over some runs: errors (3, steps) and NEES of both filters (2,).

    `apart_m` is the largest difference between pseudo-inverse and independent rows.
    """

    error_m: FloatArray
    nees: FloatArray
    apart_m: float


def _sums(
    anchors: Anchors,
    path_m: FloatArray,
    sigma2_m2: float,
    noise: process.Process,
    ranges_m: FloatArray,
) -> _Sums:
    p1 = kalman.initial_p_m2(anchors, path_m, sigma2_m2)
    turns_m = np.diff(path_m, 2, axis=0)
    kf = kalman.by_independent_rows(anchors, ranges_m, sigma2_m2, noise, p1)
    full_rank = squares.run(anchors, ranges_m, sigma2_m2, turns_m.T @ turns_m / len(turns_m))
    off_m = np.stack([fix_m(anchors, ranges_m), kf.position_m, full_rank.position_m]) - path_m
    pinv = kalman.by_pseudo_inverse(anchors, ranges_m[:_COMPARED_RUNS], sigma2_m2, noise, p1)
    return _Sums(
        np.sum(np.linalg.norm(off_m, axis=-1), axis=1),
        np.array([_nees(kf, path_m), _nees(full_rank, path_m)]),
        float(np.max(np.abs(pinv.position_m - kf.position_m[:_COMPARED_RUNS]))),
    )


def _nees(track: kalman.Track, path_m: FloatArray) -> float:
    """Sum over the runs of the mean NEES of the filtered steps, by degree of freedom."""
    values = nees(track.position_m[:, 2:] - path_m[2:], track.p_m2[:, 2:])
    return float(np.sum(np.mean(values, axis=1)) / 2.0)
