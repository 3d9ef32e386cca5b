import itertools
from dataclasses import replace

import numpy as np
import pytest

from logger.core import walker, walker_kalman
from logger.core.places import Places, Utm
from logger.core.readings import Readings
from logger.core.rows import DTYPES
from tests.kit.scaling import check_growth
from tests.kit.walker_tracks import at, streets, track, wander


def test_positions_are_continuous_through_fixes_and_gaps():
    rng = np.random.default_rng(2)
    t_s, xy = streets(rng, 200)
    keep = (t_s < 80) | (t_s > 120)
    smooth_fixes = walker.smooth_track(
        track(t_s[keep], xy[keep] + rng.normal(size=(keep.sum(), 2)))
    )
    fine = np.arange(-5.0, 205.0, 0.01)
    place, sigma = at(smooth_fixes, fine)
    assert np.max(np.hypot(*np.diff(place, axis=0).T)) < 0.05
    assert np.max(np.abs(np.diff(sigma)[(fine[1:] > 0.0) & (fine[1:] < 199.0)])) < 0.05


# --- consistency ---


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
        smooth_fixes = walker.smooth_track(track(t_s, xy + error), given if with_velocity else None)
        place, sigma = at(smooth_fixes, t_s)
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
def test_hours_at_one_point_are_not_centimetres(with_velocity):
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
    assert gap_s > 30 or np.median(middle) < 20.0


@pytest.mark.parametrize("gap_s", [600.0, 3600.0, 90_000.0])
def test_sigma_is_true_around_the_fix_that_ends_hours_without_one(gap_s):
    """A reading taken just before the first fix after a rest, as on a drive and the way back."""
    chi2, inside = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t_s, xy = streets(rng, 240)
        t_s = t_s + np.where(t_s >= 120.0, gap_s, 0.0)
        fixes = xy + 2.0 * rng.normal(size=xy.shape) + wander(rng, t_s, 3.0, 60.0)
        smooth_fixes = walker.smooth_track(track(t_s, fixes))
        ahead_s = np.array([0.5, 0.1, 0.01, 0.0])
        place, sigma = at(smooth_fixes, t_s[120] - ahead_s)
        assert np.max(np.abs(np.diff(sigma))) < 0.5
        off_m = np.hypot(*(place - xy[120]).T)
        chi2.append(off_m**2 / sigma**2)
        inside.append(off_m < 2.448 * sigma)
    assert 0.3 < np.mean(chi2) / 2.0 < 1.4
    assert np.mean(inside) > 0.9


def test_a_jump_of_one_fix_is_counted_and_hardly_moves_the_walk():
    rng = np.random.default_rng(4)
    t_s, xy = streets(rng, 300)
    fixes = xy + wander(rng, t_s, 3.0, 60.0)
    jumps = [0, 50, 120, 121, 200, 299]
    fixes[jumps] += [150.0, -130.0]
    smooth_fixes = walker.smooth_track(track(t_s, fixes))
    place, sigma = at(smooth_fixes, t_s)
    assert np.flatnonzero(smooth_fixes.outlier).tolist() == jumps
    assert smooth_fixes.n_outliers == 6
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


def test_a_car_is_distinguished_from_a_walker():
    rng = np.random.default_rng(6)
    t_s = np.arange(600.0)
    speed = 14.0 + 6.0 * np.sin(t_s / 15.0)
    car = np.cumsum(
        np.column_stack([speed * np.cos(t_s / 40.0), speed * np.sin(t_s / 40.0)]), axis=0
    )
    on_foot = streets(rng, 600)[1]
    result = [
        walker.smooth_track(track(t_s, xy + rng.normal(size=xy.shape))).accel_m2s3
        for xy in (on_foot, car)
    ]
    assert result[0] < 0.2 <= result[1]


# --- unusual tracks ---


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
    place_m = np.cumsum(rng.normal(size=(16_000, 2)), axis=0)

    def smooth_fixes(count: int) -> None:
        given = track(np.arange(float(count)), place_m[:count])
        walker.smooth_track(given).at(given.t_ns)

    smooth_fixes(9)  # compiles
    check_growth(smooth_fixes, 2_000, 16_000)


# --- with the run ---


def test_velocities_come_from_speed_and_course_on_the_grid():
    fixes = np.zeros(4, DTYPES["fixes"])
    fixes["seq"] = [3, 7, 8, 12]
    fixes["lat_deg"], fixes["lon_deg"] = 52.0, 17.5  # 2.5 deg east of the middle of zone 33
    fixes["speed_mps"] = [2.0, 0.1, np.nan, 2.0]
    fixes["course_deg"] = [0.0, np.nan, 90.0, np.nan]
    utm = Utm(33)
    given = replace(track(np.arange(3.0), np.zeros((3, 2))), seq=np.array([3, 7, 8]))
    x_m, y_m = (np.full(3, value) for value in utm.to_xy(52.0, 17.5))
    result = walker.velocities(fixes, replace(given, x_m=x_m, y_m=y_m))
    north = np.subtract(utm.to_xy(52.001, 17.5), utm.to_xy(52.0, 17.5))
    np.testing.assert_allclose(
        [result.east_mps[0], result.north_mps[0]], 2.0 * north / np.hypot(*north), atol=1e-4
    )
    assert (result.east_mps[1], result.north_mps[1]) == (0.0, 0.0)
    assert 0.3 < result.sigma_mps[1] < 0.35
    assert np.isinf(result.sigma_mps[2])


def test_the_likeliest_pair_is_found_with_half_the_scores_of_all_candidates():
    """Each score is a filter over the complete walk."""
    for q, share in itertools.product(walker.ACCELERATIONS_M2S3, walker.WHITE_SHARES):
        scored = []

        def likelihood(at_q, at_share, best=(q, share), scored=scored):
            scored.append((at_q, at_share))
            return -(np.log(at_q / best[0]) ** 2) - np.log(at_share / best[1]) ** 2

        assert walker._likeliest(likelihood) == (q, share)
        assert len(scored) == len(set(scored)) <= 12


def test_without_an_outlier_the_fixes_are_smoothed_twice(monkeypatch):
    """The weights do not change then: further turns would repeat the second."""
    smoothed = []

    def smooth(*given):
        smoothed.append(given)
        return walker_kalman.smooth(*given)

    monkeypatch.setattr(walker, "smooth", smooth)
    t_s = np.arange(60.0)
    found = walker.smooth_track(track(t_s, np.column_stack([1.4 * t_s, 0.0 * t_s])))
    assert found.n_outliers == 0
    assert len(smoothed) <= 2


def test_stretches_of_a_long_run_tell_its_motion_as_all_of_it_does(monkeypatch):
    rng = np.random.default_rng(8)
    t_s, xy = streets(rng, 8000)
    fixes = track(t_s, xy + wander(rng, t_s, 3.0, 60.0) + 1.5 * rng.normal(size=xy.shape))
    stretched = walker.smooth_track(fixes)
    monkeypatch.setattr(walker, "_STRETCHES", len(t_s))
    complete = walker.smooth_track(fixes)
    assert stretched.accel_m2s3 == complete.accel_m2s3
    assert stretched.white_share == complete.white_share


# --- while the walk goes on ---


def _live(fixes):
    live = walker.LiveTrack()
    for k in range(len(fixes)):
        live.add(fixes[k])
    return live


def _readings(t_ns):
    places = Places.of(np.zeros(len(t_ns)), np.zeros(len(t_ns)), t_ns=t_ns, utm=Utm(33))
    return Readings("a", "GSM", places, np.full(len(t_ns), -70.0), np.arange(len(t_ns)))


def _noisy_streets(seconds, seed=3):
    rng = np.random.default_rng(seed)
    t_s, xy = streets(rng, seconds)
    return track(t_s, xy + wander(rng, t_s, 2.0, 60.0) + rng.normal(size=xy.shape))


def test_readings_on_the_way_are_placed_as_after_the_walk():
    fixes = _noisy_streets(300)
    readings = _readings(np.sort(np.random.default_rng(0).choice(fixes.t_ns, 100)) + 4 * 10**8)
    places = _live(fixes).place(readings).places
    after = walker.places_during(
        walker.smooth_track(fixes).at, readings.t_ns, readings.t_ns, readings.t_ns
    )
    for name in ("x_m", "y_m", "sigma_m"):
        np.testing.assert_allclose(getattr(places, name), getattr(after, name), atol=1e-6)


def test_places_of_a_long_walk_settle_where_the_complete_walk_has_them(monkeypatch):
    fixes = _noisy_streets(6000)
    sizes = []
    smooth = walker.smooth_track
    live = walker.LiveTrack()
    monkeypatch.setattr(
        walker, "smooth_track", lambda t, *a, **k: sizes.append(len(t)) or smooth(t, *a, **k)
    )
    for k in range(len(fixes)):
        live.add(fixes[k])
        if k % 500 == 0:
            live.place(_readings(fixes.t_ns[: k + 1]))
    places = live.place(_readings(fixes.t_ns)).places
    after = smooth(fixes).at(fixes.t_ns)
    apart_m = np.hypot(places.x_m - after.x_m, places.y_m - after.y_m)
    raw_m = np.hypot(fixes.x_m - after.x_m, fixes.y_m - after.y_m)
    print(
        f"apart {np.median(apart_m):.3f}, at most {np.max(apart_m):.2f}; raw {np.median(raw_m):.2f}"
    )
    assert max(sizes) == 2000
    assert np.median(apart_m) < 0.1 * np.median(raw_m)
    assert np.max(apart_m) < 2.0


def test_the_way_walked_in_a_long_scan_adds_to_the_sigma_of_its_place():
    t_s = np.arange(200.0)
    fixes = track(t_s, np.column_stack([1.4 * t_s, np.zeros(200)]), 1.0)
    live, middle_ns = _live(fixes), fixes.t_ns[[100]]
    (before_m,) = live.place(_readings(middle_ns)).places.sigma_m
    live.add_scan(fixes.t_ns[80].item(), fixes.t_ns[120].item())
    (sigma_m,) = live.place(_readings(middle_ns)).places.sigma_m
    assert sigma_m**2 - before_m**2 == pytest.approx((40.0 * 1.4) ** 2 / 12.0, rel=0.05)


def test_without_times_places_stay_as_they_are():
    fixes = _noisy_streets(60)
    live = _live(replace(fixes, t_ns=np.zeros(60, np.int64)))
    readings = _readings(np.zeros(20, np.int64))
    assert live.place(readings) is readings


def test_a_fix_that_comes_a_moment_late_is_left_out_and_others_are_smoothed():
    fixes = _noisy_streets(60)
    live = _live(fixes)
    live.add(replace(fixes[-1], t_ns=fixes.t_ns[-1:] - 10**7, x_m=fixes.x_m[-1:] + 50.0))
    readings = _readings(fixes.t_ns[20:40])
    after = _live(fixes).place(readings).places
    np.testing.assert_array_equal(live.place(readings).places.x_m, after.x_m)
    assert np.any(after.x_m != fixes.x_m[20:40])


def test_where_times_go_back_places_stay_as_they_are():
    fixes = _noisy_streets(60)
    live = _live(fixes)
    live.add(replace(fixes[-1], t_ns=np.zeros(1, np.int64)))
    readings = _readings(fixes.t_ns[20:40])
    assert live.place(readings) is readings
