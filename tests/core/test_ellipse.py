import math

import numpy as np
import pytest

from logger.core.certainty import ellipse95, radii_text, radius_m


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


@pytest.mark.parametrize("axes_m", [(10.0, 10.0), (40.0, 10.0), (40.0, 0.1)])
@pytest.mark.parametrize("level", [0.5, 0.95])
def test_the_radius_holds_its_level_of_a_gaussian(axes_m, level):
    xy = np.random.default_rng(0).normal(size=(2, 40_000)) * np.array(axes_m)[:, None]
    variance = np.square(axes_m)
    radius = radius_m(ellipse95(variance[0], 0.0, variance[1]), level)
    assert np.mean(np.hypot(*xy) <= radius) == pytest.approx(level, abs=0.008)


def test_no_radius_holds_everything():
    assert radius_m(ellipse95(1.0, 0.0, 1.0), 1.0) is None


@pytest.mark.parametrize(
    ("radii_m", "text"),
    [
        ((45.4, 239.6), "most likely within 45 m, surely within 240 m"),
        ((980.0, 3240.0), "most likely within 980 m, surely within 3.2 km"),
        ((12.0, None), "most likely within 12 m"),
        ((None, None), ""),
    ],
)
def test_radii_in_words(radii_m, text):
    assert radii_text(*radii_m) == text
