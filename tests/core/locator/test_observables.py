import numpy as np
import pytest

from logger.core.locator.mixture import Mixture
from logger.core.locator.observables import Observables, observables, pool
from logger.core.locator.pipeline import locate
from logger.core.places import Places
from logger.core.readings import Readings
from tests.kit.walks import observations

SIDE_M = 20.0


def _grid(half_m=2000.0):
    axis_m = np.arange(-half_m, half_m, SIDE_M) + 0.5 * SIDE_M
    x_m, y_m = (values.ravel() for values in np.meshgrid(axis_m, axis_m))
    return np.stack([x_m, y_m, np.full(len(x_m), SIDE_M)])


def _observables_at(x_m, spread_m, above_db):
    return Observables(Places.of(x_m, 0.0), np.ones(1), spread_m, above_db)


def _readings(x_m, level_dbm):
    return Readings("c", None, Places.of(x_m, np.zeros(len(x_m))), level_dbm, np.arange(len(x_m)))


def test_the_observables_are_those_of_the_top_10_db():
    x_m = np.array([0.0, 30.0, 60.0, 500.0, 900.0])
    level_dbm = np.array([-63.0, -60.0, -64.0, -85.0, -90.0])
    seen = observables(_readings(x_m, level_dbm))
    assert seen.places.x_m[0] == 30.0
    assert seen.weight.tolist() == pytest.approx([0.936, 0.047, 0.017, 0.0, 0.0], abs=1e-3)
    assert seen.spread_m == pytest.approx(np.std([0.0, 30.0, 60.0]), rel=1e-3)
    assert seen.above_median_db == 4.0


def test_a_hundredth_of_a_decibel_decides_nothing():
    x_m = np.append(np.linspace(0.0, 300.0, 40), 1500.0)
    level_dbm = np.append(np.full(40, -80.0), -70.0)
    level_dbm[::8] = -60.0  # several strongest, and a far one just within 10 dB
    moved_dbm = np.random.default_rng(0).normal(0.0, 0.01, len(x_m))
    one, other = (observables(_readings(x_m, dbm)) for dbm in (level_dbm, level_dbm + moved_dbm))
    assert other.spread_m == pytest.approx(one.spread_m, rel=0.01)
    square = _grid(2000.0)
    np.testing.assert_allclose(other.log_density(square), one.log_density(square), atol=0.05)


def test_one_high_level_has_the_spread_of_the_receivers_errors():
    seen = observables(_readings(np.array([0.0, 50.0]), np.array([-60.0, -90.0])))
    assert seen.spread_m == 10.0


def test_the_distance_alone_is_lognormal():
    """As a density of the plane it gives the median that the line states."""
    seen = _observables_at(0.0, 100.0, 20.0)
    square = _grid(10_000.0)
    log_p = seen.log_density(square)
    p = np.exp(log_p - np.max(log_p))
    away_m = np.hypot(square[0], square[1])
    order = np.argsort(away_m)
    middle = np.searchsorted(np.cumsum(p[order]) / np.sum(p), 0.5)
    line_m = np.exp(2.80 + 0.68 * np.log(100.0) - 0.022 * 20.0)
    assert away_m[order][middle] == pytest.approx(line_m, rel=0.05)


def test_a_steeper_peak_is_closer():
    square = np.array([[50.0, 800.0], [0.0, 0.0], [5.0, 5.0]])
    near, far = (
        float(np.subtract(*_observables_at(0.0, spread_m, above_db).log_density(square)))
        for spread_m, above_db in ((15.0, 30.0), (300.0, 8.0))
    )
    assert near > far


def test_pooling_keeps_the_hypotheses_of_each_square_and_the_sum():
    rng = np.random.default_rng(1)
    square = _grid(400.0)
    share = rng.random((3, square.shape[1]))
    share[:, ::7] = 0.0
    mixed = Mixture(share / np.sum(share), -12.0)
    pooled = pool(mixed, square, _observables_at(0.0, 40.0, 20.0))
    assert np.sum(pooled.share) == pytest.approx(1.0)
    assert np.all(pooled.share[:, ::7] == 0.0)
    assert pooled.log_evidence == -12.0
    some = mixed.probability > 0.0
    np.testing.assert_allclose(
        pooled.share[:, some] / pooled.probability[some],
        mixed.share[:, some] / mixed.probability[some],
    )


def test_a_square_split_in_four_does_not_count_more():
    """Pooled densities, not probabilities: how finely the search looked says nothing."""
    seen = _observables_at(-500.0, 40.0, 20.0)
    coarse = np.array([[0.0, 2000.0], [0.0, 0.0], [40.0, 40.0]])
    fine = np.array([[-10.0, 10.0, -10.0, 10.0, 2000.0], [-10, -10, 10, 10, 0], [20] * 4 + [40]])
    of_coarse = pool(Mixture(np.array([[0.5, 0.5]]), 0.0), coarse, seen).probability[0]
    of_fine = pool(Mixture(np.array([[0.125] * 4 + [0.5]]), 0.0), fine, seen).probability[:4].sum()
    assert of_fine == pytest.approx(of_coarse, rel=0.01)


def test_a_posterior_is_pooled_wherever_the_levels_scale_begins():
    rng = np.random.default_rng(4)
    x_m = np.arange(0.0, 900.0, 6.0)
    distance_m = np.hypot(x_m - 400.0, 90.0)
    level_dbm = -35.0 - 27.0 * np.log10(distance_m) + 3.0 * rng.normal(size=len(x_m))
    one, other = (
        locate(observations(x_m, np.zeros_like(x_m), level_dbm + shift_db))
        for shift_db in (0.0, -7.0)
    )
    assert other.r95_m == pytest.approx(one.r95_m, rel=0.1)
    assert one.squares.probability.sum() == pytest.approx(1.0)
