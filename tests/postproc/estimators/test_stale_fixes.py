import numpy as np
import pytest

from logger.core import walker
from logger.core.places import Track, Utm
from postproc.estimators import track_plausibility


def track(t_s, x_m, y_m=None, sigma_m=7.0):
    x_m = np.asarray(x_m, float)
    y_m = np.zeros(len(x_m)) if y_m is None else y_m
    t_ns = np.round(np.asarray(t_s, float) * 1e9).astype(np.int64)
    n = len(x_m)
    sigmas_m, nowhere = np.full(n, sigma_m), np.full(n, np.nan)
    return Track(x_m, y_m, nowhere, sigmas_m, t_ns, Utm(32), seq=np.arange(n))


def test_repeated_positions_shortly_before_a_jump_are_stale():
    """100 m in jumps every 8 s, and each position repeated every second."""
    t_s = np.arange(80)
    fixes = track(t_s, 100.0 * (t_s // 8))
    result = track_plausibility.without_stale(fixes)
    assert result.seq.tolist() == [
        *range(0, 72, 8),
        *range(72, 80),
    ]  # nothing tells when the last place was left
    before, after = (
        np.abs(walker.smooth_track(one).at(fixes.t_ns).x_m - 12.5 * t_s)[:72]
        for one in (fixes, result)
    )
    assert np.max(before) > 40.0
    assert np.max(after) < 20.0


def test_who_stands_for_an_hour_stands():
    t_s = np.arange(0, 3600, 5)
    fixes = track(t_s, np.where(t_s < 3500, 0.0, 30.0))
    retained = track_plausibility.without_stale(fixes)
    assert len(retained.t_ns) > 700
    assert not np.any((retained.t_ns > 3441 * 10**9) & (retained.t_ns < 3500 * 10**9))


def test_a_receiver_that_writes_few_digits_loses_no_fix():
    t_s = np.arange(200)
    fixes = track(
        t_s, np.round(0.3 * t_s)
    )  # each place reason three times, but no step is longer than the errors
    assert len(track_plausibility.without_stale(fixes).t_ns) == 200


@pytest.mark.parametrize("n", [1, 2, 3])
def test_short_tracks(n):
    moving = track(range(n), [100.0 * i for i in range(n)])
    assert len(track_plausibility.without_stale(moving).t_ns) == n


# --- plausible ---


@pytest.mark.parametrize(
    ("speed_mps", "reason"), [(1.4, None), (14.0, None), (55.0, None), (70.0, "252 km/h")]
)
def test_the_median_step_gives_the_speed(speed_mps, reason):
    result = track_plausibility.too_fast(
        track(np.arange(100) * 2.0, np.arange(100) * 2.0 * speed_mps)
    )
    assert (result is None) == (reason is None)
    assert reason is None or reason in result


def test_errors_of_fixes_are_no_speed():
    rng = np.random.default_rng(1)
    assert (
        track_plausibility.too_fast(track(np.arange(300) * 0.1, rng.normal(0.0, 7.0, 300))) is None
    )


def test_days_read_as_seconds_are_too_fast_although_each_step_is_short():
    """A spreadsheet's numbers of days: a walk of a kilometre took a hundredth of a second."""
    walked_s = np.arange(500) * 2.0
    walk = track(walked_s / 86_400.0, walked_s * 1.2)
    assert "the way as a whole would be faster than" in track_plausibility.too_fast(walk)
    assert track_plausibility.too_fast(track(walked_s, walked_s * 1.2)) is None


def test_two_errors_of_a_receiver_do_not_blame_the_times():
    x_m = np.arange(12) * 1.4
    x_m[[3, 9]] += 900.0
    assert track_plausibility.too_fast(track(range(12), x_m)) is None
    assert track_plausibility.too_many_apart(walker.smooth_track(track(range(12), x_m))) is None


def test_what_is_moved_is_counted():
    x_m = np.arange(60) * 1.4
    x_m[30] += 60.0
    walked = walker.smooth_track(track(range(60), x_m))
    assert walked.outlier[30]
    assert track_plausibility.moved_m(walked)[30] == pytest.approx(60.0, abs=5.0)
    assert not np.any(track_plausibility.moved_too_far(walked))


# --- positions as written ---


def test_a_stale_position_may_be_anywhere_on_the_way_to_the_next():
    """A car at 12 m/s, whose telephone has a new position every eight seconds."""
    t_s = np.arange(80)
    sigma_m = track_plausibility.written_sigma_m(track(t_s, 96.0 * (t_s // 8)))
    fresh, late = sigma_m[:72:8], sigma_m[:72][t_s[:72] % 8 > 0]
    assert np.allclose(fresh, 2.0 * 12.0)  # levels are late by two seconds
    assert np.allclose(late, np.hypot(2.0 * 12.0, 96.0 / np.sqrt(12.0)))
    at_rest = track_plausibility.written_sigma_m(track(t_s, np.where(t_s < 79, 0.0, 30.0)))
    assert at_rest[0] < 2.0


# --- clocks ---


def survey(n=400, leap_m=(), leaps=()):
    """Points about a metre apart along a street, as a survey lists them; it goes on elsewhere."""
    step_m = np.tile([1.0, 1.4, 1.0, 2.2, 1.0], n // 5)
    step_m[list(leaps)] += leap_m
    return np.cumsum(step_m)


@pytest.mark.parametrize("start_s", [0.0, 1.0, 1e9])
@pytest.mark.parametrize("pace_s", [0.001, 0.5, 1.0, 2.0])
def test_seconds_that_count_the_rows_are_recognised(pace_s, start_s):
    t_s = start_s + pace_s * np.arange(400)
    for x_m in (survey(leap_m=312.0, leaps=[200]), survey(leap_m=45.0, leaps=[50, 120, 300])):
        assert track_plausibility.why_no_clock(track(t_s, x_m)) == "they count the rows"
    some = np.delete(np.arange(400), [7, 90, 91, 250])  # bad rows are left out
    assert track_plausibility.why_no_clock(
        track(t_s[some], survey(leap_m=312.0, leaps=[200])[some])
    )


def test_rows_of_a_table_that_is_sorted_by_something_else_are_recognised():
    rng = np.random.default_rng(5)
    x_m, y_m = rng.uniform(0.0, 1500.0, (2, 300))
    assert track_plausibility.why_no_clock(track(np.arange(300), x_m, y_m)) is not None
    assert track_plausibility.why_no_clock(track(60 * np.arange(300), x_m, y_m)) is None


@pytest.mark.parametrize("held", [1, 3, 5])
@pytest.mark.parametrize("pace_s", [1, 2, 5, 10])
@pytest.mark.parametrize("fastest_mps", [1.5, 6.0, 15.0, 33.0])
def test_an_even_clock_of_a_walker_or_a_car_is_believed(pace_s, fastest_mps, held):
    """With stops, turns, errors of fixes and positions that a telephone holds."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        x_m, y_m = drive(rng, fastest_mps)[:, ::pace_s]
        at = np.arange(len(x_m))
        at -= at % held
        fixes = track(pace_s * np.arange(len(x_m)), x_m[at], y_m[at])
        assert track_plausibility.why_no_clock(fixes) is None


def drive(rng, fastest_mps, seconds=900):
    """Positions each second, shape (2, n): a vehicle that brakes, turns and waits."""
    speed_mps = aim_mps = heading = 0.0
    way = np.zeros((2, seconds))
    for i in range(1, seconds):
        if rng.random() < 0.1:
            aim_mps = fastest_mps * rng.choice([0.0, rng.uniform(0.3, 1.0)])
        if rng.random() < 0.05:
            heading += rng.choice([-0.5, 0.5]) * np.pi
        speed_mps += np.clip(aim_mps - speed_mps, -3.5, 3.0)
        way[:, i] = way[:, i - 1] + speed_mps * np.array([np.cos(heading), np.sin(heading)])
    return way + np.cumsum(rng.normal(0.0, 0.3, (2, seconds)), axis=1)


def test_times_that_were_computed_from_the_way_are_recognised():
    """Six metres a second and at least a second for a step, as somebody made them up."""
    rng = np.random.default_rng(6)
    step_m = rng.exponential(25.0, 120)
    t_s = np.cumsum(np.maximum(step_m / 6.0, 1.0))
    why = track_plausibility.why_no_clock(track(t_s, np.cumsum(step_m)))
    assert why == "they were computed from the way, at one speed"
    true_s = np.cumsum(np.maximum(step_m / rng.uniform(5.0, 7.0, 120), 1.0))
    assert track_plausibility.why_no_clock(track(true_s, np.cumsum(step_m))) is None


def test_a_vehicle_at_one_speed_may_have_a_clock():
    t_s = 2.0 * np.arange(200)
    assert track_plausibility.why_no_clock(track(t_s, 9.0 * t_s)) is None


@pytest.mark.parametrize("n", [1, 2, 30])
def test_a_receiver_that_never_moves_may_have_a_clock(n):
    assert track_plausibility.why_no_clock(track(np.arange(n), np.zeros(n))) is None
