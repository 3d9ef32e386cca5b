"""Levels from a cache count once; honest ones that happen to be equal all count."""

from dataclasses import replace

import numpy as np
import pytest

from logger.core.places import Places
from logger.core.repeated_levels import CacheTest, repeats_along
from tests.kit.walks import observations


def levels_of(rng, n, *, step_m, noise_db, quantum_db=1.0):
    """Levels of a walk past a transmitter, as a modem reports them."""
    x_m = (np.arange(n) - 0.5 * n) * step_m
    level_dbm = -40.0 - 28.0 * np.log10(np.hypot(x_m, 40.0)) + noise_db * rng.normal(size=n)
    return x_m, quantum_db * np.round(level_dbm / quantum_db)


def repeats(x_m, level_dbm, *, y_m=None, limit=None, sigma_m=4.0):
    none = np.zeros(len(x_m))
    places = Places.of(x_m, none if y_m is None else y_m, sigma_m=np.full(len(x_m), sigma_m))
    limit = none.astype(np.int64) if limit is None else limit
    return repeats_along(places, np.asarray(level_dbm, float), limit)


@pytest.mark.parametrize("step_m", [11.0, 36.0])
@pytest.mark.parametrize("first", [[], [-103, -100, -98, -97, -104]])
def test_a_report_that_stands_still_counts_once(first, step_m):
    """A screen that is off: 73 of 79 readings are the same one."""
    level_dbm = [*first, *[-112.0] * 74]
    expected = list(range(len(first) + 1, len(level_dbm)))
    assert repeats(step_m * np.arange(len(level_dbm)), level_dbm) == expected


@pytest.mark.parametrize("held", [2, 3, 5])
@pytest.mark.parametrize("seed", range(5))
def test_reports_that_are_repeated_a_few_times_count_once(seed, held):
    """A log every five seconds, of a telephone that measures less often."""
    x_m, level_dbm = levels_of(np.random.default_rng(seed), 200, step_m=30.0, noise_db=5.0)
    at = np.arange(200)
    again = repeats(x_m, level_dbm[at - at % held])
    assert np.mean(np.isin(at[at % held > 0], again)) > 0.75
    fresh = np.isin(at[at % held == 0], again)
    assert np.mean(fresh) < 0.2  # those that are equal by chance


@pytest.mark.parametrize(
    ("quantum_db", "noise_db"), [(0.1, 1.0), (1.0, 1.0), (1.0, 3.0), (1.0, 6.0), (2.0, 3.0)]
)
@pytest.mark.parametrize("step_m", [1.4, 12.0, 40.0])
def test_honest_levels_all_count(step_m, noise_db, quantum_db):
    """Also of modems that count in steps of 2 dB, and where a third of the levels are equal."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        walk = levels_of(rng, 600, step_m=step_m, noise_db=noise_db, quantum_db=quantum_db)
        assert repeats(*walk) == []


@pytest.mark.parametrize("step_m", [1.4, 9.9999, 10.0, 25.0])
@pytest.mark.parametrize("n_held", range(14, 22))
def test_what_cannot_be_cached_is_told_without_looking_at_each_reading(n_held, step_m):
    """The device, which looks at each, becomes sure with as many equal levels."""
    per_step = max(round(10.0 / step_m), 1)
    level_dbm = np.repeat([-80.0, *[-90.0] * n_held, -70.0], per_step)
    x_m = step_m * np.arange(len(level_dbm))
    test, was_sure = CacheTest(), False
    for x, dbm in zip(x_m, level_dbm, strict=True):
        test.take(Places.of(x, 0.0, sigma_m=np.full(1, 4.0)), float(dbm), 0)
        was_sure |= test.is_cached
    assert bool(repeats(x_m, level_dbm)) == was_sure


def test_levels_at_rest_all_count():
    """The receiver's error wanders by some metres, and the level is what it is."""
    rng = np.random.default_rng(3)
    wander_m = np.cumsum(rng.normal(0.0, 0.3, (2, 3600)), axis=1)
    wander_m = 6.0 * wander_m / np.max(np.abs(wander_m))
    assert repeats(wander_m[0], np.full(3600, -80.0), y_m=wander_m[1]) == []


def test_after_a_cache_honest_levels_count_again():
    rng = np.random.default_rng(4)
    x_m, level_dbm = levels_of(rng, 400, step_m=12.0, noise_db=3.0)
    level_dbm[100:180] = level_dbm[100]
    again = np.array(repeats(x_m, level_dbm))
    assert set(range(101, 180)) <= set(again.tolist())
    assert np.count_nonzero(again < 100) <= 2
    assert np.count_nonzero(again >= 180) <= 4


def test_the_device_drops_what_the_desktop_drops_once_it_is_sure():
    x_m, level_dbm = levels_of(np.random.default_rng(5), 300, step_m=12.0, noise_db=3.0)
    level_dbm[80:] = level_dbm[80 + (np.arange(220) // 40) * 40]
    test = CacheTest()
    places = Places.of(x_m, np.zeros(300), sigma_m=np.full(300, 4.0))
    dropped = [k for k in range(300) if test.take(places[k], level_dbm[k], 0) and test.is_cached]
    desktop = repeats(x_m, level_dbm)
    assert set(dropped) <= set(desktop)
    assert set(desktop) - set(dropped) <= set(range(100))
    assert len(dropped) > 150


# --- the readings of a cell ---


def test_a_pile_of_repeats_is_no_limit_of_the_scale():
    _, level_dbm = levels_of(np.random.default_rng(6), 30, step_m=11.0, noise_db=3.0)
    level_dbm = np.append(level_dbm, [np.min(level_dbm) - 4.0] * 60)
    obs = observations(11.0 * np.arange(90), np.zeros(90), level_dbm, 4.0)
    obs = replace(obs, rat="LTE")
    assert np.count_nonzero(obs.limit) == 60
    assert set(range(31, 90)) <= set(obs.repeats)
    usable = obs.usable()
    assert len(usable) <= 31
    assert not np.any(usable.limit)
    assert usable.repeats == []


def test_the_floor_of_the_scale_is_reported_again_and_again_by_right():
    """RXLEV 0 of GSM, and a floor of another scale to which levels come back."""
    rng = np.random.default_rng(7)
    x_m, level_dbm = levels_of(rng, 400, step_m=14.0, noise_db=4.0)
    fading_dbm = np.round(-114.0 + 5.0 * rng.normal(size=400))
    for rat, true_dbm, floor_dbm in (("GSM", level_dbm, -110.0), ("LTE", fading_dbm, -118.0)):
        obs = observations(x_m, 0.0 * x_m, np.maximum(true_dbm, floor_dbm), 4.0)
        obs = replace(obs, rat=rat)
        assert np.count_nonzero(obs.limit) > 80
        assert obs.repeats == []


def test_each_modem_repeats_its_own_levels():
    """Two modems on one walk: the readings of one stand between the repeats of the other."""
    x_m, level_dbm = levels_of(np.random.default_rng(8), 200, step_m=8.0, noise_db=4.0)
    modem = np.arange(200) % 2
    level_dbm[modem == 1] = -97.0
    obs = replace(observations(x_m, 0.0 * x_m, level_dbm, 2.0), modem=modem)
    assert obs.repeats == np.flatnonzero(modem == 1)[1:].tolist()
    assert len(obs.usable()) == 101
