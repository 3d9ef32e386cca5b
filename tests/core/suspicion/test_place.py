from math import log10

import pytest

from tests.kit.suspicion_walks import Walk, gsm


def _past(places_m, slope_db, step_m=30.0):
    """A walk past stations beside a street: the strongest of them, -50 dBm within 30 m."""
    walk = Walk()
    for k in range(1, round((places_m[-1] + 100.0) / step_m) + 1):
        away_m = min(max(abs(k * step_m - place_m), 30.0) for place_m in places_m)
        level_dbm = -50.0 - slope_db * log10(away_m / 30.0)
        walk.scan(gsm(10, round(level_dbm)), metres=step_m)
    return walk


@pytest.mark.parametrize(
    ("apart_m", "slope_db", "rules"),
    [
        (900.0, 15.0, {"S9", "S5"}),  # log evidence 3.2
        (450.0, 25.0, {"S9"}),  # 3.4: an uneven field around one antenna may look like that
        (350.0, 25.0, set()),  # 1.4
    ],
)
def test_far_places_need_less_evidence_than_near_ones(apart_m, slope_db, rules):
    found = _past((100.0, 100.0 + apart_m), slope_db).found
    assert {finding.rule for finding in found} == rules
    assert all(finding.evidence["log_evidence"] < 3.5 for finding in found)


def test_one_place_is_no_finding():
    assert _past((500.0,), 25.0).found == []


def test_two_places_of_few_squares_are_found():
    """A car hears a clone and its original in few squares: no square may go untested."""
    found = _past((100.0, 1000.0), 25.0, step_m=110.0).found
    assert {finding.rule for finding in found} == {"S9", "S5"}
    assert found[0].evidence["squares"] < 10
