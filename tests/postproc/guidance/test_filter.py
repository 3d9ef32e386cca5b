import math

import numpy as np
import pytest
from msgspec import UNSET

from logger.core.model.prior import Prior
from logger.core.places import Utm
from postproc.guidance.filter import GuideFilter
from tests.kit.guided_walks import LAT_DEG, LON_DEG, line, rows

EMITTER_M = (120.0, 90.0)


def _walk(*corners_m, **options):
    return list(rows(line(*corners_m), EMITTER_M, **options))


def _answers(walk, guide=None):
    guide = guide or GuideFilter(Prior())
    return [guide.answer(row) for row in walk]


def _off_m(best):
    utm = Utm.at(LAT_DEG, LON_DEG)
    x_m, y_m = utm.to_xy(LAT_DEG, LON_DEG)
    best_m = utm.to_xy(best.lat, best.lon)
    return math.hypot(best_m[0] - x_m - EMITTER_M[0], best_m[1] - y_m - EMITTER_M[1])


def test_there_is_a_best_position_from_the_fifth_level_on():
    answers = _answers(_walk((0.0, 0.0), (200.0, 0.0)))
    assert [answer.best is None for answer in answers[:6]] == [True] * 4 + [False] * 2
    assert all(answer.best is not None for answer in answers[4:])


def test_standing_still_is_answered_with_what_the_prior_allows():
    walk = list(rows(np.zeros((8, 2)), EMITTER_M))
    last = _answers(walk)[-1]
    assert last.verdict == "cannot tell"
    assert last.best.r95_m == pytest.approx(Prior().radius_m(0.95), abs=0.1)
    assert last.next is None


def test_a_walk_around_the_transmitter_locates_it():
    around = (0.0, 0.0), (240.0, 0.0), (240.0, 200.0), (0.0, 200.0), (0.0, 0.0)
    inside = (120.0, 60.0), (120.0, 220.0), (60.0, 60.0), (260.0, 120.0)
    last = _answers(_walk(*around, *inside))[-1]
    assert last.verdict == "located"
    assert last.best.r95_m <= 60.0
    assert _off_m(last.best) <= last.best.r95_m


def test_the_advice_is_repeated_until_another_replaces_it():
    answers = _answers(_walk((0.0, 0.0), (300.0, 0.0)))
    first = next(k for k, answer in enumerate(answers) if answer.next is not None)
    assert all(answer.next is not None for answer in answers[first:])
    changes = [k for k in range(first + 1, len(answers)) if answers[k].next != answers[k - 1].next]
    assert 5 <= len(changes) <= 13  # every 25 m of 300 m


def test_the_azimuth_leads_to_the_position_named():
    answers = _answers(_walk((0.0, 0.0), (120.0, 0.0)))
    last = answers[-1].next
    assert 0.0 <= last.azimuth_deg < 360.0
    utm = Utm.at(LAT_DEG, LON_DEG)
    start_m = np.array(utm.to_xy(LAT_DEG, LON_DEG))
    to_m = np.array(utm.to_xy(last.lat, last.lon)) - start_m
    away_m = np.hypot(*(to_m - [116.0, 0.0]))
    assert away_m == pytest.approx(last.distance_m, abs=30.0)
    assert last.nats_per_km > 0.0


def test_the_same_rows_give_the_same_answers():
    walk = _walk((0.0, 0.0), (300.0, 100.0))
    assert _answers(walk) == _answers(walk)


def test_rows_without_level_or_position_are_answered():
    walk = _walk((0.0, 0.0), (200.0, 0.0))
    guide = GuideFilter(Prior())
    _answers(walk, guide)
    before = guide.answer({"t_s": "900", "lat": "", "lon": "", "rssi_dbm": "-70"})
    after = guide.answer({"t_s": "903", "lat": "52.5", "lon": "13.4", "rssi_dbm": ""})
    assert before.best == _answers(walk)[-1].best
    assert before.error is UNSET
    assert after.error is UNSET


BAD = [
    ("lat", "91", "no position on Earth"),
    ("lat", "0.0", "km from the first one"),
    ("lon", "east", "lon 'east' is not a number"),
    ("rssi_dbm", "70", "rssi_dbm 70 is not from -200 to 50 dBm"),
    ("t_s", "nan", "t_s 'nan' is not a number"),
    ("t_s", "1_0", "t_s '1_0' is not a number"),
    ("acc_m", "-1", "acc_m -1 is not from 0"),
    ("acc_m", "1e200", "acc_m 1e+200 is not from 0"),
]


def test_a_bad_row_is_answered_with_the_reason_and_counts_for_nothing():
    walk = _walk((0.0, 0.0), (160.0, 0.0))
    guide, other = GuideFilter(Prior()), GuideFilter(Prior())
    _answers(walk[:20], guide)
    for column, value, reason in BAD:
        assert reason in guide.answer(walk[20] | {column: value}).error
    assert _answers(walk[20:], guide) == _answers(walk, other)[20:]


def test_a_receiver_without_a_fix_does_not_say_where_the_walk_begins():
    walk = _walk((0.0, 0.0), (160.0, 0.0))
    guide = GuideFilter(Prior())
    answer = guide.answer(walk[0] | {"lat": "0.0", "lon": "0"})
    assert "no fix" in answer.error
    assert _answers(walk, guide) == _answers(walk)


def test_spaces_around_a_cell_are_not_part_of_its_name():
    walk = _walk((0.0, 0.0), (40.0, 0.0))
    guide = GuideFilter(Prior(), cell="a")
    _answers([row | {"cell": " a "} for row in walk], guide)
    assert guide.levels == len(walk)


def test_rows_of_other_cells_are_positions_only():
    walk = _walk((0.0, 0.0), (200.0, 0.0))
    mixed = [
        one for row in walk for one in (row | {"cell": "a"}, row | {"cell": "b", "rssi_dbm": "-40"})
    ]
    alone = _answers(walk)
    for cell in ("a", None):
        followed = GuideFilter(Prior(), cell=cell)
        answers = [followed.answer(row) for row in mixed][1::2]
        assert [answer.best for answer in answers] == [answer.best for answer in alone]


def test_rows_without_a_name_are_not_of_the_cell_that_a_later_row_names():
    walk, guide = _walk((0.0, 0.0), (40.0, 0.0)), GuideFilter(Prior())
    for name, n_levels in (("", 0), ("a", len(walk)), ("", len(walk))):
        _answers([row | {"cell": name} for row in walk], guide)
        assert guide.levels == n_levels


def test_advice_follows_the_streets_of_a_map():
    utm = Utm.at(LAT_DEG, LON_DEG)
    x_m, y_m = utm.to_xy(LAT_DEG, LON_DEG)
    lines = [
        [utm.to_latlon(x_m + 80.0 * k, y_m + along_m) for along_m in (-400.0, 400.0)]
        for k in range(-5, 6)
    ] + [
        [utm.to_latlon(x_m + along_m, y_m + 80.0 * k) for along_m in (-400.0, 400.0)]
        for k in range(-5, 6)
    ]
    answers = _answers(_walk((0.0, 0.0), (160.0, 0.0)), GuideFilter(Prior(), lines=lines))
    shown = [answer.next.azimuth_deg for answer in answers if answer.next]
    # true north differs from grid north by at most 3 degrees here
    assert all(min(azimuth % 90.0, 90.0 - azimuth % 90.0) < 3.0 for azimuth in shown)
