"""No walk, however odd, ends in a traceback or in a place that nothing speaks for."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from logger.core.errors import EstimationError
from logger.core.locator.pipeline import locate
from logger.core.locator.quadtree import Effort
from logger.core.locator.verdict import assess
from tests.kit.scaling import check_growth
from tests.kit.walks import FLOOR_DBM, observations, path, simulate, with_places

QUICK = Effort(most_squares=400, split_share=0.02, nodes=3, first_share=1.0)
RNG = np.random.default_rng(27)


def answer(obs, effort=QUICK):
    """Posterior and verdict of a walk, None where it is refused as it should be; all numbers must
    be numbers.
    """
    try:
        found = locate(obs, effort=effort)
    except EstimationError:
        return None
    numbers = (
        found.x_m,
        found.y_m,
        found.r95_m,
        found.drms_m,
        found.p0_dbm,
        found.p0_sigma_db,
        found.eta,
    )
    numbers += (
        found.eta_sigma,
        found.sigma_db,
        found.limit_share,
        found.log_evidence,
        found.region_area_m2,
    )
    assert np.all(np.isfinite(numbers))
    assert found.modes
    assert found.squares.probability.sum() == pytest.approx(1.0, abs=1e-6)
    assert np.min(found.squares.probability) >= 0.0
    assert found.r95_m > 0.0
    return found, *assess(found, obs)[:2]


# --- property ---

places_m = st.one_of(
    st.sampled_from([0.0, 1.0, 100.0, 500_000.0]),
    st.floats(-3e3, 3e3, width=32),
    st.floats(-1e7, 1e7, width=32),
)
levels_dbm = st.one_of(
    st.sampled_from([FLOOR_DBM, -80.0, -79.0, -47.0]), st.floats(-150.0, 40.0, width=16)
)
readings = st.lists(st.tuples(places_m, places_m, levels_dbm), max_size=25)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(readings, st.sampled_from([0.0, 5.0, 300.0]), st.sampled_from(["GSM", "LTE", None]))
@example([], 0.0, "GSM")
@example([(5.0, 5.0, -70.0)], 0.0, "GSM")
@example([(0.0, 0.0, FLOOR_DBM), (9.0, 0.0, -47.0)], 5.0, "GSM")
def test_no_walk_ends_in_a_traceback(rows, position_sigma, rat):
    x, y, level = np.array(rows, float).reshape(-1, 3).T
    result = answer(replace(observations(x, y, level, position_sigma), rat=rat))
    if result is not None and result[1] == "located":
        assert len(rows) >= 8
        assert len({row[:2] for row in rows}) >= 3
        assert np.std(level) >= 1.0
        assert result[0].r95_m < np.hypot(np.ptp(x), np.ptp(y))


@pytest.mark.parametrize("name", ["x_m", "y_m", "level_dbm", "position_sigma_m"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_does_not_count(name, value):
    """Neither raises nor changes what the other readings say."""
    obs, _ = simulate(np.random.default_rng(1), "L", white_db=2.0, count=150, step=5.6)
    column = getattr(obs, name).copy()
    column[-20:] = value
    rest = answer(replace(obs.part(slice(-20)), known_limit=None))
    if name == "level_dbm":
        found = answer(replace(obs, level_dbm=column))
    else:
        found = answer(with_places(obs, **{name.removeprefix("position_"): column}))
    assert (found[0].x_m, found[0].y_m) == (rest[0].x_m, rest[0].y_m)
    assert found[1:] == rest[1:]


def test_nothing_but_what_is_no_number():
    with pytest.raises(EstimationError):
        locate(observations(np.arange(9.0), np.zeros(9), np.full(9, np.nan)))


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["straight", "L", "square", "random"]),
    st.floats(1.5, 12.0),
)
def test_levels_that_know_nothing_of_the_place_locate_nothing(seed, shape, noise_db):
    """Pure noise, whatever its pattern; a rare pattern may look like a source, but not like a near
    one.
    """
    x, y = path(shape, 60, 14.0)
    obs = observations(x, y, np.random.default_rng(seed).normal(-85.0, noise_db, 60))
    result = answer(obs)
    assume(result is not None)
    assert result[1] != "located" or result[0].r95_m > 20.0


# --- odd walks, searched with full effort ---

STILL = np.zeros(100_000)
ODD = {
    "one": observations([5.0], [5.0], [-70.0]),
    "two": observations([0.0, 8.0], [0.0, 1.0], [-70.0, -71.0]),
    "still": observations(STILL[:500], STILL[:500], RNG.normal(-80, 5, 500)),
    "1e5 still": observations(STILL, STILL, RNG.normal(-80, 5, 100_000), 4.0),
    "1e5 trembling": observations(
        *RNG.normal(0, 4, (2, 100_000)), RNG.normal(-80, 5, 100_000), 4.0
    ),
    "same level": observations(np.arange(300) * 2.0, STILL[:300], np.full(300, -80.0)),
    "two levels": observations(np.arange(300) * 2.0, STILL[:300], np.arange(300) % 2 - 80.0),
    "all the same": observations(STILL[:40], STILL[:40], np.full(40, -80.0)),
    "six": observations(np.arange(6) * 20.0, STILL[:6], [-80, -75, -70, -75, -80, -85]),
}


@pytest.mark.parametrize("obs", ODD.values(), ids=ODD)
def test_too_little_to_tell(obs):
    found, result, reasons = answer(obs, Effort())
    assert result == "cannot tell"
    assert reasons
    assert found.r95_m > 50.0


def test_all_at_the_ends_of_the_scale():
    x = np.arange(60) * 8.0
    for level in (
        np.full(60, FLOOR_DBM),
        np.full(60, -47.0),
        np.where(x < 200.0, FLOOR_DBM, -47.0),
    ):
        with pytest.raises(EstimationError, match="within the modem's scale"):
            locate(observations(x, 0 * x, level))


@pytest.mark.parametrize("spread_m", [1e5, 2e7, 1e12, 1e30, 1e300])
def test_places_far_apart(spread_m):
    """A receiver gone mad, up to the size of the Earth and beyond."""
    x, y = spread_m * np.random.default_rng(2).normal(size=(2, 12))
    result = answer(observations(x, y, np.random.default_rng(3).normal(-80, 5, 12)))
    assert result is None or result[1] != "located"


def test_one_mad_fix_does_not_hide_the_rest():
    obs, source = simulate(np.random.default_rng(24), "square", white_db=2.0, count=150, step=5.6)
    x = obs.x_m.copy()
    x[75] += 1e7
    found, _, _ = answer(with_places(obs, x_m=x))
    assert np.hypot(found.x_m - source[0], found.y_m - source[1]) < 60.0


@pytest.mark.parametrize("count", [100_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("sigma_m", [0.0, 3.0])
def test_many_readings_in_one_spot_take_no_longer_each_than_ten_thousand(count, sigma_m):
    x, y = np.random.default_rng(4).normal(0.0, sigma_m, (2, count))
    level = np.random.default_rng(5).normal(-80.0, 5.0, count)

    def locate_spot(n):
        obs = observations(x[:n], y[:n], level[:n], 4.0)
        assert answer(obs, Effort())[1] == "cannot tell"

    check_growth(locate_spot, 10_000, count, most=1.0)
