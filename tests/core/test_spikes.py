from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logger.core.places import Places
from logger.core.readings import limits
from logger.core.spikes import SpikeFilter, spikes_along


class Level(NamedTuple):
    k: int
    x_m: float
    y_m: float
    level_dbm: float
    limit: int


def take(spikes, row):
    return spikes.take(row, Places.of(row.x_m, row.y_m), row.level_dbm, row.limit)


def walk(rng, n=400, *, gap_m=1.4, away_m=60.0, noise_db=3.0, eta=3.0):
    """East past a transmitter `away_m` beside the middle of the way: positions and levels."""
    x_m = (np.arange(n) - 0.5 * n + rng.uniform(-0.5, 0.5)) * gap_m
    distance_m = np.hypot(x_m, away_m)
    return (
        x_m,
        np.zeros(n),
        -30.0 - 10.0 * eta * np.log10(distance_m) + noise_db * rng.normal(size=n),
    )


def spikes_of(x_m, y_m, level_dbm, rat=None):
    """Numbers of the spikes, reading by reading as on the device, the end of the walk included."""
    spikes = SpikeFilter()
    columns = (x_m, y_m, level_dbm, limits(level_dbm, rat))
    rows = [
        Level(k, *row) for k, row in enumerate(zip(*(c.tolist() for c in columns), strict=True))
    ]
    passed = [one for row in rows for one in take(spikes, row)] + spikes.finish()
    assert [row for row, _ in passed] == rows  # each once, in its order
    return [row.k for row, spike_db in passed if spike_db]


@pytest.mark.parametrize("spike_db", [30.0, -30.0])
@pytest.mark.parametrize("at", [[0], [1], [57], [200], [398], [399], [30, 33], [7, 100, 250, 311]])
def test_gross_errors_are_found_and_nothing_else(at, spike_db):
    assert found_of(at, spike_db) >= 0.9


@pytest.mark.parametrize("spike_db", [36.0, -36.0])
@pytest.mark.parametrize("at", [[200, 201], [398, 399]])
def test_two_in_a_row_have_to_be_farther_out(at, spike_db):
    assert found_of(at, spike_db) >= 0.9


def found_of(at, spike_db, walks=40):
    """Share of gross errors that are found; nothing else may be."""
    found = 0
    for seed in range(walks):
        x_m, y_m, level_dbm = walk(np.random.default_rng(seed))
        level_dbm[at] += spike_db
        spikes = spikes_of(x_m, y_m, level_dbm)
        assert set(spikes) <= set(at)
        found += len(spikes)
    return found / len(at) / walks


@pytest.mark.parametrize("gap_m", [1.4, 5.0, 15.0, 30.0])
def test_the_peak_beside_a_transmitter_is_no_spike(gap_m):
    lost = 0
    for seed in range(50):
        x_m, y_m, level_dbm = walk(np.random.default_rng(seed), 60, gap_m=gap_m, away_m=7.0)
        lost += int(np.argmin(np.abs(x_m))) in spikes_of(x_m, y_m, level_dbm)
    assert lost == 0


@pytest.mark.parametrize(("noise_db", "gap_m"), [(3.0, 1.4), (5.4, 5.0), (6.0, 15.0), (8.0, 40.0)])
def test_honest_noise_stays(noise_db, gap_m):
    wrong = sum(
        len(
            spikes_of(
                *walk(np.random.default_rng(seed), gap_m=gap_m, noise_db=noise_db, away_m=200.0)
            )
        )
        for seed in range(25)
    )
    assert wrong <= 5  # of 10 000


@pytest.mark.parametrize("gap_m", [15.0, 30.0])
def test_of_readings_far_apart_most_gross_errors_are_found(gap_m):
    found = 0
    for seed in range(50):
        rng = np.random.default_rng(seed)
        x_m, y_m, level_dbm = walk(rng, 200, gap_m=gap_m, away_m=300.0, noise_db=4.0)
        at = int(rng.integers(200))
        level_dbm[at] += 30.0
        found += at in spikes_of(x_m, y_m, level_dbm)
    assert found >= 40


def test_a_step_that_lasts_is_no_spike():
    x_m, y_m, level_dbm = walk(np.random.default_rng(1))
    level_dbm[200:] += 25.0
    assert spikes_of(x_m, y_m, level_dbm) == []


def test_the_floor_of_the_scale_is_a_neighbour_like_any_other():
    x_m, y_m, level_dbm = walk(np.random.default_rng(2), away_m=300.0)
    level_dbm = np.maximum(np.round(level_dbm), -105.0) - 5.0
    level_dbm[[100, 300]] = [-75.0, -78.0]
    assert spikes_of(x_m, y_m, level_dbm, "GSM") == [100, 300]
    level_dbm[[100, 300]] = [-110.0, -110.0]
    assert spikes_of(x_m, y_m, level_dbm, "GSM") == []


def test_readings_too_far_away_or_too_few_say_nothing():
    level_dbm = np.array([-90.0, -90.0, -40.0, -90.0, -90.0])
    assert spikes_of(1000.0 * np.arange(5.0), np.zeros(5), level_dbm) == []
    assert spikes_of(np.arange(5.0), np.zeros(5), level_dbm) == [2]
    assert spikes_of(np.arange(3.0), np.zeros(3), level_dbm[1:4]) == []


def test_a_spike_waits_for_two_more_and_others_wait_behind_it():
    spikes = SpikeFilter()
    rows = [Level(k, float(k), 0.0, -80.0, 0) for k in range(20)]
    for row in rows[:10]:
        take(spikes, row)
    assert take(spikes, rows[10]._replace(level_dbm=-50.0)) == []
    assert take(spikes, rows[11]) == []
    passed = take(spikes, rows[12])
    assert [(row.k, spike_db) for row, spike_db in passed] == [(10, 30.0), (11, 0.0), (12, 0.0)]
    assert [row.k for row, _ in take(spikes, rows[13])] == [13]


@settings(max_examples=200, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(0, 600),
    gap_m=st.sampled_from([0.0, 0.5, 2.0, 15.0, 40.0, 90.0]),
    noise_db=st.sampled_from([0.0, 2.0, 5.0, 9.0]),
    share=st.sampled_from([0.0, 0.003, 0.01, 0.1, 0.4]),
)
def test_arrays_give_what_single_readings_give(seed, n, gap_m, noise_db, share):
    rng = np.random.default_rng(seed)
    x_m, y_m = (np.cumsum(gap_m * rng.normal(size=n)) for _ in range(2))
    level_dbm = (
        -80.0
        + noise_db * rng.normal(size=n)
        + 30.0 * rng.choice([-1, 0, 1], n, p=[share / 2, 1 - share, share / 2])
    )
    level_dbm = np.clip(np.round(level_dbm), -110.0, -47.0)
    along = spikes_along(Places.of(x_m, y_m), level_dbm, limits(level_dbm, "GSM"))
    assert [k for k, _ in along] == spikes_of(x_m, y_m, level_dbm, "GSM")
