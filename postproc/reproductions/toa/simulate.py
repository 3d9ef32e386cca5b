"""Mean errors over many simulated runs, as the README counts them: over all steps, the first two
being single fixes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from postproc.reproductions.toa import bound, kalman, process, squares
from postproc.reproductions.toa.lse import fix_m
from postproc.reproductions.toa.model import README_ANCHORS_M, README_PATH_M, Anchors

_CHUNK = 2000
_FARTHEST_M = 1e7
_FINEST_M, _COARSEST_M = 1e-6, 1e6
_EVEN_M = 1e-9
_CHECKED_RUNS = 20


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
            raise ConfigError("the path needs three places x,y or more: the filter starts from two")
        if not np.max(np.abs(np.concatenate([self.path_m, self.anchors.place_m]))) <= _FARTHEST_M:
            raise ConfigError(
                "anchors and path are places in metres, at most 10 000 km from the origin"
            )
        if not self.sigma2_m2 or not all(
            _FINEST_M**2 <= s <= _COARSEST_M**2 for s in self.sigma2_m2
        ):
            raise ConfigError(
                "the variance of a range is a number of square metres between 1e-12 and 1e12"
            )
        if self.runs < 1 or self.seed < 0:
            raise ConfigError("at least one run, and a seed that is not negative")

    @property
    def is_even(self) -> bool:
        """Whether the object moves at one velocity."""
        turns_m = np.diff(self.path_m, 2, axis=0)
        return bool(
            np.max(np.abs(turns_m)) <= _EVEN_M * max(float(np.max(np.abs(self.path_m))), 1.0)
        )


@dataclass(frozen=True, slots=True)
class Row:
    """Mean errors in metres at one variance, for each step in arrays of shape (steps,).

    `kf` is the README's filter with the printed Q and E[w] where it has them (`is_printed`),
    `squares` the filter without a singular matrix. `epoch_bound` and `motion_bound` are mean errors
    of Gaussians that reach the Cramer-Rao bound of one epoch and of even motion; the latter is None
    for another motion. `kf_nees` and `squares_nees` are the normalised errors squared by degree of
    freedom over the filtered steps: 1 for a covariance that is true. `pinv_difference_m` is the
    largest difference between pseudo-inverse and independent rows over some of the runs.
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
    """The README's simulation with what is given in place of its own; raises `ConfigError` as
    `Setting` does.
    """
    return Setting(
        Anchors(np.array(README_ANCHORS_M) if anchors_m is None else anchors_m),
        np.array(README_PATH_M) if path_m is None else path_m,
        tuple(process.README_SIGMA2_M2 if sigma2_m2 is None else sigma2_m2),
        runs,
        seed,
    )


def simulate(wanted: Setting) -> Iterator[Row]:
    """One row for each variance, in their order."""
    for number, sigma2_m2 in enumerate(wanted.sigma2_m2):
        yield _row(wanted, sigma2_m2, np.random.default_rng([wanted.seed, number]))


def _row(wanted: Setting, sigma2_m2: float, rng: np.random.Generator) -> Row:
    printed = process.printed(wanted.anchors, wanted.path_m, sigma2_m2)
    # squares of coordinates keep their digits near the origin, and nothing here depends on where
    # that is
    middle_m = np.mean(wanted.anchors.place_m, axis=0)
    anchors, path_m = Anchors(wanted.anchors.place_m - middle_m), wanted.path_m - middle_m
    noise = printed or process.derived(anchors, path_m, sigma2_m2)
    error_m, nees, apart_m = np.zeros((3, len(path_m))), np.zeros(2), 0.0
    for count in _chunks(wanted.runs):
        ranges_m = anchors.ranges_m(path_m) + np.sqrt(sigma2_m2) * rng.normal(
            size=(count, len(path_m), len(anchors))
        )
        seen = _seen(anchors, path_m, sigma2_m2, noise, ranges_m)
        error_m, nees, apart_m = (
            error_m + seen.error_m,
            nees + seen.nees,
            max(apart_m, seen.apart_m),
        )
    epoch_m2 = bound.of_epochs_m2(anchors, path_m, sigma2_m2)
    motion_m2 = bound.of_even_motion_m2(anchors, path_m, sigma2_m2) if wanted.is_even else None
    lse_m, kf_m, squares_m = error_m / wanted.runs
    return Row(
        sigma2_m2=sigma2_m2,
        is_printed=printed is not None,
        lse_m=lse_m,
        kf_m=kf_m,
        squares_m=squares_m,
        epoch_bound_m=bound.mean_error_m(epoch_m2),
        motion_bound_m=None if motion_m2 is None else bound.mean_error_m(motion_m2),
        kf_nees=float(nees[0]) / wanted.runs,
        squares_nees=float(nees[1]) / wanted.runs,
        pinv_difference_m=apart_m,
    )


class _Seen(NamedTuple):
    """Sums over some runs: errors (3, steps), NEES of both filters (2,); and how far pinv was from
    the rows.
    """

    error_m: FloatArray
    nees: FloatArray
    apart_m: float


def _seen(
    anchors: Anchors,
    path_m: FloatArray,
    sigma2_m2: float,
    noise: process.Process,
    ranges_m: FloatArray,
) -> _Seen:
    p1 = kalman.initial_p_m2(anchors, path_m, sigma2_m2)
    turns_m = np.diff(path_m, 2, axis=0)
    kf = kalman.by_independent_rows(anchors, ranges_m, sigma2_m2, noise, p1)
    free = squares.filtered(anchors, ranges_m, sigma2_m2, turns_m.T @ turns_m / len(turns_m))
    off_m = np.stack([fix_m(anchors, ranges_m), kf.place_m, free.place_m]) - path_m
    pinv = kalman.by_pseudo_inverse(anchors, ranges_m[:_CHECKED_RUNS], sigma2_m2, noise, p1)
    return _Seen(
        np.sum(np.hypot(off_m[..., 0], off_m[..., 1]), axis=1),
        np.array([_nees(kf, path_m), _nees(free, path_m)]),
        float(np.max(np.abs(pinv.place_m - kf.place_m[:_CHECKED_RUNS]))),
    )


def _chunks(runs: int) -> Iterator[int]:
    for done in range(0, runs, _CHUNK):
        yield min(_CHUNK, runs - done)


def _nees(track: kalman.Track, path_m: FloatArray) -> float:
    """Normalised errors squared by degree of freedom: sum over runs of the mean over the filtered
    steps.
    """
    off_m, p = track.place_m[:, 2:] - path_m[2:], track.p_m2[:, 2:]
    det = p[..., 0, 0] * p[..., 1, 1] - p[..., 0, 1] ** 2
    x, y = off_m[..., 0], off_m[..., 1]
    nees = (p[..., 1, 1] * x * x - 2.0 * p[..., 0, 1] * x * y + p[..., 0, 0] * y * y) / det
    return float(np.sum(np.mean(nees, axis=1)) / 2.0)
