import numpy as np
import pytest

from logger.core.locator.region import Squares, area_m2, highest_density
from postproc.estimators.region_outline import polygons
from postproc.pictures.regions import merge_squares, region_rings


def tree(seed):
    """Squares of 64 m split at random, with probability around one place."""
    rng = np.random.default_rng(seed)
    leaves, todo = (
        [],
        [(x, y, 64.0) for x in np.arange(-4, 4) * 64.0 for y in np.arange(-4, 4) * 64.0],
    )
    while todo:
        west, south, side = todo.pop()
        if side > 4.0 and rng.random() < 0.7:
            half = side / 2
            todo += [(west + i * half, south + j * half, half) for i in (0, 1) for j in (0, 1)]
        else:
            leaves.append((west + side / 2 + 1234.5, south + side / 2 - 99.25, side))
    x, y, side = np.array(leaves).T
    mass = np.exp(-((x - 1240.0) ** 2 + (y + 90.0) ** 2) / 2 / 60.0**2) * side**2
    return Squares(x, y, side, mass / mass.sum())


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [0.5, 0.95])
def test_fewer_squares_cover_the_same(seed, share):
    cells = tree(seed)
    few = merge_squares(cells, share)
    assert len(few) < len(highest_density(cells, share))
    np.testing.assert_allclose(np.sum(few.size_m**2), area_m2(cells, share))
    both = polygons(cells, share).symmetric_difference(polygons(few, 1.0))
    assert both.area < 1e-4 * area_m2(cells, share)


def test_rings_are_closed_and_relative_to_the_origin():
    (ring,) = region_rings(
        Squares(*(np.array([v]) for v in (100.0, 200.0, 8.0, 1.0))), 0.95, (90.0, 190.0)
    )
    np.testing.assert_array_equal(ring[0], ring[-1])
    np.testing.assert_allclose(
        [ring.min(axis=0), ring.max(axis=0)], [(6.0, 6.0), (14.0, 14.0)], atol=1e-3
    )


def test_cells_of_one_size_need_not_be_of_a_tree():
    x, y = (v.ravel() for v in np.meshgrid(np.arange(5) * 3.0, np.arange(5) * 3.0))
    cells = Squares(x, y, np.full(25, 3.0), np.full(25, 0.04))
    np.testing.assert_allclose(np.sum(merge_squares(cells, 1.0).size_m ** 2), 225.0)
