from dataclasses import replace

import numpy as np
import pytest

from logger.core.geo import Utm
from logger.core.observations import CellObservations
from logger.core.rows import DTYPES
from logger.core.track import Track
from postproc.estimators import walker, walker_kalman
from tests.kit.scaling import cost_growth

S = 10**9
EAST_M, NORTH_M = 5e5, 5.8e6


def track(t_s, xy_m, sigma_m=3.7):
    n = len(t_s)
    x, y = np.asarray(xy_m, float).T
    t_ns = np.round(np.asarray(t_s) * S).astype(np.int64) + 77 * S
    return Track(
        Utm(33), t_ns, np.arange(n), x + EAST_M, y + NORTH_M, np.broadcast_to(sigma_m, n) * 1.0
    )


def at(smoothed, t_s):
    """Places and sigma per axis at times given as to `track`."""
    found = smoothed.at(np.round(np.asarray(t_s) * S).astype(np.int64) + 77 * S)
    return np.column_stack([found.x_m - EAST_M, found.y_m - NORTH_M]), found.sigma_m


def streets(rng, seconds, speed_mps=1.4):
    """A walk round blocks of 80 m that turns sharply and sometimes stands still: times 1 s apart
    and places (n, 2).
    """
    t_s = np.arange(float(seconds))
    stands = np.zeros(seconds, bool)
    for begin in rng.integers(0, seconds, seconds // 200):
        stands[begin : begin + rng.integers(5, 60)] = True
    length = np.cumsum(np.where(stands, 0.0, speed_mps))
    corner = 80.0 * np.arange(200)
    turn = np.arange(200) % 8
    x = np.interp(length, corner, 80.0 * np.array([0, 1, 1, 2, 2, 1, 1, 0])[turn])
    y = np.interp(length, corner, 80.0 * np.array([0, 0, 1, 1, 2, 2, 3, 3])[turn])
    return t_s, np.column_stack([x, y])


def wander(rng, t_s, sigma_m, tau_s):
    """Gauss-Markov error of both axes (n, 2)."""
    error = sigma_m * rng.normal(size=(len(t_s), 2))
    for k in range(1, len(t_s)):
        kept = np.exp(-(t_s[k] - t_s[k - 1]) / tau_s)
        error[k] = kept * error[k - 1] + np.sqrt(1.0 - kept**2) * error[k]
    return error


# --- against the dense solution ---


def dense(model, times_s, asked_s, q):
    """Mean and variance of the place at `asked_s`, from the joint Gaussian of all states and
    measurements.

    Also, for each measurement, its distance from the prediction by all the others, and the variance
    of that."""
    every = np.unique(np.concatenate([times_s, asked_s]))
    size = 3 * len(every)
    first = int(np.searchsorted(every, times_s[0]))
    # innovations form: every state is a sum of independent increments
    root = np.zeros((size, 3 * len(every)))
    root[3 * first : 3 * first + 3, 3 * first : 3 * first + 3] = np.diag([1e4, 5.0, 1.0])
    for k in [*range(first + 1, len(every)), *range(first - 1, -1, -1)]:
        origin = k - 1 if k > first else k + 1
        dt = every[k] - every[origin]
        a = np.exp(-abs(dt) / walker.WANDER_S)
        step = abs(dt)
        noise = np.array(
            [
                [q * step**3 / 3, q * dt * step / 2, 0],
                [q * dt * step / 2, q * step, 0],
                [0, 0, 1 - a * a],
            ]
        )
        own = slice(3 * k, 3 * k + 3)
        root[own] = np.array([[1, dt, 0], [0, 1, 0], [0, 0, a]]) @ root[3 * origin : 3 * origin + 3]
        root[own, own] += np.linalg.cholesky(noise)
    h, z, r = [], [], []
    for i, t in enumerate(times_s):
        k = int(np.searchsorted(every, t))
        for j, row in enumerate(([1.0, 0.0, model.wander_m[i]], [0.0, 1.0, 0.0])):
            if np.isfinite(model.variance[i, j]):
                h.append(np.zeros(size))
                h[-1][3 * k : 3 * k + 3] = row
                z.append(model.z[i, j])
                r.append(model.variance[i, j])
    h, z, prior = np.array(h), np.array(z), root @ root.T
    joint = h @ prior @ h.T + np.diag(r)
    asked = prior[3 * np.searchsorted(every, asked_s)]
    gain = np.linalg.solve(joint, h @ asked.T).T
    spread = np.diag(prior)[3 * np.searchsorted(every, asked_s)] - np.sum(
        gain * (asked @ h.T), axis=1
    )
    inverse = np.linalg.inv(joint)
    return gain @ z, spread, (inverse @ z) / np.diag(inverse)[:, None], 1.0 / np.diag(inverse)


def test_smoother_agrees_with_the_dense_solution():
    rng = np.random.default_rng(1)
    t_s = np.sort(rng.uniform(0.0, 60.0, 14))
    t_s[5] = t_s[4]  # a repeated time stamp
    given = track(t_s, 20.0 * rng.normal(size=(14, 2)), rng.uniform(2.0, 6.0, 14))
    sigma = np.where(rng.random(14) < 0.5, 0.4, np.inf)
    speed = walker.Velocities(rng.normal(size=14), rng.normal(size=14), sigma)
    q = 0.3
    model = walker._model(given, speed, q, 0.2)._replace(q=np.full(14, q))
    excess = rng.uniform(0.0, 3.0, (14, 2))
    series, apart2, expected = walker_kalman.smooth(model, excess)
    model = model._replace(variance=model.variance + excess)
    times_s = (given.t_ns - given.t_ns[0]) / 1e9
    asked_s = np.concatenate(
        [
            [-7.0, -0.5],
            times_s,
            rng.uniform(0.0, times_s[-1], 10),
            times_s[-1] + np.array([0.5, 8.0]),
        ]
    )
    mean, variance = walker.interpolate(times_s, series, q, asked_s)
    # beyond gaps of 10 s the walk is taken to be livelier than the dense solution has it
    step_s = np.diff(times_s)[np.clip(np.searchsorted(times_s, asked_s, side="right") - 1, 0, 12)]
    same = step_s <= 10.0
    expected_mean, expected_variance, residual, residual_variance = dense(
        model, times_s, asked_s, q
    )
    assert np.count_nonzero(same) > 15
    np.testing.assert_allclose(mean[same], expected_mean[same], rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(variance[same], expected_variance[same], rtol=1e-6, atol=1e-5)
    known = np.isfinite(model.variance)
    np.testing.assert_allclose(apart2[known], np.sum(residual**2, axis=1), rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(
        (expected - model.slack + excess)[known], residual_variance, rtol=1e-5, atol=1e-5
    )


def test_places_are_continuous_through_fixes_and_gaps():
    rng = np.random.default_rng(2)
    t_s, xy = streets(rng, 200)
    keep = (t_s < 80) | (t_s > 120)
    smoothed = walker.smooth_track(track(t_s[keep], xy[keep] + rng.normal(size=(keep.sum(), 2))))
    fine = np.arange(-5.0, 205.0, 0.01)
    place, sigma = at(smoothed, fine)
    assert np.max(np.hypot(*np.diff(place, axis=0).T)) < 0.05
    assert np.max(np.abs(np.diff(sigma)[(fine[1:] > 0.0) & (fine[1:] < 199.0)])) < 0.05


# --- honest ---


@pytest.mark.parametrize("white_m", [0.2, 1.5, 3.0])
@pytest.mark.parametrize("with_velocity", [False, True])
def test_sigma_is_true_under_errors_that_last(white_m, with_velocity):
    nees, inside = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        t_s, xy = streets(rng, 900)
        error = wander(rng, t_s, np.sqrt(3.7**2 - white_m**2), 60.0) + white_m * rng.normal(
            size=xy.shape
        )
        speed = np.gradient(xy, axis=0) + 0.1 * rng.normal(size=xy.shape)
        given = walker.Velocities(*speed.T, np.full(len(t_s), walker.VELOCITY_SIGMA_MPS))
        smoothed = walker.smooth_track(track(t_s, xy + error), given if with_velocity else None)
        place, sigma = at(smoothed, t_s)
        chi2 = np.sum((place - xy) ** 2, axis=1) / sigma**2
        nees.append(np.mean(chi2) / 2.0)
        inside.append(np.mean(chi2 < 5.991))
    assert 0.3 < np.mean(nees) < 1.4
    assert np.mean(inside) > 0.9


def test_smoothing_beats_interpolation_where_noise_is_white():
    rng = np.random.default_rng(3)
    t_s, xy = streets(rng, 900)
    fixes = xy + 3.0 * rng.normal(size=xy.shape) + wander(rng, t_s, 2.0, 60.0)
    place, _ = at(walker.smooth_track(track(t_s, fixes)), t_s)
    assert np.sqrt(np.mean((place - xy) ** 2)) < 0.75 * np.sqrt(np.mean((fixes - xy) ** 2))


@pytest.mark.parametrize("with_velocity", [False, True])
def test_hours_at_one_place_are_not_centimetres(with_velocity):
    t_s = np.arange(7200.0)
    none = np.zeros(len(t_s))
    given = (
        walker.Velocities(none, none, none + walker.VELOCITY_SIGMA_MPS) if with_velocity else None
    )
    place, sigma = at(walker.smooth_track(track(t_s, np.zeros((len(t_s), 2))), given), t_s)
    assert np.max(np.abs(place)) < 0.1
    assert np.all((sigma > 2.7) & (sigma < 3.7))


@pytest.mark.parametrize("gap_s", [30, 60])
def test_sigma_covers_what_happens_in_a_gap(gap_s):
    chi2, middle = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        t_s, xy = streets(rng, 600)
        fixes = xy + wander(rng, t_s, 3.0, 60.0)
        lost = (t_s > 300.0) & (t_s < 300.0 + gap_s)
        place, sigma = at(walker.smooth_track(track(t_s[~lost], fixes[~lost])), t_s[lost])
        chi2.append(np.sum((place - xy[lost]) ** 2, axis=1) / sigma**2)
        middle.append(sigma[gap_s // 2])
    assert np.mean(np.array(chi2) < 5.991) > 0.9
    assert np.median(middle) > 1.5 * 3.7
    assert gap_s > 30 or np.median(middle) < walker.USABLE_SIGMA_M


def test_a_jump_of_one_fix_is_counted_and_hardly_moves_the_walk():
    rng = np.random.default_rng(4)
    t_s, xy = streets(rng, 300)
    fixes = xy + wander(rng, t_s, 3.0, 60.0)
    jumps = [0, 50, 120, 121, 200, 299]
    fixes[jumps] += [150.0, -130.0]
    smoothed = walker.smooth_track(track(t_s, fixes))
    place, sigma = at(smoothed, t_s)
    assert np.flatnonzero(smoothed.outlier).tolist() == jumps
    assert smoothed.n_outliers == 6
    assert np.max(np.hypot(*(place - xy).T)) < 12.0
    assert np.mean(sigma[40:60]) < 5.0


def test_a_jump_that_stays_is_doubt_and_not_certainty():
    rng = np.random.default_rng(5)
    t_s, xy = streets(rng, 300)
    fixes = xy + 0.2 * rng.normal(size=xy.shape)
    wrong = (t_s >= 100) & (t_s < 110)
    fixes[wrong] += [400.0, 0.0]
    place, sigma = at(walker.smooth_track(track(t_s, fixes)), t_s)
    error = np.hypot(*(place - xy).T)
    assert np.all(error < 3.0 * sigma)
    assert np.all(sigma[102:108] > 50.0)
    assert np.max(sigma[140:]) < 4.0


def test_a_car_is_told_from_a_walker():
    rng = np.random.default_rng(6)
    t_s = np.arange(600.0)
    speed = 14.0 + 6.0 * np.sin(t_s / 15.0)
    car = np.cumsum(
        np.column_stack([speed * np.cos(t_s / 40.0), speed * np.sin(t_s / 40.0)]), axis=0
    )
    on_foot = streets(rng, 600)[1]
    found = [
        walker.smooth_track(track(t_s, xy + rng.normal(size=xy.shape))).accel_m2s3
        for xy in (on_foot, car)
    ]
    assert found[0] < 0.2 <= found[1]


# --- odd tracks ---


def test_one_fix_only():
    place, sigma = at(walker.smooth_track(track([0.0], [[3.0, 4.0]])), [-60.0, 0.0, 2.0, 1e6])
    np.testing.assert_allclose(place, [[3.0, 4.0]] * 4, atol=1e-9)
    assert sigma[1] == pytest.approx(3.7, rel=0.05)
    assert sigma[1] < sigma[2] < sigma[0] < sigma[3]


def test_repeated_time_stamps_and_rates_from_slow_to_fast():
    rng = np.random.default_rng(7)
    t_s = np.concatenate(
        [np.arange(0.0, 100.0, 10.0), np.arange(100.0, 130.0, 0.1), np.repeat(130.0, 5), [140.0]]
    )
    xy = np.column_stack([1.4 * t_s, 0.0 * t_s])
    given = track(t_s, xy + 0.5 * rng.normal(size=xy.shape))
    place, sigma = at(walker.smooth_track(given), t_s)
    assert np.max(np.hypot(*(place - xy).T)) < 3.0
    assert np.all((sigma > 2.0) & (sigma < 6.0))
    assert walker.smooth_track(given).n_outliers == 0


def test_nothing_is_known_hours_away_and_numbers_stay_finite():
    t_s = np.array([0.0, 1.0, 2.0, 90_000.0, 90_001.0])
    place, sigma = at(walker.smooth_track(track(t_s, np.zeros((5, 2)))), [1.0, 40_000.0, 90_000.0])
    assert np.all(np.isfinite(place))
    assert sigma[1] > 1000.0
    assert max(sigma[0], sigma[2]) < 5.0


def test_time_grows_with_the_fixes_and_no_faster():
    rng = np.random.default_rng(8)
    place_m = np.cumsum(rng.normal(size=(80_000, 2)), axis=0)

    def smoothed(count: int) -> None:
        given = track(np.arange(float(count)), place_m[:count])
        walker.smooth_track(given).at(given.t_ns)

    smoothed(9)  # compiles
    assert cost_growth(smoothed, 10_000, 80_000) < 4.0


# --- joined to the run ---


def test_velocities_come_from_speed_and_course_on_the_grid():
    fixes = np.zeros(4, DTYPES["fixes"])
    fixes["seq"] = [3, 7, 8, 12]
    fixes["lat_deg"], fixes["lon_deg"] = 52.0, 17.5  # 2.5 deg east of the middle of zone 33
    fixes["speed_mps"] = [2.0, 0.1, np.nan, 2.0]
    fixes["course_deg"] = [0.0, np.nan, 90.0, np.nan]
    given = replace(track(np.arange(3.0), np.zeros((3, 2))), seq=np.array([3, 7, 8]))
    found = walker.velocities(fixes, given)
    utm = Utm(33)
    north = np.subtract(utm.to_xy(52.001, 17.5), utm.to_xy(52.0, 17.5))
    np.testing.assert_allclose(
        [found.east_mps[0], found.north_mps[0]], 2.0 * north / np.hypot(*north), atol=1e-4
    )
    assert (found.east_mps[1], found.north_mps[1]) == (0.0, 0.0)
    assert 0.3 < found.sigma_mps[1] < 0.35
    assert np.isinf(found.sigma_mps[2])


def test_readings_are_placed_on_the_smoothed_walk():
    rng = np.random.default_rng(9)
    t_s, xy = streets(rng, 120)
    smoothed = walker.smooth_track(track(t_s, xy))
    t_ns = smoothed.track.t_ns[10:20] + 400_000_000
    obs = CellObservations("c", None, Utm(33), t_ns, *np.zeros((4, 10)), np.arange(10))
    placed = walker.relocate(obs, smoothed)
    found = smoothed.at(t_ns)
    np.testing.assert_array_equal(placed.x_m, found.x_m)
    np.testing.assert_array_equal(placed.position_sigma_m, found.sigma_m)
    np.testing.assert_allclose(found.covariance_m2[:, 0, 0], found.sigma_m**2)
    assert np.all(found.covariance_m2[:, 0, 1] == 0.0)
    assert placed.level_dbm is obs.level_dbm
