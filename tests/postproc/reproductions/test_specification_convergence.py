import numpy as np
import pytest

from logger.core.certainty import CHI2_95_2DOF
from postproc.reproductions import specification_walks as walks
from postproc.reproductions.specification_walks import SPEC, circle, true_level_dbm


def irregular_walk():
    at = walks.around_block()
    noise_db = np.random.default_rng(0).normal(size=len(at))
    return walks.STATION, at, true_level_dbm(walks.STATION, at) + noise_db


def test_our_locator_locates_an_observable_station():
    result = walks.run_locator(*irregular_walk())
    assert result.position_m < 30.0
    assert result.covers
    assert result.radius_m < 100.0


def test_a_region_that_is_elsewhere_does_not_cover():
    station, *readings = irregular_walk()
    moved = station._replace(x_m=station.x_m + 500.0)
    result = walks.run_locator(moved, *readings)
    assert not result.covers
    assert result.position_m == pytest.approx(500.0, abs=60.0)


def test_the_reference_filter_stays_where_it_started():
    at = circle(50)
    result = walks.run_reference(SPEC, at, true_level_dbm(SPEC, at))
    assert result.position_m == pytest.approx(500.0, abs=1.0)
    assert not result.covers
    assert result.position_m**2 > CHI2_95_2DOF * result.radius_m**2


def test_each_claim_has_a_verdict_and_the_figures_it_rests_on():
    lines = walks.compare(10, 1)
    assert [check.verdict for check in lines] == ["does not hold"] * 3
    measured = lines[0].measured
    for name in (
        "reference EKF",
        "cellwalk",
        "Cramer-Rao bound",
        "cannot tell",
        "which the claim is beyond",
    ):
        assert name in measured
    assert "rank 3 of 4" in walks.observability().measured
