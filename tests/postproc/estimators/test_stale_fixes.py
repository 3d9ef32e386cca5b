import numpy as np
import pytest

from logger.core.geo import Utm
from logger.core.track import Track
from postproc.estimators import stale_fixes, track_plausibility, walker


def track(t_s, x_m, y_m=None, sigma_m=7.0):
    x_m = np.asarray(x_m, float)
    y_m = np.zeros(len(x_m)) if y_m is None else y_m
    t_ns = np.round(np.asarray(t_s, float) * 1e9).astype(np.int64)
    return Track(Utm(32), t_ns, np.arange(len(x_m)), x_m, y_m, np.full(len(x_m), sigma_m))


def test_repeated_positions_shortly_before_a_jump_are_stale():
    """100 m in jumps every 8 s, and each position repeated every second."""
    t_s = np.arange(80)
    fixes = track(t_s, 100.0 * (t_s // 8))
    result = stale_fixes.without_stale(fixes)
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
    retained = stale_fixes.without_stale(fixes)
    assert len(retained.t_ns) > 700
    assert not np.any((retained.t_ns > 3441 * 10**9) & (retained.t_ns < 3500 * 10**9))


def test_a_receiver_that_writes_few_digits_loses_no_fix():
    t_s = np.arange(200)
    fixes = track(
        t_s, np.round(0.3 * t_s)
    )  # each place reason three times, but no step is longer than the errors
    assert len(stale_fixes.without_stale(fixes).t_ns) == 200


@pytest.mark.parametrize("n", [1, 2, 3])
def test_short_tracks(n):
    assert len(stale_fixes.without_stale(track(range(n), [100.0 * i for i in range(n)])).t_ns) == n


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


def test_two_errors_of_a_receiver_do_not_blame_the_times():
    x_m = np.arange(12) * 1.4
    x_m[[3, 9]] += 900.0
    assert track_plausibility.too_fast(track(range(12), x_m)) is None
    assert track_plausibility.too_many_apart([walker.smooth_track(track(range(12), x_m))]) is None


def test_what_is_moved_is_counted():
    x_m = np.arange(60) * 1.4
    x_m[30] += 60.0
    walked = walker.smooth_track(track(range(60), x_m))
    assert walked.outlier[30]
    assert track_plausibility.moved_m(walked)[30] == pytest.approx(60.0, abs=5.0)
    assert not np.any(track_plausibility.moved_too_far(walked))
