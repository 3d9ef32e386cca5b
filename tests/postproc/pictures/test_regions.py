import numpy as np

from logger.core.locator.region import Squares
from postproc.pictures.picture import region_rings


def test_rings_are_closed_and_relative_to_the_origin():
    (ring,) = region_rings(
        Squares(*(np.array([v]) for v in (100.0, 200.0, 8.0, 1.0))), 0.95, (90.0, 190.0)
    )
    np.testing.assert_array_equal(ring[0], ring[-1])
    np.testing.assert_allclose(
        [ring.min(axis=0), ring.max(axis=0)], [(6.0, 6.0), (14.0, 14.0)], atol=1e-3
    )
