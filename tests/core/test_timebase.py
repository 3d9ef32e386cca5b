import numpy as np
import pytest

from logger.core.runfile.meta import SIMULATED
from logger.core.timebase import fit, fit_run, why_unknown
from logger.core.types import UNKNOWN_TIME, utc_text

UTC0 = 1_790_000_000 * 10**9


def _pairs(n, drift=0.0, seed=0):
    rng = np.random.default_rng(seed)
    t_ns = 50 * 10**9 + np.arange(n) * 10**9
    utc_ns = UTC0 + np.arange(n) * 10**9 + np.round(drift * np.arange(n) * 1e9).astype(np.int64)
    late_ns = rng.uniform(0.1e9, 0.3e9, n).astype(np.int64)
    return t_ns + late_ns, utc_ns


def test_no_pair_means_unknown():
    assert fit(np.array([1, 2]), np.array([UNKNOWN_TIME, UNKNOWN_TIME])) is None
    assert fit(np.empty(0, np.int64), np.empty(0, np.int64)) is None


def test_offset_within_the_jitter_of_the_line():
    timebase = fit(*_pairs(200))
    assert timebase.utc_ns(50 * 10**9) == pytest.approx(UTC0, abs=0.3e9)
    assert timebase.n_pairs == 200


def test_drift_of_a_crystal_over_a_long_walk():
    t_ns, utc_ns = _pairs(36_000, drift=40e-6)  # 1.4 s in all
    timebase = fit(t_ns, utc_ns)
    assert timebase.drift == pytest.approx(40e-6, rel=0.1)
    assert timebase.utc_ns(int(t_ns[-1])) == pytest.approx(int(utc_ns[-1]), abs=0.3e9)


def test_pairs_that_do_not_agree_mean_unknown():
    rng = np.random.default_rng(1)
    t_ns = np.arange(50) * 10**9
    assert fit(t_ns, UTC0 + rng.integers(0, 10**15, 50)) is None


def test_arrays_and_single_times_agree():
    t_ns, utc_ns = _pairs(7200, drift=40e-6)
    timebase = fit(t_ns, utc_ns)
    assert timebase.utc_ns_array(t_ns[::100]).tolist() == [
        timebase.utc_ns(t) for t in t_ns[::100].tolist()
    ]


def test_text():
    assert utc_text(1_581_041_657 * 10**9) == "2020-02-07T02:14:17Z"
    assert utc_text(1_581_041_657 * 10**9, compact=True) == "20200207T021417Z"


WALK_S = 1800


def _walk(seed=0, rate_hz=1):
    """Half an hour: arrays of time since boot, true UTC, position or not; sentences come 0.05 to
    0.15 s late.
    """
    rng = np.random.default_rng(seed)
    n = WALK_S * rate_hz
    utc_ns = UTC0 + np.arange(n) * (10**9 // rate_hz)
    elapsed_ns = np.round((utc_ns - UTC0) * (1 - 20e-6)).astype(np.int64)
    return (
        33 * 10**9 + elapsed_ns,
        utc_ns,
        rng.uniform(0.05e9, 0.15e9, n).astype(np.int64),
        np.ones(n, np.uint8),
    )


def _error_s(timebase, t_ns, utc_ns):
    return float(np.max(np.abs(timebase.utc_ns_array(t_ns) - utc_ns)) / 1e9)


HOUR, DAY, YEAR, WEEKS_1024 = 3600.0, 86_400.0, 365.25 * 86_400.0, 1024 * 7 * 86_400.0


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "jump_s", [HOUR, -HOUR, YEAR, -YEAR, WEEKS_1024, -WEEKS_1024, 20 * YEAR, DAY, 1.0, -2.0, 18.0]
)
@pytest.mark.parametrize("where", ["start", "end", "middle", "always after", "always before"])
def test_a_receiver_that_jumps_is_outvoted_or_utc_is_unknown(seed, jump_s, where):
    t_ns, utc_ns, late_ns, valid = _walk(seed)
    n = len(t_ns)
    cut = int(np.random.default_rng(seed + 100).integers(n // 8, n))
    wrong = {
        "start": slice(0, 20),
        "end": slice(n - 20, n),
        "middle": slice(n // 2, n // 2 + 20),
        "always after": slice(cut, n),
        "always before": slice(0, cut),
    }[where]
    told_ns = utc_ns.copy()
    told_ns[wrong] += round(jump_s * 1e9)
    timebase = fit(t_ns + late_ns, told_ns, valid)
    if where in {"start", "end", "middle"}:
        assert timebase is not None
    if timebase is not None and not (where == "always after" and abs(jump_s) <= 20.0):
        assert _error_s(timebase, t_ns, utc_ns) < 0.2


def test_leap_seconds_received_late_are_corrected_backwards():
    t_ns, utc_ns, late_ns, valid = _walk()
    told_ns = utc_ns.copy()
    told_ns[:700] += 2 * 10**9
    assert _error_s(fit(t_ns + late_ns, told_ns, valid), t_ns, utc_ns) < 0.2


def _read_late(late_ns, scale_s=1.0):
    """Half of the sentences come late, as those of a simulation on a busy machine do."""
    rng = np.random.default_rng(3)
    is_late = rng.random(len(late_ns)) < 0.5
    delay_s = np.where(is_late, rng.exponential(scale_s, len(late_ns)), 0.0)
    return late_ns + np.round(delay_s * 1e9).astype(np.int64)


def test_sentences_that_a_busy_machine_reads_late_leave_the_date_right():
    t_ns, utc_ns, late_ns, valid = _walk()
    timebase = fit(t_ns + _read_late(late_ns, 2.0), utc_ns, valid)
    assert _error_s(timebase, t_ns, utc_ns) < 0.3
    later_ns = t_ns + _read_late(late_ns, 30.0)
    assert fit(later_ns, utc_ns, valid) is None
    assert _error_s(fit(later_ns, utc_ns, valid, simulated=True), t_ns, utc_ns) < 0.5


def test_only_of_a_simulated_run_may_sentences_be_read_that_late():
    t_ns, utc_ns, late_ns, valid = _walk()
    fixes = {"t_ns": t_ns + _read_late(late_ns, 30.0), "utc_ns": utc_ns, "valid": valid}
    assert fit_run("walk", fixes) is None
    assert _error_s(fit_run(f"{SIMULATED}block", fixes), t_ns, utc_ns) < 0.5


@pytest.mark.parametrize(
    ("utc_ns", "valid", "why"),
    [
        (np.full(9, UNKNOWN_TIME), 1, "never reported"),
        (UTC0 + np.arange(9), 0, "never reported"),
        (np.arange(9), 1, "cannot be"),
        (UTC0 - np.arange(9) % 2 * 86_400 * 10**9, 1, "contradict each other"),
    ],
)
def test_why_a_time_is_unknown(utc_ns, valid, why):
    fixes = {"t_ns": np.arange(9), "utc_ns": utc_ns, "valid": np.full(9, valid)}
    assert fit_run("walk", fixes) is None
    assert why in why_unknown("walk", fixes)


@pytest.mark.parametrize("jump_s", [HOUR, -HOUR, 18.0, -2.0])
def test_a_receiver_that_jumps_is_not_taken_for_one_that_is_read_late(jump_s):
    t_ns, utc_ns, late_ns, valid = _walk()
    for wrong in (slice(0, 700), slice(len(t_ns) - 220, None), slice(None, None, 2)):
        told_ns = utc_ns.copy()
        told_ns[wrong] += round(jump_s * 1e9)
        timebase = fit(t_ns + _read_late(late_ns, 0.5), told_ns, valid)
        assert timebase is None or _error_s(timebase, t_ns, utc_ns) < 0.5


def test_a_leap_second_that_happens_leaves_utc_unknown():
    t_ns, utc_ns, late_ns, valid = _walk()
    midnight_ns = -(-UTC0 // (86_400 * 10**9)) * 86_400 * 10**9
    told_ns = utc_ns + (midnight_ns - UTC0 - 1000 * 10**9)
    told_ns[1000:] -= 10**9
    assert fit(t_ns + late_ns, told_ns, valid) is None


def test_a_fix_that_comes_an_hour_late():
    t_ns, utc_ns, late_ns, valid = _walk()
    late_ns[600] += 3600 * 10**9
    assert _error_s(fit(t_ns + late_ns, utc_ns, valid), t_ns, utc_ns) < 0.2
    # the first of all comes after an hour without one
    assert (
        _error_s(fit((t_ns + late_ns)[-60:], utc_ns[-60:], valid[-60:]), t_ns[-60:], utc_ns[-60:])
        < 0.2
    )


@pytest.mark.parametrize(
    "start_ns",
    [0, 315_964_800 * 10**9, UTC0 - int(WEEKS_1024) * 10**9, UTC0 + 20 * int(YEAR) * 10**9],
)
def test_a_clock_that_was_never_set_tells_nothing(start_ns):
    """1970, the first day of GPS, a rollover, the far future: all along, and until the first
    fix.
    """
    t_ns, utc_ns, late_ns, valid = _walk()
    unset_ns = utc_ns - UTC0 + start_ns
    assert fit(t_ns + late_ns, unset_ns, valid) is None
    told_ns = np.where(np.arange(len(t_ns)) < 1200, unset_ns, utc_ns)
    assert _error_s(fit(t_ns + late_ns, told_ns, valid), t_ns, utc_ns) < 0.2


def test_without_a_position_the_time_is_not_believed():
    t_ns, utc_ns, late_ns, valid = _walk()
    valid[:1200] = 0
    told_ns = utc_ns.copy()
    told_ns[:1200] += 3 * int(YEAR) * 10**9
    assert _error_s(fit(t_ns + late_ns, told_ns, valid), t_ns, utc_ns) < 0.2
    assert fit(t_ns, told_ns, np.zeros_like(valid)) is None


def test_order_and_rate_do_not_matter():
    t_ns, utc_ns, late_ns, valid = _walk(rate_hz=10)
    mixed = np.random.default_rng(1).permutation(len(t_ns))
    timebase = fit((t_ns + late_ns)[mixed], utc_ns[mixed], valid)
    assert _error_s(timebase, t_ns, utc_ns) < 0.1
    assert timebase.drift == pytest.approx(20e-6, abs=10e-6)


@pytest.mark.parametrize("seed", range(20))
def test_any_numbers_give_an_answer_or_none(seed):
    rng = np.random.default_rng(seed)
    t_ns, utc_ns = rng.integers(0, 2**62, (2, 300))
    utc_ns[rng.random(300) < 0.3] = UNKNOWN_TIME
    if seed % 2:
        utc_ns = UTC0 + utc_ns % 10**15
    fit(t_ns, utc_ns, rng.integers(0, 2, 300))


@pytest.mark.parametrize("year", [1975, 1999, 2017, 2060])
def test_a_file_of_another_program_may_be_of_any_year(year):
    """A receiver with such a time has a wrong week counter, or a clock that was never set."""
    t_ns = np.arange(20) * 10**9
    utc_ns = t_ns + (year - 1970) * 31_557_600 * 10**9
    assert fit(t_ns, utc_ns) is None
    assert fit(t_ns, utc_ns, any_year=True).utc_ns(0) == utc_ns[0]
