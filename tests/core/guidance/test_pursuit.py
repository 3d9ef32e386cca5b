"""When a search ends: located, not heard, no smaller region, nothing suspicious about it."""

from types import SimpleNamespace

import pytest

from logger.core.guidance.pursuit import Pursuit
from logger.core.places import Places

S = 10**9
GIVE_UP_S = 600.0


def _answer(area_m2, r95_m=100.0, verdict="cannot tell", level_dbm=-90.0):
    strongest = SimpleNamespace(level_dbm=level_dbm)
    place = SimpleNamespace(area_m2=area_m2, r95_m=r95_m, strongest=strongest)
    return SimpleNamespace(verdict=verdict, place=place)


def _walks(pursuit, areas_m2, r95_m=100.0, leg_m=100.0, is_suspicious=True, rise_db=0.0):
    """One answer after each leg, in which the strongest reading rises."""
    for k, area_m2 in enumerate(areas_m2):
        t_ns = k * 60 * S
        pursuit.hear(t_ns)
        pursuit.walk(t_ns, Places.of(k * leg_m, 0.0), is_suspicious=is_suspicious)
        pursuit.judge(_answer(area_m2, r95_m, level_dbm=-90.0 + rise_db * k))
    return pursuit.over


@pytest.mark.parametrize(
    ("areas_m2", "is_over"),
    [
        ([1000, 1000, 1000], False),
        ([1000, 1000, 1000, 1000], True),
        ([1000, 1000, 801, 801], True),
        ([1000, 1000, 1000, 800, 800, 800], False),
        ([1000, 2000, 3000, 4000], True),
        ([1000, 2000, 1600, 1600], False),  # of the widest: a few readings are near by the prior
        ([1000, 1000, 1000, 1000, 800], False),
        ([1000, 2000, 1600, 2500, 1700, 2600, 1800], True),  # wider and narrower again says nothing
    ],
)
def test_three_legs_without_a_region_smaller_by_a_fifth_end_it(areas_m2, is_over):
    over = _walks(Pursuit("a", 0, GIVE_UP_S, is_asked=False), areas_m2)
    assert over == ("three legs of walking said nothing more about its place" if is_over else "")


def test_it_goes_on_while_the_walker_comes_nearer():
    assert not _walks(Pursuit("a", 0, GIVE_UP_S, is_asked=False), [1000] * 12, rise_db=1.5)
    assert _walks(Pursuit("a", 0, GIVE_UP_S, is_asked=False), [1000] * 12, rise_db=0.5)


def test_legs_are_longer_while_the_place_is_far_off():
    assert not _walks(Pursuit("a", 0, GIVE_UP_S, is_asked=False), [9e6] * 12, r95_m=1600.0)
    assert _walks(Pursuit("a", 0, GIVE_UP_S, is_asked=False), [9e6] * 14, r95_m=1600.0)


def test_an_ordinary_cell_that_nobody_asked_for_is_not_followed_for_longer_than_ten_minutes():
    smaller = [1e6 * 0.7**k for k in range(12)]
    for is_asked, is_suspicious in ((True, False), (False, True)):
        pursuit = Pursuit("a", 0, GIVE_UP_S, is_asked=is_asked)
        assert not _walks(pursuit, smaller, is_suspicious=is_suspicious)
    pursuit = Pursuit("a", 0, GIVE_UP_S, is_asked=False)
    assert _walks(pursuit, smaller, is_suspicious=False) == "it did not become suspicious"
    pursuit.walk(12 * 60 * S, Places.of(1200.0, 0.0), is_suspicious=True)
    assert not pursuit.over  # its word is a reason to search again


def test_a_location_ends_it_as_long_as_it_holds():
    pursuit = Pursuit("a", 0, GIVE_UP_S, is_asked=True)
    pursuit.judge(_answer(900.0, verdict="located"))
    assert pursuit.over == "located"
    pursuit.judge(_answer(900.0, verdict="ambiguous"))
    assert not pursuit.over


def test_without_a_time_nothing_is_given_up():
    assert not _walks(Pursuit("a", 0, 0.0, is_asked=False), [1000] * 30, is_suspicious=False)
