"""The way from the file of a measured walk to its verdict, by the functions of the tree under test.

`PYTHONPATH=TREE python benchmarks/measured.py` takes them from another tree. Those before version
0.2 have other names.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from logger.core.arrays import FloatArray
from logger.core.locator.posterior import Posterior
from logger.core.locator.region import LEVEL, highest_density
from logger.core.runfile import Run, read_run
from postproc.interop.importing import import_walk

from .answer import Squares

try:
    from logger.core.readings import Observations, Readings
except ImportError:
    from logger.core.observations import CellObservations as Readings
    from logger.core.observations import Observations

try:
    from logger.core.locator.pipeline import decide, locate
    from logger.core.locator.region import Squares as Leaves
    from logger.core.model.prior import Prior
    from postproc.walk import observe_run
except ImportError:
    from logger.core.locator.prior import Prior
    from postproc.smooth import walk_of

    from logger.core.locator.posterior import locate
    from logger.core.locator.region import Cells as Leaves
    from logger.core.locator.verdict import judged as decide

    def _observe(run: Run) -> Observations | None:
        return walk_of(run)[0]
else:

    def _observe(run: Run) -> Observations | None:
        return observe_run(run).observations


__all__ = [
    "Prior",
    "Readings",
    "decide",
    "density",
    "locate",
    "observations",
    "region",
    "weights",
    "with_trust",
]


def observations(file: Path) -> Readings:
    """Readings of the only cell of a file, at the walker's smoothed positions.

    The steps are those of `postproc import` and `postproc smooth`, without options.
    """
    with TemporaryDirectory() as scratch:
        target = Path(scratch) / "run.h5"
        import_walk(file, target)
        observed = _observe(read_run(target))
    if observed is None or len(observed.cells) != 1:
        raise ValueError(f"{file} is not a walk past one cell")
    return observed.cells[0]


def with_trust(prior: Prior, trust: float) -> Prior:
    """The prior where long shadowing counts with another power."""
    if hasattr(prior, "trust"):
        return replace(prior, trust=trust)
    noise = tuple(
        group._replace(trust=trust) if group.hypotheses[0].long_share else group
        for group in prior.noise
    )
    return replace(prior, noise=noise)


def region(posterior: Posterior, level: float = LEVEL) -> Squares:
    """The highest-density region with this share of the probability."""
    squares = _leaves(posterior)
    chosen = highest_density(squares, level)
    return Squares(squares.x_m[chosen], squares.y_m[chosen], squares.size_m[chosen])


def density(posterior: Posterior, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """Probability per square metre at places of shape (k,); 0 outside of the searched area."""
    squares = _leaves(posterior)
    half_m = 0.5 * squares.size_m
    inside = np.abs(squares.x_m - x_m[:, None]) <= half_m
    inside &= np.abs(squares.y_m - y_m[:, None]) <= half_m
    return np.asarray(np.max(np.where(inside, squares.density, 0.0), axis=1), float)


def weights(posterior: Posterior) -> dict[str, tuple[float, ...]]:
    """Probability of each group of the noise, and of other hypotheses that the tree has."""
    first = posterior.prior.noise_table.first
    found = {"noise": np.add.reduceat(posterior.noise_probability, first)}
    for name in ("station", "reach"):
        if hasattr(posterior, f"{name}_probability"):
            found[name] = getattr(posterior, f"{name}_probability")
    return {name: tuple(float(one) for one in each) for name, each in found.items()}


def _leaves(posterior: Posterior) -> Leaves:
    return posterior.squares if hasattr(posterior, "squares") else posterior.cells
