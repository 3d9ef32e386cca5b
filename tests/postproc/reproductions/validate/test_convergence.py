import numpy as np
import pytest

from logger.core.ellipse import CHI2_95_2DOF
from postproc.reproductions.validate import convergence, scenarios
from postproc.reproductions.validate.walk import SPEC, circle, heard


def walked():
    x_m, y_m = scenarios._square()
    noise_db = np.random.default_rng(0).normal(size=len(x_m))
    return scenarios.STATION, x_m, y_m, heard(scenarios.STATION, x_m, y_m) + noise_db


def test_our_locator_finds_a_station_that_can_be_found():
    found = convergence.located(*walked())
    assert found.place_m < 30.0
    assert found.covers
    assert found.radius_m < 100.0


def test_a_region_that_is_elsewhere_does_not_cover():
    station, *readings = walked()
    moved = station._replace(x_m=station.x_m + 500.0)
    found = convergence.located(moved, *readings)
    assert not found.covers
    assert found.place_m == pytest.approx(500.0, abs=60.0)


def test_the_reference_filter_stays_where_it_started():
    x_m, y_m = circle(50)
    found = convergence.filtered(SPEC, x_m, y_m, heard(SPEC, x_m, y_m))
    assert found.place_m == pytest.approx(500.0, abs=1.0)
    assert not found.covers
    assert found.place_m**2 > CHI2_95_2DOF * found.radius_m**2


def test_the_table_says_what_each_claim_is_worth():
    found = convergence._row(convergence.CLAIMS[0], 1)
    assert [check.verdict for check in found] == ["does not hold"] * 3
    assert all(check.is_sampled for check in found)
    for name in (
        "reference EKF",
        "cellwalk",
        "Cramer-Rao bound",
        "cannot tell",
        "which the claim is beyond",
    ):
        assert name in found[0].measured
    assert "rank 3 of 4" in convergence._undetermined().measured
