from io import BytesIO

import numpy as np
from PIL import Image

from logger.core.locator.region import Squares
from postproc.pictures import colours
from postproc.pictures.picture import Box
from postproc.view.plan import density, png

BOX = Box(0.0, 0.0, 40.0, 20.0)


def cells(*squares):
    return Squares(*np.array(squares, float).T)


def test_probability_is_at_the_squares_north_up():
    two = cells((1005.0, 2015.0, 10.0, 0.75), (1035.5, 2000.5, 0.5, 0.25))
    pixels = density(two, np.array([1000.0, 2000.0]), BOX, 1.0)
    assert pixels.shape == (20, 40)
    np.testing.assert_allclose(pixels[:10, :10], 0.0075)
    np.testing.assert_allclose(pixels[19, 35], 0.25)
    np.testing.assert_allclose(np.sum(pixels), 1.0)


def test_squares_outside_the_plan_are_left_out():
    outside = [
        (-5.0, 5.0, 10.0, 0.25),
        (100.0, 5.0, 0.5, 0.25),
        (-5.0, -5.0, 0.5, 0.25),
        (20.0, 30.0, 10.0, 0.25),
    ]
    assert not np.any(density(cells(*outside), np.zeros(2), BOX, 1.0))
    half = density(cells((0.0, 10.0, 10.0, 1.0)), np.zeros(2), BOX, 1.0)
    np.testing.assert_allclose(np.sum(half), 0.5)


def test_the_glow_is_transparent_where_the_density_is_zero():
    picture = np.asarray(Image.open(BytesIO(png(np.array([[0.0, 0.25, 1.0]])))))
    assert picture[0, :, 3].tolist() == sorted(picture[0, :, 3].tolist())
    assert (picture[0, 0, 3], picture[0, 2, 3]) == (0, 255)
    np.testing.assert_allclose(picture[0, 1, :3], colours.POSTERIOR, atol=1)
    assert not np.any(np.asarray(Image.open(BytesIO(png(np.zeros((2, 2))))))[..., 3])
