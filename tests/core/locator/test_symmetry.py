import numpy as np
import pytest

from logger.core.locator.pipeline import locate
from logger.core.locator.symmetry import snap_to_curve
from tests.kit.walks import add_position_errors, observations, path, simulate, with_places

SIGMA_M = 5.0


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
def test_a_straight_track_with_errors_becomes_a_line(turn):
    obs = add_position_errors(
        np.random.default_rng(1), SIGMA_M, observations(*path("straight"), np.zeros(600))
    )
    x, y = (
        obs.x_m * np.cos(turn) - obs.y_m * np.sin(turn),
        obs.x_m * np.sin(turn) + obs.y_m * np.cos(turn),
    )
    found = snap_to_curve(with_places(obs, x_m=x, y_m=y))
    assert (
        np.linalg.svd(np.stack([found.x_m, found.y_m]) - [[found.x_m.mean()], [found.y_m.mean()]])[
            1
        ][1]
        < 1e-6
    )
    assert np.sqrt(np.mean((found.x_m - x) ** 2 + (found.y_m - y) ** 2)) < 1.5 * SIGMA_M


def test_a_round_track_with_errors_becomes_a_circle():
    x, y = path("circle")
    found = snap_to_curve(
        add_position_errors(
            np.random.default_rng(2), SIGMA_M, observations(x + 300.0, y, np.zeros(600))
        )
    )
    radius_m = np.hypot(found.x_m - 300.0, found.y_m)
    assert np.std(radius_m) < SIGMA_M
    middle = [found.x_m.mean(), found.y_m.mean()]
    design = np.column_stack([found.x_m - middle[0], found.y_m - middle[1], np.ones(600)])
    squares = design[:, 0] ** 2 + design[:, 1] ** 2
    assert (
        np.abs(squares - design @ np.linalg.lstsq(design, squares, rcond=None)[0]).max()
        < 1e-6 * squares.max()
    )


@pytest.mark.parametrize("shape", ["L", "square", "random", "spiral"])
def test_other_walks_stay_as_they_are(shape):
    obs = add_position_errors(
        np.random.default_rng(3), SIGMA_M, observations(*path(shape), np.zeros(600))
    )
    assert snap_to_curve(obs) is obs


@pytest.mark.parametrize("shape", ["straight", "circle"])
def test_a_track_without_errors_stays_as_it_is(shape):
    bent = observations(*path(shape), np.zeros(600))
    found = snap_to_curve(with_places(bent, y_m=bent.y_m + 0.1 * np.sin(bent.x_m)))
    np.testing.assert_array_equal(found.y_m, bent.y_m + 0.1 * np.sin(bent.x_m))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_readings_at_one_point_do_not_fail(count):
    for step in (0.0, 5.0):
        x = step * np.arange(count)
        found = snap_to_curve(observations(x, x, np.zeros(count), position_sigma=3.0))
        assert np.allclose(found.x_m, x, atol=4.5)


def test_errors_of_the_fixes_do_not_distinguish_mirror_images():
    """With the track as recorded, one side, right or wrong, has more than 95 % in half of such
    walks.
    """
    for seed in range(4):
        rng = np.random.default_rng(seed)
        cells = locate(add_position_errors(rng, SIGMA_M, simulate(rng, "straight")[0])).squares
        assert 0.2 < np.sum(cells.probability[cells.y_m > 0.0]) < 0.8
