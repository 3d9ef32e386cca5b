import numpy as np
import pytest

from logger.core.schema import UNKNOWN_TIME
from logger.core.timebase import fit, utc_text

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
    t_ns, utc_ns = _pairs(7200, drift=40e-6)
    timebase = fit(t_ns, utc_ns)
    assert timebase.drift == pytest.approx(40e-6, rel=0.1)
    assert timebase.utc_ns(int(t_ns[-1])) == pytest.approx(int(utc_ns[-1]), abs=0.3e9)


@pytest.mark.parametrize("jump_s", [3600, -3600, -1024 * 7 * 86400, 1])
def test_jumps_and_rollovers_are_outvoted(jump_s):
    t_ns, utc_ns = _pairs(100)
    utc_ns = utc_ns.copy()
    utc_ns[:30] += jump_s * 10**9
    timebase = fit(t_ns, utc_ns)
    assert timebase.utc_ns(int(t_ns[99])) == pytest.approx(int(utc_ns[99]), abs=1.1e9)
    assert timebase.n_rejected == (30 if abs(jump_s) > 1 else 0)


def test_pairs_that_do_not_agree_mean_unknown():
    rng = np.random.default_rng(1)
    t_ns = np.arange(50) * 10**9
    assert fit(t_ns, UTC0 + rng.integers(0, 10**15, 50)) is None


def test_arrays_and_single_times_agree():
    t_ns, utc_ns = _pairs(7200, drift=40e-6)
    timebase = fit(t_ns, utc_ns)
    assert timebase.utc_ns_array(t_ns[::100]).tolist() == [timebase.utc_ns(t) for t in t_ns[::100].tolist()]


def test_text():
    assert utc_text(1_581_041_657 * 10**9) == "2020-02-07T02:14:17Z"
    assert utc_text(1_581_041_657 * 10**9, compact=True) == "20200207T021417Z"
