import numpy as np
import pytest

from logger.core.readings import limit_of, limits


def sides_of(level, rat="GSM"):
    return limits(np.asarray(level, float), rat).tolist()


def test_the_ends_of_the_gsm_scale_are_no_levels():
    assert sides_of([-110, -109, -60, -48, -47]) == [-1, 0, 0, 0, 1]
    assert sides_of([-110, -60], "gsm") == [-1, 0]


def test_elsewhere_a_single_reading_at_the_end_is_a_level():
    assert sides_of([-110, -109, -60, -48, -47], "LTE") == [0] * 5
    assert sides_of([-110, -109, -60, -48, -47], None) == [0] * 5


@pytest.mark.parametrize("rat", ["GSM", "gsm", "LTE", None])
@pytest.mark.parametrize("level", [[-110], [-47], [-110, -47], [-80, -79], [-110, -80, -47]])
def test_a_single_reading_is_told_as_in_company(level, rat):
    assert [limit_of(float(v), rat) for v in level] == sides_of(level, rat)


def test_all_at_the_floor_of_gsm_are_no_levels():
    assert sides_of([-110] * 9) == [-1] * 9
    assert sides_of([-47] * 9) == [1] * 9


@pytest.mark.parametrize("sign", [1, -1])
def test_a_pile_at_one_end_is_an_unknown_end_of_the_scale(sign):
    rng = np.random.default_rng(1)
    level = np.maximum(np.round(rng.normal(-100, 8, 400)), -108.0)
    assert sides_of(sign * level, "LTE") == np.where(level == -108.0, -sign, 0).tolist()


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("count", [8, 40, 600])
def test_levels_that_spread_are_no_pile(seed, count):
    rng = np.random.default_rng(seed)
    level = np.round(
        rng.normal(-85, rng.uniform(2, 10), count) - rng.uniform(0, 20) * np.linspace(0, 1, count)
    )
    assert not any(sides_of(level, "LTE"))


def test_the_same_level_throughout_is_a_level():
    assert sides_of([-80] * 50, "LTE") == [0] * 50
    assert sides_of([-80] * 50) == [0] * 50


def test_two_neighbouring_levels_are_levels():
    """Where one stands still the level flickers between two steps of the scale."""
    assert sides_of([-80, -79] * 25) == [0] * 50
    assert sides_of([-80] * 45 + [-79] * 5) == [0] * 50


def test_nothing_heard():
    assert sides_of([]) == []
