import numpy as np
import pytest

from logger.sim.world import Shadowing

SIGMA_DB, DECORRELATION_M = 6.0, 20.0
FIELDS = [
    Shadowing.draw(SIGMA_DB, DECORRELATION_M, np.random.default_rng(seed)) for seed in range(400)
]


def _samples_db(distance_m, azimuth_rad=0.7):
    """Each field at a place and at one that far from it, shape (400, 2)."""
    along_m = np.array([0.0, distance_m])
    east_m, north_m = 310.0 + along_m * np.sin(azimuth_rad), -55.0 + along_m * np.cos(azimuth_rad)
    return np.array([field.at_db(east_m, north_m) for field in FIELDS])


def test_mean_and_standard_deviation_over_seeds():
    samples_db = _samples_db(500.0)

    assert samples_db.mean() == pytest.approx(0.0, abs=4 * SIGMA_DB / np.sqrt(800))
    assert samples_db.std() == pytest.approx(SIGMA_DB, rel=0.1)


@pytest.mark.parametrize("distance_m", [2.0, 20.0, 40.0, 200.0])
@pytest.mark.parametrize("azimuth_rad", [0.0, 0.7, 1.6])
def test_correlation_falls_exponentially_in_every_direction(distance_m, azimuth_rad):
    samples_db = _samples_db(distance_m, azimuth_rad)

    correlation = (samples_db[:, 0] * samples_db[:, 1]).mean() / SIGMA_DB**2

    # the product of two unit normals has a variance of at most 2
    assert correlation == pytest.approx(
        np.exp(-distance_m / DECORRELATION_M), abs=4 * np.sqrt(2 / len(FIELDS))
    )


def test_one_field_has_the_statistics_over_its_area():
    grid_m = np.arange(0.0, 2000.0, DECORRELATION_M / 2)
    field_db = FIELDS[0].at_db(*np.meshgrid(grid_m, grid_m))

    lagged = (field_db[:, 2:] * field_db[:, :-2]).mean() / SIGMA_DB**2
    assert field_db.std() == pytest.approx(SIGMA_DB, rel=0.05)
    assert lagged == pytest.approx(np.exp(-1.0), abs=0.12)


def test_levels_are_normally_distributed():
    grid_m = np.arange(0.0, 4000.0, 40.0)
    field_db = FIELDS[1].at_db(*np.meshgrid(grid_m, grid_m)) / SIGMA_DB

    assert (np.abs(field_db) < 1.0).mean() == pytest.approx(0.683, abs=0.03)
    assert (np.abs(field_db) > 2.0).mean() == pytest.approx(0.046, abs=0.015)


def test_the_same_place_has_the_same_shadowing():
    field = FIELDS[2]
    there, again = (
        field.at_db(np.array([3.0, 90.0]), np.array([4.0, 1.0])),
        field.at_db(np.array(3.0), np.array(4.0)),
    )

    assert there[0] == pytest.approx(float(again), abs=1e-9)


def test_seeds_decide():
    place = np.array([3.0]), np.array([4.0])
    redrawn = Shadowing.draw(SIGMA_DB, DECORRELATION_M, np.random.default_rng(0))

    assert FIELDS[0].at_db(*place) == redrawn.at_db(*place)
    assert FIELDS[0].at_db(*place) != FIELDS[1].at_db(*place)
