import numpy as np
import pytest

from logger.core.places import Utm
from logger.sim.world import Radio, Transmitter, World

NEAR = Transmitter(0.0, 0.0, -30.0, 3.0, "001", "01", 1, 1, 10, 1)
HIGH = Transmitter(100.0, 0.0, -20.0, 3.5, "001", "01", 1, 2, 20, 2, height_m=30.0)
QUIET = Radio(shadowing_sigma_db=0.0, fading_sigma_db=0.0)


def build(radio=QUIET, transmitters=(NEAR, HIGH), seed=0):
    return World.build(transmitters, 46.948, 7.4474, radio, np.random.default_rng(seed))


def test_levels_are_those_of_the_formula():
    east_m, north_m = np.array([100.0, 0.2, 100.0]), np.array([0.0, 0.0, 40.0])

    levels_dbm = build().levels_dbm(east_m, north_m)

    expected = [
        [-30.0 - 60.0, -30.0, -30.0 - 30.0 * np.log10(np.hypot(100.0, 40.0))],
        [
            -20.0 - 35.0 * np.log10(30.0),
            -20.0 - 35.0 * np.log10(np.hypot(99.8, 30.0)),
            -20.0 - 35.0 * np.log10(50.0),
        ],
    ]
    assert levels_dbm == pytest.approx(np.array(expected))


def test_levels_keep_the_shape_of_the_places():
    places = np.zeros((4, 5))

    assert build().received_dbm(places, places, np.random.default_rng(0)).shape == (2, 4, 5)


def test_readings_are_integer_dbm_and_never_below_the_floor():
    distances_m = np.geomspace(1.0, 5000.0, 400)

    heard_dbm = build().received_dbm(distances_m, np.zeros(400), np.random.default_rng(0))[0]

    exact_dbm = build().levels_dbm(distances_m, np.zeros(400))[0]
    assert (heard_dbm == np.round(heard_dbm)).all()
    assert (np.abs(heard_dbm - exact_dbm)[exact_dbm > -110.0] <= 0.5).all()
    assert (heard_dbm[exact_dbm < -110.0] == -110.0).all()


def test_fading_is_white_and_shadowing_stays():
    world = build(Radio(shadowing_sigma_db=6.0, fading_sigma_db=2.0, step_db=0.0))
    places = np.full(5000, 70.0), np.full(5000, -20.0)

    heard_dbm = world.received_dbm(*places, np.random.default_rng(3))

    assert np.ptp(world.shadowed_dbm(*places), axis=1) == pytest.approx(0.0, abs=1e-9)
    scatter_db = heard_dbm - world.shadowed_dbm(*places)
    assert scatter_db.std(axis=1) == pytest.approx(2.0, rel=0.06)
    assert (scatter_db[:, 1:] * scatter_db[:, :-1]).mean() == pytest.approx(0.0, abs=0.25)


def test_each_transmitter_has_a_shadowing_of_its_own():
    places_m = np.arange(0.0, 4000.0, 50.0)
    world = build(Radio(shadowing_sigma_db=6.0))

    shadows_db = world.shadowed_dbm(places_m, places_m) - world.levels_dbm(places_m, places_m)

    assert abs(np.corrcoef(shadows_db)[0, 1]) < 0.4


def test_seed_decides_the_readings():
    places = np.linspace(0.0, 300.0, 50), np.zeros(50)
    heard_dbm = [
        build(Radio(), seed=seed).received_dbm(*places, np.random.default_rng(seed))
        for seed in (1, 1, 2)
    ]

    assert (heard_dbm[0] == heard_dbm[1]).all()
    assert (heard_dbm[0] != heard_dbm[2]).any()


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg"), [(46.948, 7.4474), (-33.9, 18.4), (0.0, 5.999), (69.6, 18.9)]
)
def test_distances_agree_with_utm_within_a_thousandth(lat_deg, lon_deg):
    world = World.build((NEAR,), lat_deg, lon_deg, QUIET, np.random.default_rng(0))
    utm = Utm.at(lat_deg, lon_deg)
    xy_m = [
        utm.to_xy(*world.to_latlon(*place))
        for place in ((0.0, 0.0), (800.0, -300.0), (-450.0, 900.0))
    ]

    for (one, other), distance_m in (((0, 1), np.hypot(800, 300)), ((1, 2), np.hypot(1250, 1200))):
        assert np.hypot(*np.subtract(xy_m[one], xy_m[other])) == pytest.approx(distance_m, rel=1e-3)


def test_local_coordinates_come_back():
    assert build().to_local(*build().to_latlon(812.5, -40.25)) == pytest.approx(
        (812.5, -40.25), abs=1e-5
    )
