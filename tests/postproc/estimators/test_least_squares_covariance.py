import numpy as np
import pytest

from logger.core.places import Places
from postproc.estimators import least_squares
from postproc.estimators.least_squares import Search
from postproc.estimators.least_squares_rows import group
from tests.kit.bent_walk import nees, walk
from tests.kit.walks import with_places


@pytest.mark.parametrize("loss", ["linear", "cauchy"])
@pytest.mark.parametrize("shadow_m", [0.0, 10.0])
def test_covariance_is_true(shadow_m, loss):
    rng = np.random.default_rng(7)
    fits = [
        least_squares.fit(
            walk(rng, noise_db=1.5, shadow_m=shadow_m), Places.of(60.0, 90.0), loss=loss
        )
        for _ in range(24)
    ]
    chi2 = np.array([nees(fit) for fit in fits])
    assert np.mean(chi2 < 5.991) >= 0.9
    assert np.mean(chi2) > 0.3  # and is not cautious beyond reason
    # independent residuals would make it this much smaller
    inflation = np.median([fit.inflation for fit in fits])
    assert 0.8 < inflation < 1.3 if shadow_m == 0.0 else inflation > 5.0


def test_an_axis_is_stretched_to_where_the_misfit_has_risen():
    obs = walk(
        np.random.default_rng(16),
        count=120,
        straight=True,
        source=np.array([30.0, 120.0, -30.0, 3.0]),
    )
    fit = least_squares.fit(obs, Places.of(30.0, 120.0))
    rows = Search(group(obs, 0.0, robust=False), "linear", 3.0).linear_problem(fit.state)

    def end_m(begin_m, rise):
        return least_squares.end_m(rows, fit.state, np.array([0.0, 1.0]), begin_m, rise)

    def risen(away_m):
        lowest, there = (
            least_squares.profile_misfit(rows, fit.state[:2] + np.array([0.0, d]))
            for d in (0.0, away_m)
        )
        return there - lowest

    for rise in (4.0, 10.0):
        assert risen(end_m(2.0, rise)) >= rise > risen(end_m(2.0, rise) / 1.2)
    assert end_m(400.0, 1.0) == 400.0
    assert end_m(2.0, 1e6) == least_squares.REACH_M


def test_a_source_far_off_a_short_walk_is_not_bounded():
    obs = walk(
        np.random.default_rng(11),
        count=40,
        straight=True,
        source=np.array([60.0, 900.0, -30.0, 3.0]),
    )
    fit = least_squares.fit(obs, Places.of(60.0, 900.0))
    assert not fit.bounded
    assert np.sqrt(np.linalg.eigvalsh(fit.covariance[:2, :2])[-1]) > 1000.0


def test_what_is_not_observed_is_uncertain():
    obs = walk(np.random.default_rng(12))
    still = with_places(obs, x_m=np.zeros(len(obs)), y_m=np.zeros(len(obs)))
    fit = least_squares.fit(still, Places.of(50.0, 0.0))
    assert np.sqrt(fit.covariance[0, 0]) > 1000.0
    assert not fit.bounded
