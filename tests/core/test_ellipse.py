import math

import numpy as np
import pytest

from logger.core.ellipse import ellipse95


@pytest.mark.parametrize(
    ("xx", "xy", "yy", "major", "minor", "azimuth"),
    [
        (4.0, 0.0, 1.0, 2.0, 1.0, 90.0),
        (1.0, 0.0, 4.0, 2.0, 1.0, 0.0),
        (2.5, 1.5, 2.5, 2.0, 1.0, 45.0),
        (2.5, -1.5, 2.5, 2.0, 1.0, 135.0),
    ],
)
def test_ellipse(xx, xy, yy, major, minor, azimuth):
    ellipse = ellipse95(xx, xy, yy)
    scale = math.sqrt(5.991)
    assert (ellipse.semi_major_m, ellipse.semi_minor_m) == pytest.approx(
        (major * scale, minor * scale)
    )
    assert ellipse.azimuth_deg == pytest.approx(azimuth)


def test_holds_95_percent():
    rng = np.random.default_rng(0)
    covariance = np.array([[9.0, 4.0], [4.0, 4.0]])
    east, north = rng.multivariate_normal((0.0, 0.0), covariance, 40_000).T
    ellipse = ellipse95(9.0, 4.0, 4.0)
    azimuth = math.radians(ellipse.azimuth_deg)
    along = east * math.sin(azimuth) + north * math.cos(azimuth)
    across = east * math.cos(azimuth) - north * math.sin(azimuth)
    inside = (along / ellipse.semi_major_m) ** 2 + (across / ellipse.semi_minor_m) ** 2 <= 1.0
    assert np.mean(inside) == pytest.approx(0.95, abs=0.005)
