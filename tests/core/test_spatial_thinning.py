import numpy as np
import pytest

from logger.core import shadow_ekf
from logger.core.shadow_ekf import ShadowNoise
from logger.core.spatial_thinning import Visit, VisitLog, is_informative
from logger.sim.world import Shadowing

SHADOWED, WHITE = ShadowNoise(6.0, 15.0, 2.0, 0.0), ShadowNoise(0.1, 15.0, 3.0, 0.0)


def chosen_rows(x_m, y_m):
    visited = VisitLog()
    return [
        visited.take(x, y)
        for x, y in zip(np.asarray(x_m).tolist(), np.asarray(y_m).tolist(), strict=True)
    ]


def rounds(laps, step=2.8, side=200.0):
    s = np.arange(0.0, 4 * side * laps, step) % (4 * side)
    corner = [0, side, 2 * side, 3 * side, 4 * side]
    return np.interp(s, corner, [0, side, side, 0, 0]), np.interp(s, corner, [0, 0, side, side, 0])


def test_a_walk_that_never_comes_back_is_new_everywhere():
    s = np.arange(0.0, 2000.0, 1.4)
    assert set(chosen_rows(s, 0.3 * s)) == {Visit(again=False, lingers=False)}


def test_the_second_round_is_no_news():
    here = chosen_rows(*rounds(2))
    half = len(here) // 2
    assert np.mean([h.again for h in here[:half]]) < 0.03
    assert np.mean([h.again for h in here[half:]]) > 0.97


def test_a_receivers_error_hides_little_of_it():
    rng = np.random.default_rng(1)
    x, y = rounds(2)
    here = chosen_rows(x + rng.normal(0, 3, len(x)), y + rng.normal(0, 3, len(y)))
    assert np.mean([h.again for h in here[len(here) // 2 :]]) > 0.8


def test_standing_still_soon_lingers_and_pacing_comes_back():
    still = chosen_rows(np.zeros(100), np.zeros(100))
    assert [h.lingers for h in still] == [False] * 30 + [True] * 70
    assert not any(h.again for h in still)
    pacing = chosen_rows(np.tile([1.0, 4.0], 50), np.zeros(100))
    assert pacing[-1].again


def test_noise_that_is_nearly_white_is_new_at_every_visit():
    assert is_informative(Visit(again=True, lingers=False), WHITE)
    assert not is_informative(Visit(again=True, lingers=False), SHADOWED)
    assert not is_informative(Visit(again=False, lingers=True), WHITE)
    assert is_informative(Visit(again=False, lingers=False), SHADOWED)


@pytest.mark.parametrize(("once", "low", "high"), [(True, 0.87, 1.0), (False, 0.0, 0.85)])
def test_a_filter_stays_honest_over_a_street_walked_four_times(once, low, high):
    """Shadowing of the point, the same in each round; coverage of the 95 % ellipse in 80 worlds."""
    rng = np.random.default_rng(2)
    x, y = rounds(4, step=5.6)
    informative = [is_informative(here, SHADOWED) or not once for here in chosen_rows(x, y)]
    p = np.diag([8.0, 8.0, 3.0, 0.15]) ** 2
    held = []
    for _ in range(80):
        truth = np.array([*rng.uniform(50.0, 150.0, 2), -30.0, 3.0])
        level = truth[2] - 10.0 * truth[3] * np.log10(np.hypot(x - truth[0], y - truth[1]))
        level += Shadowing.draw(6.0, 15.0, rng).at_db(x, y) + 2.0 * rng.normal(size=len(x))
        state = shadow_ekf.hold(
            rng.multivariate_normal(truth, p), SHADOWED, float(x[0]), float(y[0])
        )
        state = shadow_ekf.release(state, p)
        for x_m, y_m, level_dbm, is_used in zip(
            x.tolist(), y.tolist(), level.tolist(), informative, strict=True
        ):
            if is_used:
                state = shadow_ekf.step(state, SHADOWED, x_m, y_m, 0.0, level_dbm).state
        error = np.array(state[:2]) - truth[:2]
        held.append(
            error @ np.linalg.solve(shadow_ekf.covariance_matrix(state.factors)[:2, :2], error)
            < 5.991
        )
    assert low <= np.mean(held) <= high
